"""After every indexation the clamped axes sit a little elsewhere: one random offset vector per indexation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import displaced, label
from ._world import Effects


def spread(touches: Touches) -> list[tuple[dict[str, Any], Array]]:
    """touches → covariance (n, n) of unit offsets in x y z of every indexation."""
    same = touches.indexation[:, None] == touches.indexation[None, :]
    return [({}, same * (touches.machine_normal @ touches.machine_normal.T))]


def make(machine: Machine, indexations: int = 0) -> list[Coefficient]:
    """machine, number of indexations → three offsets in mm of every indexation (as far as the other terms leave them visible)."""

    def within(number: int) -> Any:
        return lambda t: (t.indexation == number).astype(float)

    return [c for i in range(indexations) for c in displaced(label("indexation_seating", i + 1), "machine", within(i))]


def fitted(touches: Touches) -> dict[str, Any]:
    """touches → the settings with which an estimate frees the offsets of these touches."""
    return {"indexations": int(np.max(touches.indexation)) + 1}


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → nothing of the offsets that were freed: seating is a spread, not a set of numbers (world.yaml)."""
    return [{"cause": "indexation_seating", "amplitude": float(values[0])}] if len(values) == 1 else []


TERM = Cause(
    text="the rotary axes do not seat in the same place after every indexation",
    source="ISO 230-2:2014 (positioning repeatability); ISO 10791-4",
    frame="machine",
    mistaken=("step", "noise_level"),
    follows="indexation",
    says="the table sits elsewhere after every indexation, by {size} (one standard deviation)",
    meaning="two parts, or two sides of a part, that are machined in separate indexations differ by this at random",
    advice="check the clamping; repeat indexations, because more touches of one indexation do not average this out",
    refine={},
    spread=spread,
    fitted=fitted,
    scatters="indexation",
    make=make,
    effects=effects,
)
