"""A chip or dirt on one facet from some touch on: it is read too early."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label

FEWEST = 3  # touches with it; and two without it


def variants(touches: Touches) -> Variants:
    """touches → every facet, from each of its touches on."""
    for facet in dict.fromkeys(touches.facet):
        rows = np.flatnonzero(np.array(touches.facet) == facet)
        for row in rows[2 : len(rows) - FEWEST + 1]:
            yield {"facet": facet, "at": int(touches.counted[row])}


def plausible(values: Array, setting: Mapping[str, Any], offsets: Mapping[str, float]) -> bool:
    """values (1,) mm → whether it reads early: nothing lies inside a facet."""
    return bool(values[0] > 0)


def make(machine: Machine, facet: str, at: float = 1) -> list[Coefficient]:
    """machine, facet, first touch with it (its number in the readings) → coefficient in mm."""
    at, facet = int(at), str(facet)

    def there(t: Touches) -> Array:
        return ((np.array(t.facet) == facet) & (t.counted >= at)).astype(float)

    return [early(label("chip", facet, at), there)]


TERM = Cause(
    text="something lies on a facet (chip, dirt) from some touch on",
    source="thesis section 4.6 (wet and dirty surfaces)",
    frame="log",
    mistaken=("step",),
    says="something lies on facet {facet} from touch {at} on, {clock} after the start: it reads {size} early",
    meaning="the facet is not where it was: its touches from then on pull the estimate and say nothing about the machine",
    advice="clean the facet and measure it again",
    refine={"at": "touch"},
    variants=variants,
    make=make,
    plausible=plausible,
)
