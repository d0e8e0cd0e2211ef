"""A moving weight bends the bed: the body of one axis tilts with the position of another axis."""

from __future__ import annotations

from ..kinematics import Slot
from ..records import COMPONENTS, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, label, moved_axes, need

TEXT = "the weight of a moving axis tilts another one"
SOURCE = "ISO 230-1:2012, 3.4.3; error motion that depends on two positions"
FRAME = "machine"
MISTAKEN = ("error_motion",)
ADVICE = "check levelling and foundation, or keep the term"
REFINE: dict[str, str] = {}


def variants(touches: Touches) -> Variants:
    """touches → tilts of every linear axis with the position of every other."""
    axes = moved_axes(touches, touches.machine.linear, 50.0)
    for axis in axes:
        for other in axes:
            if other != axis:
                for component in "ABC":
                    yield {"axis": axis, "with": other, "component": component}


def cause(machine: Machine, axis: str, component: str, **other: str) -> list[Coefficient]:
    """machine, axis that tilts, A B or C, `with`: axis that moves → coefficient in rad/mm."""
    mover = other.get("with", "")
    need("moving_mass", "axis", axis, machine.linear)
    need("moving_mass", "with", mover, [a for a in machine.linear if a != axis])
    need("moving_mass", "component", component, "ABC")
    slot = Slot(axis, "intra", COMPONENTS.index(component))
    return [Coefficient(label("moving_mass", axis, component, mover), "rad/mm", slot, lambda t: t.axis(mover))]
