"""A compensation table is interpolated straight between its nodes: the axis errs piecewise linearly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient, Detail, Setting, Shape
from ._cause import Pattern, Variants, label, moved_axes, need, times
from ._world import Effects

KINKS = 2  # of an axis, or one table of them
NODES = 15
PLACES = 5  # of a rotary axis, below which nothing can bend between them


def variants(touches: Touches) -> Variants:
    """touches → one kink at 15 places of every axis that moves, at its positions where it stands at few; several nodes equally far
    apart on linear axes.
    """
    machine = touches.machine
    for axis in moved_axes(touches, machine.linear, 50.0):
        places = touches.axis(axis)
        for at in (*np.quantile(places, np.linspace(0.08, 0.92, NODES)), (places.min() + places.max()) / 2):
            yield {"axis": axis, "at": float(at)}  # one kink has its place searched
        for count in (4, 5, 6, 8):
            yield {"axis": axis, "nodes": tuple(np.linspace(places.min(), places.max(), count)[1:-1].tolist())}
    for axis in moved_axes(touches, machine.rotary, 0.5):
        stops = np.unique(np.round(np.degrees(touches.axis(axis)), 2))
        if len(stops) >= PLACES:
            inside = stops[1:-1]
            for at in inside[:: -(-len(inside) // NODES)]:
                yield {"axis": axis, "at": float(at)}


def make(machine: Machine, axis: str, at: float | None = None, nodes: Sequence[float] = ()) -> list[Coefficient]:
    """machine, linear or rotary axis, places of the kinks in mm or deg → change of slope at each, mm/mm or rad/rad."""
    need("compensation_kink", "axis", axis, (*machine.linear, *machine.rotary))
    straight = axis in machine.linear

    def bent(place: float) -> Pattern:
        return lambda t: np.maximum(t.axis(axis) - (place if straight else np.radians(place)), 0.0)

    places = [*nodes] if at is None else [at, *nodes]
    unit = "mm/mm" if straight else "rad/rad"
    return [Coefficient(label("compensation_kink", axis, p), unit, Slot(axis, "motion"), bent(float(p))) for p in places]


def words(detail: Detail) -> dict[str, str]:
    """detail of a finding → {place}: the position at which the compensation table bends, as text."""
    places = [detail["at"]] if detail.get("at") is not None else list(detail.get("nodes", ()))
    unit = "mm" if detail.get("axis") in ("X", "Y", "Z") else "deg"
    return {"place": ", ".join(f"{float(p):.0f}" for p in places) + f" {unit}"}


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the table of errors at the kinks and the ends of the travel (world.yaml)."""
    axis = str(setting["axis"])
    found = setting.get("nodes") or ()
    places = np.array([*found] if setting.get("at") is None else [setting["at"], *found], dtype=float)
    unit = 1.0 if axis in machine.linear else np.pi / 180
    travel = np.array(machine.axis(axis).travel or (places.min() * unit - 1.0, places.max() * unit + 1.0)) / unit
    nodes = np.unique([*travel, *places])
    size = np.maximum(nodes[:, None] - places, 0.0) @ (values * unit)
    return [{"cause": "compensation_kink", "axis": axis, "nodes": nodes.tolist(), "values": size.tolist()}]


def beside(touches: Touches, setting: Setting, chosen: Sequence[Setting]) -> bool:
    """touches, setting, those chosen on this axis → whether an axis may have it too: kinks upon kinks follow any curve."""
    return not chosen or (len(chosen) < KINKS and not any(s.get("nodes") for s in (setting, *chosen)))


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → kinks of linear axes, without its name."""
    for axis in moved_axes(touches, touches.machine.linear, 1.0):
        values = touches.axis(axis)
        for place in np.quantile(values, np.linspace(0.1, 0.9, 13)):
            yield axis, f"axis {axis}", "kink", times(np.maximum(values - place, 0.0)[:, None], touches.lever(axis))


TERM = Cause(
    text="the compensation table of an axis has a kink",
    source="piecewise linear pitch error compensation; ISO 230-2:2014, annex",
    frame="axis",
    mistaken=("error_motion",),
    both_ways=True,
    says="the error of {axis} bends at {place}; the touch that feels it most is off by {size}",
    meaning="positions beyond the kink are off in proportion to their distance from it",
    advice="measure the axis again at the nodes of its table and write the table anew, or keep the term",
    refine={"at": "linear"},
    once=True,  # of one axis: two of them together follow any curve
    variants=variants,
    words=words,
    make=make,
    unnamed=unnamed,
    beside=beside,
    effects=effects,
)
