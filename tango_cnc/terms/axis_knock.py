"""A rotary axis was pushed on what carries it, and stays there: its axis location errors change from one touch on.

What carries everything is the foundation: there a displacement is that of `step` in the machine frame. So only an axis that another
rotary axis carries is meant: a table on its cradle, a spindle head on its fork.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..kinematics import Slot
from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label, moments, since


def variants(touches: Touches) -> Variants:
    """touches → every moment, of every axis that another one carries."""
    for axis in touches.machine.carried:
        yield from ({"axis": axis, "at": at} for at in moments(touches))


def make(machine: Machine, at: float, axis: str, direction: Sequence[float] | None = None) -> list[Coefficient]:
    """machine, first touch after it (its number in the readings), axis → displacement in x y z of what carries it, mm."""
    stem, after = label("axis_knock", axis, int(at)), since(at)
    slots = [Slot(axis, "inter", i) for i in range(3)]
    if direction is None:
        return [Coefficient(f"{stem}.{c}", "mm", slot, after) for c, slot in zip("xyz", slots, strict=True)]
    unit = np.array(direction, dtype=float) / np.linalg.norm(direction)
    own = early(stem, lambda t: -after(t) * sum(t.seen.slots[slot] * part for slot, part in zip(slots, unit, strict=True)))
    return [own]


TERM = Cause(
    text="a rotary axis was pushed on what carries it",
    source="change-point model of the axis location errors of ISO 230-1:2012, 3.9.4",
    frame="axis",
    mistaken=("step", "stylus_knock"),
    in_place_of="step",
    says="the {axis} axis moved {size} {towards} on what carries it {moment}, {clock} after the start",
    meaning="parts before and after that moment do not fit together; a calibration across it describes neither machine",
    advice="find out what happened at that moment, look at the mounting of this axis, and measure again",
    refine={"at": "touch"},
    example={"axis": "C", "at": 20},
    variants=variants,
    make=make,
)
