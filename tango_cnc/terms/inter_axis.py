"""Inter-axis (axis location) errors `EX0C`: constant, in the axis frame, before the motion."""

from __future__ import annotations

import re

import numpy as np

from ..kinematics import Slot
from ..records import COMPONENTS, Machine
from . import Coefficient, Family

PATTERN = re.compile(r"E([XYZABC])0([XYZABCS])")


def coefficient(name: str, machine: Machine) -> Coefficient | None:
    """`EX0C` → coefficient in mm or rad, or None."""
    match = PATTERN.fullmatch(name)
    if match is None or match[2] not in machine.names:
        return None
    component = COMPONENTS.index(match[1])
    return Coefficient(name, "mm" if component < 3 else "rad", Slot(match[2], "inter", component), lambda t: np.ones(len(t)))


def coefficients(machine: Machine, degree: int) -> list[Coefficient]:
    """machine → every inter-axis error, first those by which ISO 230-1 (annex A) describes a machine.

    The order decides which of several names for one and the same displacement is kept. From the foundation outwards, the
    workpiece branch first: the squareness of each linear axis to those before it, the spindle's two offsets, then each
    rotary axis but for its own zero position; last what only another choice of reference would call by these names.
    """
    chain = (*machine.workpiece_branch, *machine.tool_branch)
    linear = [name for name in chain if name in machine.linear]
    rotary = [name for name in chain if name in machine.rotary]
    third = {frozenset("XY"): "C", frozenset("XZ"): "B", frozenset("YZ"): "A"}
    names = [f"E{third[frozenset((axis, earlier))]}0{axis}" for i, axis in enumerate(linear) for earlier in linear[:i]]
    names += ["EX0S", "EY0S"]
    names += [f"E{c}0{axis}" for axis in rotary for c in COMPONENTS if c != axis]
    names += [name for axis in (*rotary, "S", *linear) for c in COMPONENTS if (name := f"E{c}0{axis}") not in names]
    return [found for name in names if (found := coefficient(name, machine)) is not None]


TERM = Family(
    text="axis location error",
    source="ISO 230-1:2012, 3.9.4; thesis eq. 4-5",
    coefficients=coefficients,
    coefficient=coefficient,
)
