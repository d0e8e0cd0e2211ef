"""A moving weight bends the bed: the body of one axis tilts with the position of another axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..kinematics import Slot
from ..records import COMPONENTS, Array, Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import Variants, label, moved_axes, need, times
from ._world import Effects, full


def variants(touches: Touches) -> Variants:
    """touches → angles of every axis with the position of every other."""
    axes = [*moved_axes(touches, touches.machine.linear, 50.0), *moved_axes(touches, touches.machine.rotary, 0.3)]
    for axis in axes:
        for by in axes:
            if by != axis:
                for component in "ABC":
                    yield {"name": f"E{component}{axis}", "by": by}


def make(machine: Machine, name: str, by: str) -> list[Coefficient]:
    """machine, angle such as EAZ, axis that moves → coefficient in rad/mm or rad/rad."""
    axes = (*machine.linear, *machine.rotary)
    need("moving_mass", "name", name, [f"E{c}{a}" for a in axes for c in "ABC"])
    need("moving_mass", "by", by, [a for a in axes if a != name[2]])
    slot = Slot(name[2], "motion") if name[1] == name[2] else Slot(name[2], "intra", COMPONENTS.index(name[1]))
    unit = "rad/mm" if by in machine.linear else "rad/rad"
    return [Coefficient(label("moving_mass", name, by), unit, slot, lambda t: t.axis(by))]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the angle after 100 mm or 1 rad of the axis that moves (world.yaml)."""
    own, span = full(machine, str(setting["by"]))
    return [
        {"cause": "moving_mass", "name": setting["name"], "by": setting["by"], "amplitude": float(values[0]) * own, "span": span}
    ]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → tilts of an axis that grow with the place of another, without its name."""
    machine = touches.machine
    for by in moved_axes(touches, machine.linear, 1.0):
        for axis in (*machine.linear, *machine.rotary):
            for turn in range(3, 6):
                if axis != by and (lever := touches.seen.slots.get(Slot(axis, "intra", turn))) is not None:
                    yield by, f"tilt of {axis}", "power", times(touches.axis(by)[:, None], lever)


TERM = Cause(
    text="the weight of a moving axis tilts another one",
    source="ISO 230-1:2012, 3.4.3; error motion that depends on two positions",
    frame="machine",
    mistaken=("error_motion",),
    says="{name} grows with the position of {by}; the touch that feels it most is off by {size}",
    meaning="squareness depends on where the other axis stands: large parts suffer, small ones hardly",
    advice="check levelling and foundation, or keep the term",
    refine={},
    variants=variants,
    make=make,
    unnamed=unnamed,
    effects=effects,
)
