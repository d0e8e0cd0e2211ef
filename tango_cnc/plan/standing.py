"""Which touches of a large strategy could be part of a plan: within reach, within the travels, and with room to turn the axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import check
from ..check.travel import travel_text
from ..records import Array, Cell, InputError, Strategy
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
        turned = np.abs(where[:, 0, [cell.machine.column(name) for name in cell.machine.rotary]]).sum(axis=1)
        nearest = int(np.argmin(np.where(within, turned, np.inf)))  # the simplest to look at
        why = clear.why_no_room(touches[nearest]) if within.any() else _travel(cell, beyond, where)
        raise InputError(
            f"{strategy.name}: the axes reach no touch of it and get clear of the table afterwards. {why}. "
            "Check travels, obstacles, the length of the probe and where the facets are: "
            "with all axes at zero, in the machine frame"
        )
    return replace(strategy, indexations=tuple(kept))


def _travel(cell: Cell, beyond: Array, where: Array) -> str:
    """cell, (n, 4, k) mm rad beyond travels, positions of n touches → which axis lacks how much at the touch that lacks least."""
    lacks = np.abs(beyond).max(axis=(1, 2))
    row = int(np.argmin(lacks))
    place, axis = np.unravel_index(int(np.argmax(np.abs(beyond[row]))), beyond[row].shape)
    name = cell.machine.names[int(axis)]
    return f"Even the touch that lacks least is beyond a travel: {travel_text(cell.machine, name, where[row, place, axis])}"
