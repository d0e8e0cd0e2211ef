"""What was estimated of a cause, as entries of `effects` in world.yaml: the simulated machine gets what the real one seems to have.

Most causes take the settings of their effect and a size, a direction or a phase besides (`usual`). Where term and effect are
told in other words, the file of the cause has `effects(machine, setting, values)` of its own; an empty list means that the
simulated machine has nothing that does the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..kinematics import axis_frame
from ..records import Array, Machine

FULL = 100.0  # mm at which an error that grows with the way of a linear axis has its amplitude; 1 rad of a rotary one
Effects = list[dict[str, Any]]


def usual(cause: str, setting: Mapping[str, Any], names: Sequence[str], values: Array) -> Effects:
    """cause, its setting, names and values of its coefficients → effects: one size, a vector x y z, or a cosine and a sine."""
    if setting.get("sensor") is not None:
        return []
    base = {"cause": cause, **{k: list(v) if isinstance(v, tuple) else v for k, v in setting.items() if v is not None}}
    tails = [name.rpartition("]")[2] or name for name in names]
    if len(values) == 1:
        return [base | {"amplitude": float(values[0])}]
    if [t[-2:] for t in tails] in ([".x", ".y", ".z"], [".x", ".y"]):  # two: nothing goes along the last one
        return [base | vector(np.pad(values, (0, 3 - len(values))))]
    if [t[-3:] for t in tails] == ["cos", "sin"]:
        return [base | wave(values)]
    return []


def vector(values: Array) -> dict[str, Any]:
    """(3,) → amplitude and direction."""
    size = float(np.linalg.norm(values))
    return {"amplitude": size, "direction": [float(x) for x in (values / size if size else np.eye(3)[0])]}


def wave(values: Array) -> dict[str, Any]:
    """cosine, sine → amplitude and phase in deg of amplitude · cos(angle + phase)."""
    return {"amplitude": float(np.hypot(*values)), "phase": float(np.degrees(np.arctan2(-values[1], values[0])))}


def toward(machine: Machine, axis: str, letter: str) -> list[float]:
    """axis, component X … C of its frame → the direction of that component in the machine frame at the zero pose."""
    frame, _, _ = axis_frame(axis, machine.axis(axis).direction)
    i = "XYZABC".index(letter) % 3
    return [float(x) for x in (np.eye(3) if frame is None else frame)[i]]


def full(machine: Machine, axis: str) -> tuple[float, float]:
    """axis → way at which an error has its amplitude: in mm or rad, and in mm or deg as in files."""
    return (FULL, FULL) if axis in machine.linear else (1.0, float(np.degrees(1.0)))
