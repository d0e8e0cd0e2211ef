"""Which touches of a large strategy could be part of a plan: within reach, within the travels, and with room to turn the axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import check
from ..records import Cell, InputError, Strategy
from .build import _order, reachable
from .clearance import Clearance
from .places import Places, nowhere, scene
from .touches import PLACES, Planned
from .ways import lifts

KINDS = [PLACES.index(kind) for kind in ("standoff", "contact", "end", "over")]


def standing(cell: Cell) -> Strategy:
    """cell → its strategy with those touches alone that a plan could have, and without indexations of which none is left.

    Raises InputError when none is left at all.
    """
    strategy = reachable(cell, "leave-out")
    shared = scene(cell.machine, cell.artefact, strategy)
    facet, at = _order(strategy, shared.facet)
    lift, level = lifts(shared, facet, at)
    places = Places(shared, facet, at, lift, nowhere(shared.station.shape[1]))
    where = places(np.arange(len(at)))[:, KINDS]
    beyond = check.outside(cell.machine, where.reshape(-1, where.shape[2])).reshape(where.shape)
    within = ~beyond.any(axis=(1, 2))
    touches = Planned(np.arange(1, len(at) + 1, dtype=np.int32), facet, shared.facet, at, places)
    clear = Clearance(shared, level)
    kept = []
    for index, indexation in enumerate(strategy.indexations):
        rows = np.flatnonzero((at == index) & within)
        if len(rows) and clear.has_room(touches[int(rows[0])]):
            kept.append(replace(indexation, facets=tuple(shared.facet[row] for row in facet[rows])))
    if not kept:
        raise InputError(
            f"{strategy.name}: the axes reach no touch of it and get clear of the table afterwards; "
            "check travels, the length of the probe and where the facets are"
        )
    return replace(strategy, indexations=tuple(kept))
