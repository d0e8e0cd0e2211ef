"""Whether a name comes back when a fifth of the indexations is left out (Meinshausen & Bühlmann 2010, with complete subsets)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ..touches import Touches
from ._catalogue import Chosen
from ._contest import Outcome, contest, shortlist
from ._explain import Explanation
from ._field import Field
from ._records import ALONE, SUBSETS, Stability
from ._space import faint, space

MOSTLY = 0.6  # of a pattern in one touch: with two touches on one side of an onset each of them has less than a half
WEAK = 10.0  # evidence by which a shape may be better in a subset: no very strong evidence against a name


def stability(
    e: Explanation, field: Field, outcome: Outcome, touches: Touches, weight: Array, data: Array, base: Array
) -> dict[int, Stability]:
    """explanation, field, outcome, data and design (n + known,) → by id of every name that stands, in how many subsets it does.

    Names keep their settings; shapes that came next compete again, without the margin. What belongs to one indexation, such
    as two facets that are exchanged there, cannot come back without it: that subset is no trial of it.
    """
    if not outcome.named:
        return {}
    n = len(touches)
    few = shortlist(field, e.place.y, outcome.named, outcome)
    fixed = [c for c in e.chosen if c.candidate.cause == "outlier"]
    visible = {id(c): np.sum((e.place.basis[:n] @ c.columns) ** 2, axis=1) for c in outcome.named}
    count = {id(c): [0, 0] for c in outcome.named}
    for left_out in range(SUBSETS):
        inside = touches.indexation % SUBSETS != left_out
        rows = np.flatnonzero(inside)
        whole = np.concatenate([rows, np.arange(n, len(base))])
        place = space(data[whole], base[whole], len(rows), (), faint(data[rows]))
        part = Field([replace(k, columns=k.columns[rows]) for k in few], place.basis, weight[rows], field.means, rows)
        part.among = field.among
        if place.m <= sum(c.columns.shape[1] for c in (*outcome.named, *fixed)):  # few touches: this subset tells nothing
            continue
        kept = [_restricted(c, place.basis, rows) for c in outcome.named]
        seen = [c for c in fixed if np.abs(c.candidate.columns[rows]).any()]
        stands = contest(part, place.y, [_restricted(c, place.basis, rows) for c in seen], kept, -WEAK).named
        for c, own in zip(outcome.named, kept, strict=True):
            mine = visible[id(c)]
            if float(mine[~inside].sum()) <= ALONE * float(mine.sum()):
                count[id(c)][0] += any(own is s for s in stands)
                count[id(c)][1] += 1
    return {key: Stability(*both) for key, both in count.items()}


def lonely(e: Explanation, c: Chosen, count: NDArray[np.int64]) -> bool:
    """explanation, a name, (n,) touches of each row → whether a single touch makes most of what the others do not explain of it.

    A chip of which one touch before it is left, as the other one was set aside, is one more touch to be set aside.
    """
    own = c.columns
    if aside := [o.columns for o in e.chosen if o.candidate.cause == "outlier"]:
        basis = np.linalg.qr(np.hstack(aside))[0]
        own = own - basis @ (basis.T @ own)
    shown = np.sum((e.place.basis[: len(count)] @ own) ** 2, axis=1)
    worst = int(np.argmax(shown))
    return own.shape[1] == 1 and count[worst] == 1 and float(shown[worst]) > MOSTLY * float(shown.sum())


def worse(one: Stability, other: Stability) -> Stability:
    """two ways of asking → subsets of the first, less what was missed in the worse of the two."""
    missed = max(one.of - one.times, other.of - other.times)
    return Stability(max(one.of - missed, 0), one.of)


def _restricted(c: Chosen, basis: Array, rows: NDArray[np.int64]) -> Chosen:
    return replace(c, columns=basis.T @ c.candidate.columns[rows])
