"""Rough or dirty facets: every touch meets a spot of the surface, and meets the same one again when it comes back."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Array

from . import Disturbance, History
from ._kinds import FacetIds

EXAMPLE = {"amplitude": 0.002}

SPOT = 0.01  # mm: touches of one facet that are closer than this meet the same spot


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, facets: FacetIds = ()) -> Disturbance:
    """n touches → gap, normal with standard deviation `amplitude` mm on the named facets (all when none is named).

    Independent from spot to spot: the same facet reads otherwise at the next indexation, where errors of the machine carry
    the ball beside its point, and alike in every repetition of a cycle.
    """
    rough = np.array([not facets or facet in facets for facet in history.facet], dtype=bool)
    drawn = amplitude * rng.standard_normal(len(history))
    known: dict[str, tuple[list[Array], list[int]]] = {}
    first = np.arange(len(history))
    for i in np.flatnonzero(rough):
        points, rows = known.setdefault(history.facet[i], ([], []))
        if points:
            away = np.linalg.norm(np.array(points) - history.point[i], axis=1)
            nearest = int(np.argmin(away))
            if away[nearest] < SPOT:
                first[i] = rows[nearest]
                continue
        points.append(history.point[i])
        rows.append(int(i))
    return Disturbance(gap=np.where(rough, drawn[first], 0.0))
