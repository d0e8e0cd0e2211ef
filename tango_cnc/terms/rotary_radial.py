"""A rotary axis moves sideways at a harmonic of its angle (EXC, EYC of a C axis), which no low polynomial follows."""

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
    yield from every(touches, {axis: across(axis, rotation=False) for axis in touches.machine.rotary})


def make(machine: Machine, axis: str, order: int = 2, motion: str | None = None, frame: str = "turning") -> list[Coefficient]:
    """machine, rotary axis, order, one component or all → cosines and sines, mm; turning with the body, or fixed."""
    need("rotary_radial", "axis", axis, machine.rotary)
    return harmonics("rotary_radial", machine, axis, order, across(axis, rotation=False), motion, frame)


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → one wave along every component that was estimated (world.yaml)."""
    return waves("rotary_radial", machine, setting, values, across(str(setting["axis"]), rotation=False))


TERM = Cause(
    text="a rotary axis moves sideways as it turns",
    source="ISO 230-7:2015, 3.2.6 to 3.2.8; ISO 230-1:2012, 3.6",
    frame="axis",
    mistaken=("rotary_axial", "rotary_tilt", "gravity_sag"),
    plainer=("gravity_sag",),  # one wave a turn of a body that tilts: its weight does that, whatever the bearing does
    says="the body of {axis} moves sideways in {waves}, by {size}",
    meaning="features around this axis are off sideways by this, depending on its angle",
    advice="check the bearing and its preload, or keep the term",
    refine={},
    variants=variants,
    make=make,
    turning=True,
    effects=effects,
)
