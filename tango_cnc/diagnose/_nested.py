"""Gain with the search inside the fold: the setting of a cause is chosen by the other touches, and these predict the fold.

A gain that is measured with a setting that all touches have chosen is too good (Cawley & Talbot 2010; Stone 1974). The same
folds of indexations tell how often the cause is selected when all causes are searched again (Meinshausen & Bühlmann 2010).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ._catalogue import APART, Chosen
from ._explain import Explanation
from ._gain import add, residual_maker, rms
from ._records import ALONE, SUBSETS, Stability
from ._space import RIDGE, faint

UNKNOWN = 0.5  # of the pattern of a name, from which a setting that fits the other touches as well predicts it no more
AXES = "xyz"  # of a displacement, whatever its frame
NEAR = 10.0  # evidence by which another cause may be better in a subset: no very strong evidence against a name


@dataclass(frozen=True)
class Nested:
    """Errors of touches that were not fitted, mm, and how often a cause is selected."""

    schemes: Mapping[str, tuple[float, float]]  # without and with the cause, its setting chosen without the fold
    selected: Stability  # in subsets of the indexations

    @property
    def gains(self) -> bool:
        """→ whether touches gain in every scheme."""
        return all(after < before for before, after in self.schemes.values())


@dataclass(frozen=True)
class _Alike:
    """Candidates of k columns each: their numbers (b,), their columns (b, k), products of any two of them at each touch."""

    blocks: NDArray[np.int64]
    at: NDArray[np.int64]
    products: Array  # (b·k·(k + 1)/2, n)

    @classmethod
    def of(cls, rows: Array, blocks: NDArray[np.int64], at: NDArray[np.int64]) -> _Alike:
        """(N, n) columns one after the other, numbers of candidates, their columns → these with their products."""
        i, j = np.tril_indices(at.shape[1])
        return cls(blocks, at, rows[at[:, i].ravel()] * rows[at[:, j].ravel()])

    def gram(self, counts: Array) -> Array:
        """(n,) 1 of the touches that count, else 0 → (b, k, k) sums of the products over these."""
        (b, k), (i, j) = self.at.shape, np.tril_indices(self.at.shape[1])
        found = np.empty((b, k, k))
        found[:, i, j] = found[:, j, i] = (self.products @ counts).reshape(b, -1)
        return found


class Folds:
    """Design and data of everything but one cause, (n + known, p) and (n + known,), and the catalogue over the touches.

    A fold may hold all touches that tell the setting of a cause, such as the place of a kink. The others choose any: where they
    do not speak against the setting that all touches chose, and theirs is another pattern in the fold, it neither gains nor loses.
    """

    def __init__(self, e: Explanation, weight: Array, base: Array, data: Array) -> None:
        self.e, self.weight, self.base, self.data = e, weight, base, data
        blocks = [c.columns for c in (*e.catalogue.candidates, *(o.candidate for o in e.chosen))]
        self.price = np.concatenate([e.catalogue.price, [o.price for o in e.chosen]])
        self.size = np.array([b.shape[1] for b in blocks])
        self.start = np.concatenate([[0], np.cumsum(self.size)[:-1]]).astype(np.int64)
        self.rows = np.vstack([b.T for b in blocks])  # one column after the other: they are read one by one
        own = (np.flatnonzero(self.size == k) for k in np.unique(self.size))
        self.alike = [_Alike.of(self.rows, b, self.start[b][:, None] + np.arange(self.size[b[0]])) for b in own]
        every = (*e.catalogue.candidates, *(o.candidate for o in e.chosen))
        self.named = np.flatnonzero([c.named for c in e.catalogue.candidates])
        self.towards = np.array([[k.name[-1:] for k in c.coefficients] == [*AXES] for c in every])

    def nested(self, one: Chosen, schemes: Mapping[str, NDArray[np.int64]], keep: NDArray[np.bool_]) -> Nested:
        """one of the chosen, groups (n,) of each scheme, rows that count → gain and selection."""
        n = len(keep)
        certain = np.concatenate([self.weight, np.ones(len(self.base) - n)])
        others = [c.candidate.columns for c in self.e.chosen if c is not one]
        padded = [np.pad(x, ((0, len(self.base) - n), (0, 0))) for x in others]
        design = np.hstack([self.base * certain[:, None], *padded])
        data = self.data * certain
        without = residual_maker(design)
        mine = np.sum((without[:, :n] @ one.candidate.columns)[:n] ** 2, axis=1)
        at = len(self.e.catalogue.candidates) + next(i for i, c in enumerate(self.e.chosen) if c is one)
        shown = np.pad(one.candidate.columns, ((0, len(self.base) - n), (0, 0)))
        shown = shown @ np.linalg.lstsq(without @ shown, without @ data, rcond=None)[0]
        beside = self.rows @ design[:n]
        code = self.e.catalogue.causes.index(one.candidate.cause)
        result = {}
        selected = trials = 0
        for name, groups in schemes.items():
            used = np.unique(groups)
            if max(float(mine[groups == g].sum()) for g in used) > ALONE * float(mine.sum()):
                continue
            fold = groups if len(used) < 2 * SUBSETS else groups % SUBSETS
            counted = name == "indexations" or (name == "scattered" and "indexations" not in result)
            errors, counts = np.zeros((n, 2)), keep.copy()
            for g in np.unique(fold):
                out = np.flatnonzero(fold == g)
                score = self._scores(design, data, out, beside)
                own = np.flatnonzero(self.e.catalogue.group == code)
                best = own[int(np.argmax(score[own]))]
                if counted and float(mine[out].sum()) <= ALONE * float(mine.sum()):
                    selected += bool(score[best] > score[self.named].max() - NEAR)
                    trials += 1
                columns = self.rows[self.start[best] : self.start[best] + self.size[best]].T
                within = add(without, np.pad(columns, ((0, len(design) - n), (0, 0))))
                of_pattern = np.zeros((len(out), 2))
                for i, maker in enumerate((without, within)):
                    part = maker[out]
                    solved = np.linalg.pinv(part[:, out], rcond=0.1, hermitian=True) @ (part @ np.column_stack([data, shown]))
                    errors[out, i], of_pattern[:, i] = solved.T
                if score[best] < score[at] + APART and rms(of_pattern[:, 1]) > UNKNOWN * rms(of_pattern[:, 0]):
                    counts[out] = False
            if counts.any():
                result[name] = (rms((errors[:, 0] / self.weight)[counts]), rms((errors[:, 1] / self.weight)[counts]))
        return Nested(result, Stability(selected, trials))

    def _scores(self, design: Array, data: Array, out: NDArray[np.int64], beside: Array) -> Array:
        """design, data, touches that are not fitted, (N, p) candidates along the design → (blocks,) evidence of each beside it."""
        inside = np.setdiff1d(np.arange(len(design)), out)
        scale = np.linalg.norm(design[inside], axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        u, s, v = np.linalg.svd(design[inside] / scale, full_matrices=False)
        touches, n = inside[inside < self.rows.shape[1]], self.rows.shape[1]
        some = s > faint(data[touches]) * s[0]
        u = u[:, some]
        y = data[inside] - u @ (u.T @ data[inside])
        counts, left_over = np.zeros(n), np.zeros(n)
        counts[touches], left_over[touches] = 1.0, y[: len(touches)]
        along = self.rows @ left_over
        # u = design · v / s: what candidates are along it follows from what they are along the design, and few touches are out.
        across = (beside - self.rows[:, out] @ design[out]) @ (v[some].T / scale[:, None] / s[some])
        m, whole = len(inside) - u.shape[1], float(y @ y)
        result = np.full(len(self.size), -np.inf)
        for each in self.alike:
            blocks, at, k = each.blocks, each.at, each.at.shape[1]
            gone, left = across[at], each.gram(counts)
            length = np.einsum("bkk->bk", left).copy()
            left -= gone @ gone.transpose(0, 2, 1)
            left[:, np.arange(k), np.arange(k)] += RIDGE * length + 1e-30
            right = along[at]
            taken = np.sum(right * np.linalg.solve(left, right[:, :, None])[:, :, 0], axis=1)
            result[blocks] = _gained(m, taken / whole) - self.price[blocks]
            if k != len(AXES):
                continue
            # As in the contest: what goes along one axis of its frame has one number, and which axis was picked among three.
            single = np.max(along[at] ** 2 / np.einsum("bkk->bk", left), axis=1)
            alone = _gained(m, single / whole) - self.price[blocks] + (k - 1) * float(np.log(m)) - 2 * float(np.log(k))
            result[blocks] = np.where(self.towards[blocks], np.maximum(result[blocks], alone), result[blocks])
        return result


def _gained(m: int, part: Array) -> Array:
    """degrees of freedom, part of the sum of squares that is taken (b,) → twice the log likelihood ratio (b,)."""
    return np.asarray(-m * np.log(np.maximum(1 - part, 1e-9)))


__all__ = ["Folds", "Nested"]
