"""Backlash `EXXb`: the axis lags by this much in the direction of its last motion (command units, mm or rad)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from ..kinematics import Slot
from ..records import InputError, Machine
from ..touches import Touches
from . import Cause, Coefficient

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


def variants(touches: Touches) -> Iterator[dict[str, Any]]:
    """touches → every linear axis that came from both sides."""
    for axis in touches.machine.linear:
        if len(set(touches.sign(axis)) - {0.0}) == 2:
            yield {"axis": axis}


def make(machine: Machine, axis: str) -> list[Coefficient]:
    """machine, linear axis → its coefficient in mm. Raises InputError for another axis."""
    found = coefficient(f"E{axis}{axis}b", machine)
    if found is None:
        raise InputError(f"terms: backlash: axis: found {axis!r}; allowed: {', '.join((*machine.linear, *machine.rotary))}")
    return [found]


TERM = Cause(
    text="backlash",
    source="ISO 230-1:2012, 3.5.6 (half of the reversal value); thesis section 4.4",
    frame="axis",
    mistaken=("probe_lobing",),
    follows="d{axis}",
    says="{axis} stops {size} short on either side (half of its reversal value)",
    meaning="a contour that reverses this axis has a step of twice this size at the reversal",
    advice="compensate the reversal value, or put the coefficient into the terms of the model",
    refine={},
    coefficients=coefficients,
    coefficient=coefficient,
    variants=variants,
    make=make,
)
