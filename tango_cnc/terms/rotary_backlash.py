"""Lost motion of a rotary axis: it stops short in the direction of its last motion, `l_k d_k`."""

from __future__ import annotations

from ..kinematics import Slot
from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, label, need


def variants(touches: Touches) -> Variants:
    """touches → every rotary axis that came from both sides."""
    for axis in touches.machine.rotary:
        if len(set(touches.sign(axis)) - {0.0}) == 2:
            yield {"axis": axis}


def make(machine: Machine, axis: str) -> list[Coefficient]:
    """machine, rotary axis → coefficient in rad."""
    need("rotary_backlash", "axis", axis, machine.rotary)
    return [Coefficient(label("rotary_backlash", axis), "rad", Slot(axis, "motion"), lambda t: t.sign(axis))]


TERM = Cause(
    text="a rotary axis has lost motion",
    source="ISO 230-1:2012, 3.5.6; ISO 230-2:2014",
    frame="axis",
    mistaken=("encoder_harmonic",),
    follows="d{axis}",
    says="{axis} stops short on either side; the touch that feels it most is off by {size}",
    meaning="an angle that is reached from the other side is off by twice this; the error grows with the distance from the axis",
    advice="always index from the same side, adjust the drive, or compensate the reversal value",
    refine={},
    variants=variants,
    make=make,
)
