"""Backlash `EXXb`: the axis lags by this much in the direction of its last motion (command units, mm or rad)."""

from __future__ import annotations

import re

from ..kinematics import Slot
from ..records import Machine
from . import Coefficient

TEXT = "backlash"
SOURCE = "ISO 230-1:2012, 3.5.6 (half of the reversal value); thesis section 4.4"

PATTERN = re.compile(r"E([XYZABC])\1b")


def coefficient(name: str, machine: Machine) -> Coefficient | None:
    """`EXXb` → coefficient in mm or rad, or None."""
    match = PATTERN.fullmatch(name)
    if match is None or match[1] not in machine.names:
        return None
    axis = match[1]
    return Coefficient(name, "mm" if axis in machine.linear else "rad", Slot(axis, "motion"), lambda t: t.sign(axis))


def coefficients(machine: Machine, degree: int) -> list[Coefficient]:
    """machine → one of every linear and rotary axis."""
    names = [f"E{axis}{axis}b" for axis in (*machine.linear, *machine.rotary)]
    return [found for name in names if (found := coefficient(name, machine)) is not None]
