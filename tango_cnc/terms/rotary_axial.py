"""A rotary axis moves along its axis at a harmonic of its angle (EZC of a C axis), which no low polynomial follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, need
from ._rotary import along, every, harmonics
from ._world import Effects, wave


def variants(touches: Touches) -> Variants:
    """touches → orders 1 to 4 of every rotary axis."""
    yield from every(touches, {axis: along(axis) for axis in touches.machine.rotary})


def make(machine: Machine, axis: str, order: int = 2, motion: str | None = None, frame: str = "turning") -> list[Coefficient]:
    """machine, rotary axis, order, one component or all → cosines and sines, mm; turning with the body, or fixed."""
    need("rotary_axial", "axis", axis, machine.rotary)
    return harmonics("rotary_axial", machine, axis, order, along(axis), motion, frame)


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → a wave along the axis (world.yaml); whether it turns with the body is the same there."""
    return [{"cause": "rotary_axial", "axis": setting["axis"], "order": setting.get("order", 2)} | wave(values)]


TERM = Cause(
    text="a rotary axis moves along its axis as it turns",
    source="ISO 230-7:2015, 3.2.6 to 3.2.8; ISO 230-1:2012, 3.6",
    frame="axis",
    mistaken=("rotary_radial", "rotary_tilt", "gravity_sag"),
    plainer=("gravity_sag",),  # one wave a turn of a body that tilts: its weight does that, whatever the bearing does
    says="the body of {axis} moves along its axis in {waves}, by {size}",
    meaning="surfaces that are turned or milled around this axis rise and fall by this within a turn",
    advice="check the bearing and its preload, or keep the term",
    refine={},
    variants=variants,
    make=make,
    turning=True,
    effects=effects,
)
