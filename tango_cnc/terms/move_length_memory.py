"""Where an axis stops depends on how far it came: a function of the length of its last move, not of its sign."""

from __future__ import annotations

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, label, moved_axes, need


def way(t: Touches, axis: str) -> Array:
    """touches, letter → (n,) mm or rad, how far that axis came since the touch before."""
    place = t.axis(axis)
    return np.abs(np.diff(place, prepend=place[:1]))


def variants(touches: Touches) -> Variants:
    """touches → every axis, proportional to the length or settling over some length."""
    machine = touches.machine
    for axis in [*moved_axes(touches, machine.linear, 10.0), *moved_axes(touches, machine.rotary, 0.2)]:
        yield {"axis": axis, "shape": "linear"}
        for length in (10.0, 30.0, 100.0, 300.0):
            yield {"axis": axis, "shape": "exponential", "length": length}


def make(machine: Machine, axis: str, shape: str = "linear", length: float = 100.0) -> list[Coefficient]:
    """machine, axis, way/length or 1 − e^(−way/length), length in mm or deg → coefficient in mm or rad."""
    need("move_length_memory", "axis", axis, (*machine.linear, *machine.rotary))
    need("move_length_memory", "shape", shape, ("linear", "exponential"))

    unit = "mm" if axis in machine.linear else "rad"

    def memory(t: Touches) -> Array:
        relative = way(t, axis) / (length if axis in machine.linear else np.radians(length))
        return relative if shape == "linear" else 1 - np.exp(-relative)

    return [Coefficient(label("move_length_memory", axis, shape, length), unit, Slot(axis, "motion"), memory)]


TERM = Cause(
    text="where an axis stops depends on the length of its last move",
    source="servo settling and guide friction; ISO 230-1:2012, 3.5.7",
    frame="axis",
    mistaken=("backlash",),
    follows="way of {axis}",
    says="where {axis} stops depends on how far it came, by {size}",
    meaning="positions that are reached by long moves are off against those reached by short ones",
    advice="approach every touch from the same distance, add a dwell after long moves, or keep the term",
    refine={"length": "log"},
    variants=variants,
    over="time",
    units={"length": "mm"},
    make=make,
)
