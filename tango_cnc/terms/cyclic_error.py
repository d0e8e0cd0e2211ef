"""A linear axis errs with the period of its screw or scale: `n_k cos(2π q_k/p + φ)`."""

from __future__ import annotations

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, label, moved_axes, need, wave

TEXT = "a linear axis has a periodic error (screw pitch, scale period)"
SOURCE = "ISO 230-2:2014; ISO 230-1:2012, 3.5.4 (periodic error motion)"
FRAME = "axis"
MISTAKEN = ("cyclic_error",)
SAYS = "{axis} errs by {size} to either side, once every {period}"
MEANING = "steps and waves of this size on surfaces that the axis cuts along its way"
ADVICE = "check the screw's bearing and the scale's interpolation; several periods can look alike to few touches"
REFINE = {"period": "wave"}
SHORTEST, LONGEST = 5.0, 80.0  # mm


def variants(touches: Touches) -> Variants:
    """touches → periods between 5 and 80 mm on every linear axis, so close that none falls between two."""
    for axis in moved_axes(touches, touches.machine.linear, 2 * LONGEST):
        step = 0.4 / float(np.ptp(touches.axis(axis)))
        for frequency in np.arange(1 / LONGEST, 1 / SHORTEST + step / 2, step):
            yield {"axis": axis, "period": float(1 / frequency)}


def cause(machine: Machine, axis: str, period: float) -> list[Coefficient]:
    """machine, linear axis, period in mm → cosine and sine, mm."""
    need("cyclic_error", "axis", axis, machine.linear)

    def angle(t: Touches) -> Array:
        return 2 * np.pi * t.axis(axis) / period

    return wave(label("cyclic_error", axis, period), Slot(axis, "motion"), angle, "mm")
