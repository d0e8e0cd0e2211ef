"""The frame that a control counts in: along its own axes, whatever the frame of machine.yaml is.

A control does not know the frame of machine.yaml. Its x, y and z are where the tool goes against the workpiece for + of X, Y and Z
(ISO 841), whichever of both the axis carries. The frame of machine.yaml may be turned against that, or be its mirror image: one in
which x is where the table of X goes is. Places follow the turn; in a mirror axes of rotation turn round besides, as a right-handed
turn looks left-handed there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..kinematics import Slot, Stage, axis_frame
from ..records import COMPONENTS, Array, InputError, Machine

SQUARE = 1e-9  # by which two directions at right angles may miss it: machine.yaml has twelve digits
ALONG = 0.02  # of a direction: a nominal axis that is as near to that of machine.yaml is that


def ways(machine: Machine) -> Array:
    """machine → (3, 3) unit vectors in machine.yaml, where the tool goes against the workpiece for + of X, Y, Z."""
    rows = [np.array(machine.axis(a).direction) * (-1.0 if a in machine.workpiece_branch else 1.0) for a in "XYZ"]
    found = np.array(rows) + 0.0  # nothing has no sign
    return np.eye(3) if np.abs(found - np.eye(3)).max() < ALONG else found


def of_control(machine: Machine) -> Array:
    """machine → (3, 3), orthogonal: a vector of machine.yaml becomes one along the axes of the control; det −1: a mirror image.

    Raises InputError for linear axes that are not at right angles: along them no control counts centers and directions.
    """
    found = ways(machine)
    if np.abs(found @ found.T - np.eye(3)).max() > SQUARE:
        raise InputError(
            "--target: found linear axes that are not at right angles in machine.yaml; allowed: X, Y and Z at right angles, as "
            "centers, directions and component errors are counted along them. Settings without these can be written"
        )
    return found


def as_controlled(machine: Machine) -> Machine:
    """machine of machine.yaml → the same machine in the frame of its control.

    It stays as it is where both frames are equal, and where the linear axes are not at right angles: then the control has no frame.
    """
    turn = ways(machine)
    if np.array_equal(turn, np.eye(3)) or np.abs(turn @ turn.T - np.eye(3)).max() > SQUARE:
        return machine
    sense = round(float(np.linalg.det(turn)))

    def moved(vector: Array) -> tuple[float, float, float]:
        x, y, z = (float(v) for v in turn @ vector + 0.0)
        return x, y, z

    axes = tuple(
        replace(a, direction=moved(np.array(a.direction) * (sense if a.kind == "rotary" else 1)), point=moved(np.array(a.point)))
        for a in machine.axes
    )
    return replace(machine, axes=axes)


def back(machine: Machine, vector: Array, *, about: bool = False) -> Array:
    """machine of machine.yaml, (3,) along the axes of its control → (3,) in machine.yaml; `about`: it is an axis of rotation."""
    turn = of_control(machine)
    sense = round(float(np.linalg.det(turn))) if about else 1
    return np.asarray(sense * (turn.T @ vector))


def component(machine: Machine, axis: str, stage: Stage, i: int) -> tuple[Slot, int]:
    """machine of machine.yaml, axis, stage, x y z A B C along the axes of its control → the error of the model, its sign there.

    Raises InputError where an inclined axis makes it a mixture of several.
    """
    turn = of_control(machine)
    if np.array_equal(turn, np.eye(3)):
        return Slot(axis, stage, i), 1
    own, there = (axis_frame(axis, m.axis(axis).direction)[0] for m in (machine, as_controlled(machine)))
    frames = [np.eye(3) if rows is None else rows for rows in (own, there)]
    row = (frames[1] @ turn @ frames[0].T)[i % 3]
    j = int(np.argmax(np.abs(row)))
    if abs(row[j]) < 1 - SQUARE:
        raise InputError(
            f"--target: found E{COMPONENTS[i]}{axis}, which is a mixture of several errors along the axes of the control; "
            "allowed: a machine.yaml whose x, y and z are where the tool goes for + of X, Y and Z"
        )
    sense = round(float(np.linalg.det(turn))) if i >= 3 else 1
    return Slot(axis, stage, j + 3 * (i >= 3)), sense * (1 if row[j] > 0 else -1)


def said(machine: Machine) -> str:
    """machine of machine.yaml → where its control has x, y and z, for a person; '' where both frames are one."""
    turn = ways(machine)
    if np.array_equal(turn, np.eye(3)):
        return ""
    listed = ", ".join(f"+{a} along {_along(row)}" for a, row in zip("XYZ", turn, strict=True))
    mirror = ": its mirror image" if np.linalg.det(turn) < 0 else ""
    return f"the tool goes for {listed} of machine.yaml{mirror}"


def along_the_drawing(record: Mapping[str, Any], machine: Machine) -> str:
    """record of a compensation, machine of machine.yaml → why its numbers are not along the axes of the control; '' where they are.

    An earlier version wrote centers, directions and component errors along the axes of machine.yaml.
    """
    counted = any("uncorrected" in v or v.get("table") == "axis locations" for v in record["values"])
    return said(machine) if counted and "along" not in record else ""


def _along(row: Array) -> str:
    for letter, value in zip("xyz", row, strict=True):
        if abs(abs(value) - 1) < SQUARE:
            return f"{'+' if value > 0 else '-'}{letter}"
    return f"[{', '.join(f'{v:.4g}' for v in row)}]"
