"""A chip lies on one facet from some touch on: it reads too early."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import FacetId

EXAMPLE = {"amplitude": 0.05, "facet": 16, "at": 30}


def disturb(
    history: History, rng: np.random.Generator, *, facet: FacetId, amplitude: float, at: int = 1, until: int = 2**31
) -> Disturbance:
    """n touches → gap of `amplitude` mm on `facet` from touch `at` up to touch `until`, counted over all cycles and days."""
    there = (history.number >= at) & (history.number <= until) & (np.array(history.facet, dtype=object) == facet)
    return Disturbance(gap=amplitude * there)
