"""A curved facet that is taken for a plane: second order in the sideways miss over its radius.

By how much a touch misses the nominal point of its facet, nobody knows before the machine is estimated: the nominal machine aims
and arrives there. So this term takes the misses from a first estimate without it (`Touches.tip`), around which it is linear in 1/R.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label
from ._world import Effects

LEAST = 0.1  # mm of sideways miss: below it even a radius of 10 mm makes less than half a micrometre
NOTHING = 1e-3  # mm of sideways miss: on the point
SQUARE = 0.01  # cosine between a facet's normal and the axis of the cylinder
ALONG = (0.0, 0.0, 1.0)  # table frame: a round table


def miss(t: Touches, axis: Sequence[float] = ALONG) -> Array:
    """touches, axis of the cylinder (table frame) → (n,) mm beside the nominal point across it; 0 before a first estimate."""
    if t.tip is None:
        return np.zeros(len(t))
    return np.asarray(np.sum((t.tip - t.point) * np.cross(_unit(axis), t.normal), axis=1))


def _unit(axis: Sequence[float]) -> Array:
    return np.array(axis, dtype=float) / np.linalg.norm(axis)


def _flat(t: Touches, facets: Sequence[str], axis: Sequence[float]) -> NDArray[np.bool_]:
    """→ (n,) whether a touch is on a facet that is called flat, is square to the axis and is named (or none is)."""
    known = [t.artefact.facets[f] for f in t.facet]
    named = {str(f) for f in facets}
    plane = np.array([f.surface is None and f.ball is None and (not named or f.id in named) for f in known], dtype=bool)
    return plane & (np.abs(t.normal @ _unit(axis)) < SQUARE)


def variants(touches: Touches) -> Variants:
    """touches → all plane facets around the table at once, where the misses are large enough."""
    plane = _flat(touches, (), ALONG)
    if plane.any() and np.abs(miss(touches)[plane]).max() > LEAST:
        yield {}


def make(machine: Machine, facets: Sequence[str] = (), axis: Sequence[float] = ALONG) -> list[Coefficient]:
    """machine, facets (all plane ones square to the axis when none is named), axis of the cylinder in the table frame
    → curvature in 1/mm: a ball beside the crest sinks by miss²/2R, R the radius of the facet and of the ball together.
    """
    if len(axis) != 3 or not any(axis):
        raise ValueError("axis: three numbers, not all zero")

    def pattern(t: Touches) -> Array:
        beside = miss(t, axis)
        return np.where(_flat(t, facets, axis) & (np.abs(beside) > NOTHING), -(beside**2) / 2, 0.0)

    turned = tuple(axis) if tuple(axis) != ALONG else ()
    return [early(label("cylinder_cosine", *facets, *turned), pattern, "1/mm")]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the radius of the facets (world.yaml); nothing for a curvature that none can have."""
    if values[0] <= 0 or 1 / values[0] <= machine.probe.tip_radius:
        return []
    base = {"cause": "cylinder_cosine", "radius": 1 / float(values[0]) - machine.probe.tip_radius}
    return [base | {k: list(v) for k, v in setting.items() if k in ("facets", "axis") and len(v)}]


TERM = Cause(
    text="a curved facet was taken for a plane and touched beside its nominal point",
    source="thesis chapter 5 and its future work (cosine error on a cylindrical table)",
    frame="table",
    mistaken=("surface_form",),
    says="curved facets were taken for planes; the touch that misses its point most is off by {size}",
    meaning="the machine is sound; the artefact file says flat where the table is round, and the estimate is pulled by it",
    advice="give the facet its `surface` in artefact.yaml",
    refine={},
    needs="tip",  # of a first estimate
    variants=variants,
    make=make,
    effects=effects,
)
