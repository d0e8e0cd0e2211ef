"""Two facets are exchanged in the log of an indexation or a few: each is read with the offset of the other."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import takewhile
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label
from ._world import Effects

LONGEST = 3  # indexations in a row that see the same two facets, of touches that nobody has made yet
CLOSE = 5.0  # mm
FOREVER = 2**31


def variants(touches: Touches) -> Variants:
    """touches → every pair of parallel facets, in each indexation that sees both and in all of them in a row.

    Where the touches were made is known from their positions: a pair is exchanged only where each was made at the other one.
    """
    found: dict[tuple[str, str], list[tuple[int, int] | None]] = {}
    for number in np.unique(touches.indexation):
        rows = np.flatnonzero(touches.indexation == number)
        here: dict[tuple[str, str], bool] = {}
        for i, row in enumerate(rows):
            for other in rows[i + 1 :]:
                if touches.facet[row] != touches.facet[other] and touches.normal[row] @ touches.normal[other] > 0.999:
                    one, two = sorted((touches.facet[row], touches.facet[other]))
                    here[one, two] = here.get((one, two), True) and _elsewhere(touches, int(row), int(other))
        for pair, exchanged in here.items():
            found.setdefault(pair, []).append(
                (int(touches.counted[rows[0]]), int(touches.counted[rows[-1]])) if exchanged else None
            )
    for pair, spans in found.items():
        for i, first in enumerate(spans):
            for last in takewhile(lambda span: span is not None, spans[i : i + (LONGEST if touches.tip is None else len(spans))]):
                assert first is not None and last is not None
                yield {"facets": pair, "at": first[0], "until": last[1]}


def _elsewhere(touches: Touches, row: int, other: int) -> bool:
    """Whether two touches were made at each other's facet, or their facets are so close that nobody can tell."""
    if touches.tip is None or np.linalg.norm(touches.point[row] - touches.point[other]) < CLOSE:
        return True
    radius = touches.machine.probe.tip_radius

    def away(touch: int, facet: int) -> float:
        assert touches.tip is not None
        return float(np.linalg.norm(touches.tip[touch] - touches.point[facet] - radius * touches.normal[facet]))

    return all(away(i, j) < away(i, i) for i, j in ((row, other), (other, row)))


def plausible(values: Array, setting: Mapping[str, Any], offsets: Mapping[str, float]) -> bool:
    """values (1,) mm, estimated facet offsets (mm) → whether it is about the difference of the two offsets.

    The more touches are exchanged, the smaller is the difference that is estimated with them.
    """
    one, two = (offsets.get(str(f), 0.0) for f in setting["facets"])
    return bool(abs(values[0] - (two - one)) < 0.002 + 0.5 * abs(values[0]))


def make(machine: Machine, facets: tuple[str, str], at: int = 1, until: int = FOREVER) -> list[Coefficient]:
    """machine, two facets, touches between which they are exchanged → difference of their offsets, mm."""
    one, two = (str(f) for f in facets)

    def pattern(t: Touches) -> Array:
        number, facet = t.counted, np.array(t.facet)
        inside = (number >= at) & (number <= until)
        return inside * ((facet == one).astype(float) - (facet == two))

    return [early(label("swapped_facets", one, two, at, until if until < FOREVER else None), pattern)]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the two names exchanged: by how much is a matter of the facets (world.yaml)."""
    return [{"cause": "swapped_facets", **{k: list(v) if k == "facets" else v for k, v in setting.items()}}]


TERM = Cause(
    text="two facets are exchanged in the readings",
    source="clerical error; both are read with the offset of the other",
    frame="log",
    mistaken=("chip",),
    follows="facet",
    says="facets {facets} are exchanged in the readings from touch {at} to {until}; each reads off by {size}",
    meaning="a clerical matter; their touches pull the estimate as if the machine were wrong",
    advice="exchange the two facets in the readings, or measure these indexations again",
    refine={},
    known=1,  # an exchange is as large as the two offsets differ
    variants=variants,
    make=make,
    plausible=plausible,
    effects=effects,
)
