"""Whether a name comes back when a fifth of the indexations is left out (Meinshausen & Bühlmann 2010, with complete subsets)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ..touches import Touches
from ._catalogue import Chosen
from ._contest import Field, Outcome, contest, shortlist
from ._explain import Explanation
from ._records import SUBSETS
from ._space import space

# Without the scale bar the scale is free, and at the real positions, 0.1 mm beside the nominal ones, that looks like a faint lever.
FAINT = 1e-5
WEAK = 10.0  # evidence by which a shape may be better in a subset: no very strong evidence against a name


def stability(
    e: Explanation, field: Field, outcome: Outcome, touches: Touches, weight: Array, data: Array, base: Array
) -> dict[int, int]:
    """explanation, field, outcome, data and design (n + known,) → by id of every name that stands, in how many subsets it does.

    Names keep their settings; shapes that came next compete again, without the margin.
    """
    if not outcome.named:
        return {}
    n = len(touches)
    few = shortlist(field, e.place.y, outcome.named, outcome)
    fixed = [c for c in e.chosen if c.candidate.cause == "outlier"]
    count = {id(c): 0 for c in outcome.named}
    for left_out in range(SUBSETS):
        rows = np.flatnonzero(touches.indexation % SUBSETS != left_out)
        whole = np.concatenate([rows, np.arange(n, len(base))])
        place = space(data[whole], base[whole], len(rows), (), FAINT)
        part = Field([replace(k, columns=k.columns[rows]) for k in few], place.basis, weight[rows], field.means, rows)
        part.among = field.among
        kept = [_restricted(c, place.basis, rows) for c in outcome.named]
        seen = [c for c in fixed if np.abs(c.candidate.columns[rows]).any()]
        stands = contest(part, place.y, [_restricted(c, place.basis, rows) for c in seen], kept, -WEAK).named
        for c, own in zip(outcome.named, kept, strict=True):
            count[id(c)] += any(own is s for s in stands)
    return count


def _restricted(c: Chosen, basis: Array, rows: NDArray[np.int64]) -> Chosen:
    return replace(c, columns=basis.T @ c.candidate.columns[rows])
