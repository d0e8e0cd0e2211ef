"""A compensation table is interpolated straight between its nodes: the axis errs piecewise linearly."""

from __future__ import annotations

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, label, moved_axes, need

TEXT = "the compensation table of an axis has a kink"
SOURCE = "piecewise linear pitch error compensation; ISO 230-2:2014, annex"
FRAME = "axis"
MISTAKEN = ("error_motion",)
ADVICE = "measure the axis again at the nodes of its table and write the table anew, or keep the term"
REFINE = {"at": "linear"}
NODES = 15


def variants(touches: Touches) -> Variants:
    """touches → kinks at 15 places of every linear axis."""
    for axis in moved_axes(touches, touches.machine.linear, 50.0):
        for at in np.quantile(touches.axis(axis), np.linspace(0.08, 0.92, NODES)):
            yield {"axis": axis, "at": float(at)}


def cause(machine: Machine, axis: str, at: float) -> list[Coefficient]:
    """machine, linear axis, place of the kink in mm → change of slope there, mm/mm."""
    need("compensation_kink", "axis", axis, machine.linear)

    def bent(t: Touches) -> Array:
        return np.maximum(t.axis(axis) - at, 0.0)

    return [Coefficient(label("compensation_kink", axis, at), "mm/mm", Slot(axis, "motion"), bent)]
