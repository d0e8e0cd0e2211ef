"""Thousands of touches → as many rows as a search can hold: means of touches that were made alike.

A mean of k touches, times √k, has the noise of one touch; what the model and every pattern do to it is the same mean of what
they do to its touches. So means are judged like touches, and lose only what differs among their members (Snedecor & Cochran
1989, 4.5). Touches are alike when facet, rotary axes, spindle and directions of motion are; the k are neighbours in time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..records import Array
from ..terms import Cause
from ..touches import Touches
from ._candidates import Candidate

MOST = 900  # rows: what a search can hold in a quarter of a minute
ANGLE = 0.1  # deg: rotary axes that stand alike
PLACES = ("at", "until")  # settings that count touches, where the cause does not refine them as something else (mm, deg)
WILD = 8.0  # robust standard deviations beyond which a touch is left out of a mean


@dataclass(frozen=True)
class Rows:
    """Touches (n,) and the rows (r,) that stand for them."""

    whole: Touches
    seen: Touches  # the first touch of every row
    first: NDArray[np.int64]  # (r,) its place among all touches
    count: NDArray[np.int64]  # (r,) touches of a row
    wild: NDArray[np.int64]  # touches that are in no mean
    left_out: int  # touches that are in no row otherwise
    matrix: sparse.csr_array | None  # (r, n); None where every touch is a row

    @property
    def all(self) -> bool:
        """→ whether every touch is a row."""
        return self.matrix is None

    @property
    def scale(self) -> Array:
        """→ (r,) what a row is larger by than a touch: √k."""
        return np.asarray(np.sqrt(self.count))

    @property
    def parts(self) -> tuple[NDArray[np.int64], Array]:
        """→ (n,) row that every touch is in, and (n,) what the row has of it: 0 of a touch that is in none."""
        n = len(self.whole)
        if self.matrix is None:
            return np.arange(n), np.ones(n)
        place, share = np.zeros(n, dtype=np.int64), np.zeros(n)
        entries = self.matrix.tocoo()
        place[entries.col], share[entries.col] = entries.row, entries.data
        return place, share

    def of(self, columns: Array) -> Array:
        """(n,) or (n, k) of touches → the same of rows."""
        return columns if self.matrix is None else np.asarray(self.matrix @ columns)

    def settings(self, record: Cause) -> Iterator[Mapping[str, Any]]:
        """cause → its settings: as many as for the rows, with places in the order of all touches."""
        if self.matrix is None:
            yield from record.variants(self.whole)
            return
        n, r = len(self.whole), len(self.seen)
        for setting in record.variants(self.seen):
            if "facet" in setting or "facets" in setting:
                yield setting
                continue
            counted = (k for k in PLACES if setting.get(k) and record.refine.get(k, "touch") == "touch")
            places = {k: (self.seen.row(setting[k]) + 1) * n // r for k in counted}
            yield {**setting, **{k: int(self.whole.counted[place - 1]) for k, place in places.items()}}

    def candidate(self, c: Candidate) -> Candidate:
        """candidate of touches → of rows."""
        return c if self.matrix is None else replace(c, columns=self.of(c.columns))


def rows(touches: Touches, residual: Array, most: int = MOST) -> Rows:
    """touches, residuals (n,) of the present model → rows: the touches themselves while they are few enough."""
    n = len(touches)
    every = np.arange(n)
    if n <= most:
        return Rows(touches, touches, every, np.ones(n, dtype=np.int64), every[:0], 0, None)
    size = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
    tame = np.abs(residual) <= WILD * size if size > 0 else np.ones(n, dtype=np.bool_)
    key = alike(touches)
    kinds, number = np.unique(key[tame], return_inverse=True)
    place = np.full(n, -1, dtype=np.int64)
    place[tame] = number
    if len(kinds) > most:  # nothing is repeated often enough: whole indexations, evenly over the test
        kept = _thinned(touches.indexation, most)
        place[~kept] = -1
    turn = _occurrence(place)
    of_kind = np.bincount(place[place >= 0], minlength=len(kinds))
    blocks = 1
    while np.minimum(of_kind, blocks + 1).sum() <= most and blocks < of_kind.max():
        blocks += 1
    block = np.where(place >= 0, turn * np.minimum(blocks, of_kind[place]) // np.maximum(of_kind[place], 1), 0)
    group = np.where(place >= 0, place * blocks + block, -1)
    used = group >= 0
    labels, first, inverse, count = np.unique(group[used], return_index=True, return_inverse=True, return_counts=True)
    first = every[used][first]
    order = np.argsort(first)
    rank = np.empty(len(labels), dtype=np.int64)
    rank[order] = np.arange(len(labels))
    count, first = count[order], first[order]
    at = rank[inverse]
    matrix = sparse.csr_array((1 / np.sqrt(count[at]), (at, every[used])), shape=(len(labels), n))
    return Rows(touches, touches.rows(first), first, count, every[~tame], int((tame & ~used).sum()), matrix)


def alike(touches: Touches) -> NDArray[np.int64]:
    """touches → (n,) number of the kind of each: same facet, stylus, rotary axes, spindle, motion."""
    machine = touches.machine
    angles = [np.round(np.degrees(touches.axis(a)) / ANGLE) for a in (*machine.rotary, "S")]
    signs = [np.sign(touches.sign(a)) for a in (*machine.linear, *machine.rotary)]
    facets = {f: i for i, f in enumerate(dict.fromkeys(touches.facet))}
    facet = np.array([facets[f] for f in touches.facet], dtype=float)
    stylus = np.zeros(len(touches)) if touches.stylus is None else touches.stylus
    return np.unique(np.column_stack([facet, stylus, *angles, *signs]), axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _thinned(indexation: NDArray[np.int64], most: int) -> NDArray[np.bool_]:
    """→ (n,) touches of indexations that are kept: evenly spread, as many as there is room for."""
    count = int(indexation.max()) + 1
    part = most / len(indexation)
    kept = np.floor((np.arange(count) + 1) * part) > np.floor(np.arange(count) * part)
    return np.asarray(kept[indexation])


def _occurrence(place: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) kinds in order of time → (n,) how many of the same kind came before."""
    order = np.argsort(place, kind="stable")
    sorted_place = place[order]
    begin = np.flatnonzero(np.diff(sorted_place, prepend=sorted_place[:1] - 1))
    turn = np.empty(len(place), dtype=np.int64)
    turn[order] = np.arange(len(place)) - begin[np.searchsorted(begin, np.arange(len(place)), side="right") - 1]
    return turn


__all__ = ["Rows", "rows"]
