"""The screw of a linear axis warms with its way and cools: the axis is off by `α h(t) (q_k − z)`, from the end z that is held."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, WIDE, Variants, ends, fraction, label, moved_axes, need, times
from .move_length_memory import way

METRE = 1000.0  # mm


def heat(touches: Touches, axis: str, tau: float) -> Array:
    """touches, linear axis, time constant s → (n,) m of way whose heat is still in the screw; each day begins cold."""
    going, clock = way(touches, axis) / METRE, touches.warm
    gone = np.diff(clock, prepend=clock[:1])
    kept = np.where(gone < 0, 0.0, np.exp(-np.maximum(gone, 0.0) / tau))
    going[gone < 0] = 0.0
    found, left = [], 0.0
    for more, share in zip(going.tolist(), kept.tolist(), strict=True):
        left = left * share + more
        found.append(left)
    return np.array(found)


def variants(touches: Touches) -> Variants:
    """touches → every linear axis that goes somewhere, held at either end or at its zero, with three time constants."""
    run = max(float(np.ptp(touches.warm)), 1.0)
    for axis in moved_axes(touches, touches.machine.linear, WIDE):
        for zero in (*ends(touches, axis), 0.0):  # where nobody has stated it: at an end, or at the reading zero of a scale
            for part in (0.05, 0.25, 1.5):  # the search looks between the ends of these
                yield {"axis": axis, "tau": part * run, "zero": zero}


def make(machine: Machine, axis: str, tau: float = HOUR / 4, zero: float = 0.0) -> list[Coefficient]:
    """machine, linear axis, time constant s, reading mm where the screw is held → growth in mm/mm a m of way."""
    need("screw_heat", "axis", axis, machine.linear)
    stem = label("screw_heat", axis, tau, zero)
    return [Coefficient(stem, "mm/mm", Slot(axis, "motion"), lambda t: heat(t, axis, tau) * (t.axis(axis) - zero))]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → screws that warm by their way, without its name."""
    for axis, tau in dict.fromkeys((s["axis"], s["tau"]) for s in variants(touches)):
        warm = fraction(heat(touches, axis, tau))
        place = np.column_stack([np.ones(len(warm)), touches.axis(axis) / 100.0])
        yield f"way of {axis}", f"axis {axis}", "heat", times(warm[:, None], touches.lever(axis)[:, None] * place)


TERM = Cause(
    text="the screw of an axis warms with the way that it goes",
    source="ISO 230-3:2020 clause 7 (thermal distortion by the motion of axes); ball screws of steel grow 11.5 µm/m/K",
    frame="axis",
    mistaken=("scale_drift", "thermal_drift"),
    plainer=("scale_drift", "thermal_drift"),  # on most plans an axis goes about as far every minute: both grow alike
    parted={
        "scale_drift": "let all axes stand for an hour, then repeat an indexation: a screw that its way has warmed is short again, "
        "a scale that warms with the machine is not"
    },
    says="the screw of {axis} warms with its way; the touch that feels it most is off by {size}",
    meaning="a part made after much rapid motion of this axis differs along it from one made after little",
    advice="measure this axis by a linear scale, cool its screw, move it before calibrating as work moves it, or keep the term",
    refine={"tau": "log", "zero": "linear"},
    once=True,
    variants=variants,
    units={"tau": "s", "zero": "mm"},
    over="time",
    make=make,
    unnamed=unnamed,
)
