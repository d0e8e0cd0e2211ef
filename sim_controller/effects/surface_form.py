"""Rough or dirty facets: every touch meets another spot of the surface."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Id

from . import Disturbance, History


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, facets: tuple[Id, ...] = ()) -> Disturbance:
    """n touches → gap, normal with standard deviation `amplitude` mm on the named facets (all when none is named)."""
    rough = np.array([not facets or facet in facets for facet in history.facet])
    return Disturbance(gap=amplitude * rng.standard_normal(len(history)) * rough)
