"""A compensation table is interpolated straight between its nodes: the axis errs piecewise linearly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..kinematics import Slot
from ..records import Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Pattern, Variants, label, moved_axes, need

TEXT = "the compensation table of an axis has a kink"
SOURCE = "piecewise linear pitch error compensation; ISO 230-2:2014, annex"
FRAME = "axis"
MISTAKEN = ("error_motion",)
ADVICE = "measure the axis again at the nodes of its table and write the table anew, or keep the term"
REFINE = {"at": "linear"}
NODES = 15


def variants(touches: Touches) -> Variants:
    """touches → one kink at 15 places of every linear axis; several nodes equally far apart."""
    for axis in moved_axes(touches, touches.machine.linear, 50.0):
        places = touches.axis(axis)
        for at in np.quantile(places, np.linspace(0.08, 0.92, NODES)):
            yield {"axis": axis, "at": float(at)}
        for count in (3, 4, 5, 6, 8):
            yield {"axis": axis, "nodes": tuple(np.linspace(places.min(), places.max(), count)[1:-1].tolist())}


def cause(machine: Machine, axis: str, at: float | None = None, nodes: Sequence[float] = ()) -> list[Coefficient]:
    """machine, linear axis, places of the kinks in mm → change of slope at each, mm/mm."""
    need("compensation_kink", "axis", axis, machine.linear)

    def bent(place: float) -> Pattern:
        return lambda t: np.maximum(t.axis(axis) - place, 0.0)

    places = [*nodes] if at is None else [at, *nodes]
    return [Coefficient(label("compensation_kink", axis, p), "mm/mm", Slot(axis, "motion"), bent(float(p))) for p in places]
