"""What names are judged on: touches that were not fitted, sizes, and subsets of the indexations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..model import known, linearise
from ..records import Array
from . import _gain, _nested, _seen, _stable
from ._catalogue import Chosen
from ._explain import Explanation
from ._look import Searched
from ._moments import Moment
from ._records import FREE, Size, Stability
from ._rows import Rows
from ._seen import Test
from ._size import size


@dataclass(frozen=True, eq=False)
class Design:
    """The present model and the moments that are set aside as a linear model of the rows; what is known beside the n rows."""

    columns: Array  # (n + known, p)
    data: Array  # (n + known,) mm
    certain: Array  # (n + known,) weight
    keep: NDArray[np.bool_]  # (n,) rows that are no outliers
    schemes: Mapping[str, NDArray[np.int64]]  # (n,) groups of rows that are held out together
    raw: Mapping[int, Array]  # by id of what the search chose, its columns (n, k) without weights

    def padded(self, c: Chosen) -> Array:
        """what the search chose → its columns (n + known, k)."""
        own = self.raw[id(c)]
        return np.pad(own, ((0, len(self.columns) - len(own)), (0, 0)))

    def beside(self, names: Sequence[Chosen]) -> Array:
        """names → the present model with them (n + known, p + k)."""
        return np.hstack([self.columns, *(self.padded(c) for c in names)])

    def tests(self, names: Sequence[Chosen], means: Rows) -> tuple[Test, ...]:
        """names, rows → what the residuals of the model with these names depend on."""
        return _seen.tests(self.beside(names), self.data, means.seen, self.keep, self.certain)


def design(before: Estimate, means: Rows, what: Searched, moments: Sequence[Moment]) -> Design:
    """present model, rows, what the search found, moments set aside → the linear model."""
    seen = means.seen
    n = len(seen)
    gaps, jacobian = (means.of(x) for x in linearise(before.model, before.values))
    distances, rows, uncertainty = known(before.model, before.values)
    base = np.vstack([jacobian, rows * (before.sigma / uncertainty)[:, None]])
    base = np.hstack([base, *(np.pad(means.of(m.columns), ((0, len(base) - n), (0, 0))) for m in moments)])
    schemes = {
        "indexations": seen.indexation,
        "facets": _gain.groups_of(seen.facet),
        "time": _gain.blocks(n),
        "scattered": _gain.scattered(n),
    }
    return Design(
        base,
        np.concatenate([gaps, distances * before.sigma / uncertainty]),
        np.concatenate([what.weight, np.ones(len(base) - n)]),
        ~np.isin(np.arange(n), rows_of(outliers(what.found))),
        schemes,
        {id(c): c.candidate.columns / what.weight[:, None] for c in what.found.chosen},
    )


def outliers(found: Explanation) -> list[Chosen]:
    """what explains the rows → the single touches in it."""
    return [c for c in found.chosen if c.candidate.cause == "outlier"]


def rows_of(lonely: Sequence[Chosen]) -> list[int]:
    """single touches → their rows."""
    return [int(c.candidate.setting["touch"]) for c in lonely]


@dataclass(frozen=True, eq=False)
class Grounds:
    """Each of these by the id of what the search chose."""

    means: Rows
    search: Searched
    design: Design
    found: Explanation  # with the names that stand against shapes
    sizes: Mapping[int, Size]
    gains: Mapping[int, _gain.Gain]  # not of single touches
    back: Mapping[int, Stability]  # of the names that stand: in how many subsets they come back
    everywhere: Mapping[int, bool]  # of these: whether touches gain in every scheme

    @property
    def whole(self) -> Explanation:
        """→ all that the search chose, names that did not stand against shapes with it."""
        return self.search.found

    @property
    def y(self) -> Array:
        """→ (m,) data outside the present model."""
        return self.found.place.y

    @cached_property
    def alone(self) -> list[Chosen]:
        """→ single touches that are set aside."""
        return outliers(self.found)

    @property
    def few(self) -> bool:
        """→ whether the touches are too few to name a cause."""
        return self.found.place.m < FREE

    def among(self, c: Chosen) -> Explanation:
        """what the search chose → the explanation that it belongs to: what stands is judged without what did not."""
        return self.found if any(c is o for o in self.found.chosen) else self.whole

    def tests(self, names: Sequence[Chosen]) -> tuple[Test, ...]:
        """names that stay → what the residuals depend on beside them and the single touches."""
        return self.design.tests([*self.alone, *names], self.means)


def grounds(before: Estimate, means: Rows, search: Searched, moments: Sequence[Moment], seed: int) -> Grounds:
    """present model, rows, what the search found, moments set aside → what its names are judged on."""
    whole, outcome, weight = search.found, search.outcome, search.weight
    linear = design(before, means, search, moments)
    found, sizes = whole, size(whole, means, weight)
    stand = [c for c in whole.chosen if not c.candidate.named or any(c is o for o in outcome.named)]
    stand = [c for c in stand if c.candidate.cause] if outcome.named else stand
    if outcome.named and len(stand) < len(whole.chosen):
        found = replace(whole, chosen=tuple(stand), named=outcome.named)
        sizes |= size(found, means, weight)
    judged = Grounds(means, search, linear, found, sizes, {}, {}, {})
    gains = {}
    for c in whole.chosen:
        if c.candidate.cause == "outlier":
            continue
        others = linear.beside([o for o in judged.among(c).chosen if o is not c])
        rng = np.random.default_rng([seed, len(means.seen)])
        gains[id(c)] = _gain.measure(others, linear.data, linear.raw[id(c)], linear.schemes, linear.keep, rng)
    weighted = linear.data * linear.certain, linear.columns * linear.certain[:, None]
    back = _stable.stability(found, search.field, outcome, means.seen, weight, *weighted)
    folds = _nested.Folds(found, weight, linear.columns, linear.data)
    inside = {id(c): folds.nested(c, linear.schemes, linear.keep) for c in outcome.named}
    gains |= {key: _gain.nested(gains[key], one.schemes) for key, one in inside.items()}
    back = {key: _stable.worse(once, inside[key].selected) for key, once in back.items()}
    return replace(judged, gains=gains, back=back, everywhere={key: one.gains for key, one in inside.items()})


__all__ = ["Design", "Grounds", "grounds", "outliers", "rows_of"]
