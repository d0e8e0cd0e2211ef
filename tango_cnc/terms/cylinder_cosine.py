"""A curved facet that is taken for a plane: second order in the sideways miss over its radius."""

from __future__ import annotations

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, early, label

TEXT = "a curved facet was taken for a plane and touched beside its nominal point"
SOURCE = "thesis chapter 5 and its future work (cosine error on a cylindrical table)"
FRAME = "table"
MISTAKEN = ("surface_form",)
ADVICE = "give the facet its `surface` in artefact.yaml"
REFINE: dict[str, str] = {}
LEAST = 0.02  # mm of sideways miss: below it no radius shows


def miss(t: Touches) -> Array:
    """touches → (n,) mm beside the nominal point, as the nominal machine sees it."""
    from .. import kinematics

    away = kinematics.tip(t.chain, t.position) - t.point
    result: Array = np.linalg.norm(away - np.sum(away * t.normal, axis=1)[:, None] * t.normal, axis=1)
    return result


def variants(touches: Touches) -> Variants:
    """touches → all plane facets at once and every group of parallel height, where the misses are large enough."""
    plane = np.array(
        [touches.artefact.facets[f].surface is None and touches.artefact.facets[f].ball is None for f in touches.facet]
    )
    if plane.any() and np.ptp(miss(touches)[plane] ** 2) > LEAST**2:
        yield {}


def cause(machine: Machine, facets: tuple[str, ...] = ()) -> list[Coefficient]:
    """machine, facets (all planes when none is named) → curvature in 1/mm: a ball beside the crest sinks by miss²/2R."""

    def pattern(t: Touches) -> Array:
        curved = [
            t.artefact.facets[f].surface is None and t.artefact.facets[f].ball is None and (not facets or f in facets)
            for f in t.facet
        ]
        return -np.array(curved) * miss(t) ** 2 / 2

    return [early(label("cylinder_cosine", *facets), pattern, "1/mm")]
