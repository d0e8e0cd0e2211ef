"""Rough or dirty facets: every touch meets another spot of the surface."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import FacetIds


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, facets: FacetIds = ()) -> Disturbance:
    """n touches → gap, normal with standard deviation `amplitude` mm on the named facets (all when none is named)."""
    rough = np.array([not facets or facet in facets for facet in history.facet], dtype=bool)
    return Disturbance(gap=amplitude * rng.standard_normal(len(history)) * rough)
