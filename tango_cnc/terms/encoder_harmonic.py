"""The scale disc of a rotary axis is off centre (order 1), oval (order 2) …: `l_k cos(m q_k + φ)`."""

from __future__ import annotations

import numpy as np

from ..kinematics import Slot
from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, label, need

ORDERS = (1, 2, 3, 4, 5, 6)


def variants(touches: Touches) -> Variants:
    """touches → orders 1 to 6 of every rotary axis."""
    for axis in touches.machine.rotary:
        if len(np.unique(np.round(touches.axis(axis), 3))) > 3:
            for order in ORDERS:
                yield {"axis": axis, "order": order}


def make(machine: Machine, axis: str, order: int = 1) -> list[Coefficient]:
    """machine, rotary axis, order → cosine and sine, rad."""
    need("encoder_harmonic", "axis", axis, machine.rotary)
    stem, slot = label("encoder_harmonic", axis, order), Slot(axis, "motion")
    return [
        Coefficient(f"{stem}.cos", "rad", slot, lambda t: np.cos(order * t.axis(axis))),
        Coefficient(f"{stem}.sin", "rad", slot, lambda t: np.sin(order * t.axis(axis))),
    ]


TERM = Cause(
    text="the angle encoder of a rotary axis has a periodic error",
    source="ISO 230-2:2014; ISO 230-7:2015, 3.2 (orders)",
    frame="axis",
    mistaken=("axis_location", "rotary_backlash"),
    says="the angle of {axis} errs in {waves}; the touch that feels it most is off by {size}",
    meaning="every angle of this axis is off by a wave around the turn; the error of a part grows with its distance from the axis",
    advice="have the encoder centred or compensated by a table of the control, or keep the term",
    refine={},
    variants=variants,
    make=make,
    turning=True,
)
