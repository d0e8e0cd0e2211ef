"""A rotary axis tilts at a harmonic of its angle (EAC, EBC of a C axis), which no low polynomial follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, need
from ._rotary import across, every, harmonics, waves
from ._world import Effects


def variants(touches: Touches) -> Variants:
    """touches → orders 1 to 4 of every rotary axis."""
    yield from every(touches, {axis: across(axis, rotation=True) for axis in touches.machine.rotary})


def make(machine: Machine, axis: str, order: int = 2, motion: str | None = None, frame: str = "turning") -> list[Coefficient]:
    """machine, rotary axis, order, one component or all → cosines and sines, rad; turning with the body, or fixed."""
    need("rotary_tilt", "axis", axis, machine.rotary)
    return harmonics("rotary_tilt", machine, axis, order, across(axis, rotation=True), motion, frame)


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → one wave along every component that was estimated (world.yaml)."""
    return waves("rotary_tilt", machine, setting, values, across(str(setting["axis"]), rotation=True))


TERM = Cause(
    text="a rotary axis tilts as it turns",
    source="ISO 230-7:2015, 3.2.6 to 3.2.8; ISO 230-1:2012, 3.6",
    frame="axis",
    mistaken=(
        "rotary_radial",
        "rotary_axial",
    ),
    says="the body of {axis} tilts in {waves}; the touch that feels it most is off by {size}",
    meaning="features around this axis are tilted, depending on its angle; the error grows with the distance from the axis",
    advice="check the bearing and its preload, or keep the term",
    refine={},
    variants=variants,
    make=make,
    turning=True,
    effects=effects,
)
