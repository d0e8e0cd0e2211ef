"""Two facets are exchanged in the log of one indexation: each is read with the offset of the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, early, label
from ._world import Effects

TEXT = "two facets are exchanged in the readings"
SOURCE = "clerical error; both are read with the offset of the other"
FRAME = "log"
MISTAKEN = ("chip",)
SAYS = "facets {facets} are exchanged in the readings from touch {at} on; each reads off by {size}"
MEANING = "a clerical matter; the two touches pull the estimate as if the machine were wrong"
ADVICE = "exchange the two facets in the readings, or measure this indexation again"
REFINE: dict[str, str] = {}


def variants(touches: Touches) -> Variants:
    """touches → every pair of parallel facets of one indexation."""
    for number in np.unique(touches.indexation):
        rows = np.flatnonzero(touches.indexation == number)
        for i, row in enumerate(rows):
            for other in rows[i + 1 :]:
                if touches.facet[row] != touches.facet[other] and touches.normal[row] @ touches.normal[other] > 0.999:
                    pair = (touches.facet[row], touches.facet[other])
                    yield {"facets": pair, "at": int(rows[0]) + 1, "until": int(rows[-1]) + 1}


def plausible(values: Array, setting: Mapping[str, Any], offsets: Mapping[str, float]) -> bool:
    """values (1,) mm, estimated facet offsets (mm) → whether it is about the difference of the two offsets."""
    one, two = (offsets.get(str(f), 0.0) for f in setting["facets"])
    return bool(abs(values[0] - (two - one)) < 0.002 + 0.2 * abs(two - one))


def cause(machine: Machine, facets: tuple[str, str], at: int = 1, until: int = 2**31) -> list[Coefficient]:
    """machine, two facets, touches between which they are exchanged → difference of their offsets, mm."""
    one, two = (str(f) for f in facets)

    def pattern(t: Touches) -> Array:
        number, facet = np.arange(1, len(t) + 1), np.array(t.facet)
        inside = (number >= at) & (number <= until)
        return inside * ((facet == one).astype(float) - (facet == two))

    return [early(label("swapped_facets", one, two, at), pattern)]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the two names exchanged: by how much is a matter of the facets (world.yaml)."""
    return [{"cause": "swapped_facets", **{k: list(v) if k == "facets" else v for k, v in setting.items()}}]
