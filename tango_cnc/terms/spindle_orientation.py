"""The spindle does not stop where it is told: the stylus, a little off its axis, swings sideways with S."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label, need
from ._world import Effects

DIFFER = 0.1  # of a wave: what waves at some orientations must differ by


def variants(touches: Touches) -> Variants:
    """touches → an orientation that differs from the others, and an error periodic in S."""
    places = np.unique(np.round(np.degrees(touches.axis("S")), 2))
    if len(places) > 1:
        for place in places:
            yield {"S": float(place)}
        for order in (1, 2):
            if _told(np.radians(places), order):
                yield {"order": order}


def _told(places: Array, order: int) -> bool:
    """orientations (k,) of the spindle, rad → whether waves up to this order differ there, so that each has a size.

    At four quarters sin 2S is nothing: a swing of order 2 would have any size, and what it shows of one of order 1 is a part.
    """
    turns = np.outer(places, np.arange(1, order + 1))
    waves = np.hstack([np.ones((len(places), 1)), np.cos(turns), np.sin(turns)])
    return bool(np.linalg.svd(waves, compute_uv=False)[-1] > DIFFER * np.sqrt(len(places))) if len(places) > 2 * order else False


def make(machine: Machine, S: float | None = None, order: int = 1) -> list[Coefficient]:
    """machine, orientation in deg that is off, or order of an error periodic in S → sideways shifts in the spindle frame, mm."""
    need("spindle_orientation", "order", order, (1, 2))

    def there(t: Touches) -> Array:
        return (np.abs(np.degrees(t.axis("S")) - float(S or 0.0)) < 0.5).astype(float)

    def part(i: int, weight: str) -> Coefficient:
        def pattern(t: Touches) -> Array:
            by = there(t) if weight == "at" else (np.cos if weight == "cos" else np.sin)(order * t.axis("S"))
            return t.spindle_normal[:, i] * by

        return early(f"{stem}.{'xy'[i]}{'' if weight == 'at' else weight}", pattern)

    stem = label("spindle_orientation", *((S,) if S is not None else (f"order {order}",)))
    weights = ("at",) if S is not None else ("cos", "sin")
    return [part(i, weight) for weight in weights for i in (0, 1)]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → nothing: the simulated spindle turns, and what that does depends on the stylus (world.yaml)."""
    return []


TERM = Cause(
    text="the spindle does not orient where it is commanded and swings the stylus",
    source="ISO 230-7:2015; stylus offset × error of S",
    frame="spindle",
    mistaken=("probe_lobing",),
    says="the spindle does not orient where it is commanded{where} and swings the stylus by {size}",
    meaning="a matter of the probe's stylus, not of parts, as long as nothing is bored or probed with an oriented spindle",
    advice="orient the spindle always from the same side, centre the stylus, or keep the term",
    refine={},
    variants=variants,
    over="probe",
    make=make,
    effects=effects,
)
