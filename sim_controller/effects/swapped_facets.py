"""Two facets are exchanged in the log: the touches are right, their names are not."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError

from . import Disturbance, History
from ._kinds import FacetIds

EXAMPLE = {"facets": [16, 17]}
OTHERWISE = "a mistake in the log and no column"


def disturb(history: History, rng: np.random.Generator, *, facets: FacetIds, at: int = 1, until: int = 2**31) -> Disturbance:
    """n touches → each of the two `facets` logged as the other, from touch `at` up to touch `until`, counted over all cycles.

    Nothing moves, so a control that prints no names of facets shows nothing of it. Raises InputError for more or fewer than two.
    """
    if len(set(facets)) != 2 or len(facets) != 2:
        raise InputError(f"facets: found {', '.join(facets) or 'none'}; allowed: two different facets")
    other = {facets[0]: facets[1], facets[1]: facets[0]}
    numbers = history.number.tolist()
    named = (other.get(facet, facet) if at <= i <= until else facet for i, facet in zip(numbers, history.facet, strict=True))
    return Disturbance(facet=tuple(named))
