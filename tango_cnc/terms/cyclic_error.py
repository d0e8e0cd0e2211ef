"""A linear axis errs with the period of its screw or scale: `n_k cos(2π q_k/p + φ)`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient, Setting, Shape
from ._cause import Variants, fraction, label, moved_axes, need, times, wave

RESOLVED = 1.0  # waves over the way of an axis by which two periods differ, or they are one
FINE = 0.2  # waves over the way between two periods that are tried: at half of it little is lost of the one that is there
SHORTEST, LONGEST = 5.0, 80.0  # mm


def variants(touches: Touches) -> Variants:
    """touches → periods between 5 and 80 mm on every linear axis, so close that none falls between two."""
    for axis in moved_axes(touches, touches.machine.linear, 2 * LONGEST):
        step = FINE / float(np.ptp(touches.axis(axis)))
        for frequency in np.arange(1 / LONGEST, 1 / SHORTEST + step / 2, step):
            yield {"axis": axis, "period": float(1 / frequency)}


def make(machine: Machine, axis: str, period: float) -> list[Coefficient]:
    """machine, linear axis, period in mm → cosine and sine, mm."""
    need("cyclic_error", "axis", axis, machine.linear)

    def angle(t: Touches) -> Array:
        return 2 * np.pi * t.axis(axis) / period

    return wave(label("cyclic_error", axis, period), Slot(axis, "motion"), angle, "mm")


def beside(touches: Touches, setting: Setting, chosen: Sequence[Setting]) -> bool:
    """touches, setting, those chosen on this axis → whether its period differs from theirs by a wave over the way, or more."""
    way = float(np.ptp(touches.axis(setting["axis"])))
    return all(abs(way / setting["period"] - way / o["period"]) > RESOLVED for o in chosen)


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → waves along linear axes, without its name."""
    for axis in touches.machine.linear:
        values = touches.axis(axis)
        for cycles in np.arange(3, np.ptp(values) / 5, 0.4):
            angle = 2 * np.pi * cycles * fraction(values)
            yield axis, f"axis {axis}", "periodic", times(np.column_stack([np.cos(angle), np.sin(angle)]), touches.lever(axis))


TERM = Cause(
    text="a linear axis has a periodic error (screw pitch, scale period)",
    source="ISO 230-2:2014; ISO 230-1:2012, 3.5.4 (periodic error motion)",
    frame="axis",
    mistaken=("cyclic_error",),
    says="{axis} errs by {size} to either side, once every {period}",
    meaning="steps and waves of this size on surfaces that the axis cuts along its way",
    advice="check the screw's bearing and the scale's interpolation; several periods can look alike to few touches",
    refine={"period": "wave"},
    variants=variants,
    units={"period": "mm"},
    make=make,
    unnamed=unnamed,
    beside=beside,
)
