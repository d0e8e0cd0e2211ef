"""A chip or dirt on one facet from some touch on: it is read too early."""

from __future__ import annotations

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, early, label

TEXT = "something lies on a facet (chip, dirt) from some touch on"
SOURCE = "thesis section 4.6 (wet and dirty surfaces)"
FRAME = "log"
MISTAKEN = ("step",)
ADVICE = "clean the facet and measure it again"
REFINE = {"at": "touch"}
FEWEST = 2  # touches with and without it


def variants(touches: Touches) -> Variants:
    """touches → every facet, from each of its touches on."""
    for facet in dict.fromkeys(touches.facet):
        rows = np.flatnonzero(np.array(touches.facet) == facet)
        for row in rows[FEWEST : len(rows) - FEWEST + 1]:
            yield {"facet": facet, "at": int(row) + 1}


def cause(machine: Machine, facet: str, at: float = 1) -> list[Coefficient]:
    """machine, facet, first touch with it (1 = first touch used) → coefficient in mm."""
    at, facet = int(at), str(facet)

    def there(t: Touches) -> Array:
        return ((np.array(t.facet) == facet) & (np.arange(1, len(t) + 1) >= at)).astype(float)

    return [early(label("chip", facet, at), there)]
