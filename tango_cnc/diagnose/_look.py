"""One look at the touches: what explains them by name and without one, at the weights that their scatter asks for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import terms as families
from ..estimate import Estimate
from ..model import known, linearise
from ..records import Array, InputError
from ..touches import Touches
from . import _explain, _scatter, _variances
from ._candidates import Candidate, candidate, named, outliers, shapes
from ._catalogue import Chosen, columns_of
from ._changing import changing, slow
from ._contest import Outcome, contest
from ._explain import Explanation
from ._field import Field
from ._moments import Moment
from ._rows import Rows
from ._scatter import Scatter
from ._smooth import Kernel
from ._smooth import kernels as kernels_of

ROUNDS = 4  # of weighting rough facets and searching again
ABSURD = 0.1  # mm at a touch: an error as large as this has to show
SHOWS = 0.15  # that part of it at least
BLIND = 3  # searches without what turned out to be as large as that


def _with_learned(found: Explanation) -> Explanation:
    """Shapes of this machine always compete: a larger shape without a name may have taken the place of one in the search."""
    place, cat = found.place, found.catalogue
    there = {str(c.candidate.setting["name"]) for c in found.chosen if c.candidate.learned}
    more = [
        Chosen(c, place.project(c.columns), float(price))
        for c, price in zip(cat.candidates, cat.price, strict=True)
        if c.learned and str(c.setting["name"]) not in there
    ]
    return replace(found, chosen=(*found.chosen, *more), named=(*found.named, *more)) if more else found


@dataclass(frozen=True)
class Tried:
    """What may be in the touches, whatever is set aside of them: causes and shapes with every setting; what competes with them."""

    candidates: Sequence[Candidate]
    kernels: Sequence[Kernel]
    slow: Sequence[tuple[str, Array]]  # functions that the size of a name may follow


def tried(before: Estimate, means: Rows, excluded: Collection[str], learned: Sequence[Mapping[str, Any]] = ()) -> Tried:
    """estimate, rows, excluded causes, learned shapes → what is tried in every look."""
    touches, present = means.whole, before.model.names
    every = [
        *map(means.candidate, named(touches, present, excluded, means.settings)),
        *outliers(means.seen),
        *map(means.candidate, shapes(touches, set(families.causes()) - set(excluded), len(means.seen))),
        *map(means.candidate, _known_shapes(touches, present, excluded, learned)),
    ]
    return Tried(every, kernels_of(means), slow(touches))


def _contested(means: Rows, found: Explanation, weight: Array, what: Tried) -> tuple[Field, Outcome]:
    """What was found, against shapes without a name."""
    field = Field([*what.kernels, *changing(means, found.named, what.slow)], found.place.basis, weight, means)
    fixed = [c for c in found.chosen if c.candidate.cause == "outlier"]
    return field, contest(field, found.place.y, fixed, found.named)


@dataclass(frozen=True)
class Look:
    """What explains the touches at the weights that they were given."""

    found: Explanation
    weight: Array  # (n,) of the rows
    field: Field
    outcome: Outcome
    value: float  # evidence of the best of it, comparable between weights


@dataclass(frozen=True, eq=False)
class Searched:
    """What the search found, at the weights that explain most."""

    found: Explanation
    weight: Array  # (n,) of the rows
    rough: list[_explain.Rough]  # facets that scatter more than the others
    scatter: Scatter
    field: Field
    outcome: Outcome


def explained(
    before: Estimate, means: Rows, what: Tried, excluded: Collection[str], seed: int, moments: Sequence[Moment] = ()
) -> Searched:
    """estimate, rows, what is tried, moments set aside → names, weights, rough facets, scatter, field of shapes, what stands.

    Facets, directions, indexations or times that scatter more than the others get less weight; then all is looked at again. A
    shape follows rough facets as well, and then nothing scatters: where it is one or the other, evidence decides.
    """
    seen = means.seen
    members = _scatter.groupings(seen)
    glance = _Glance(before, means, what, excluded, seed, moments)

    def spread(look: Look, shapes: bool, least: float) -> list[Uneven]:
        """look, whether its shapes are patterns, evidence that is asked for → rows that scatter more; by what else they may do."""
        found, outcome = look.found, look.outcome
        # What has a pattern, with a name or without, is no spread: it is taken out before variances are compared.
        names = outcome.named if shapes else found.named
        picked = [p for p in outcome.picked if shapes or p.kernel.noise]
        broad = replace(found, chosen=tuple(c for c in names if not _explain.narrow(c)))
        m = found.place.m
        smooth = sum((p.tau * p.columns @ p.columns.T for p in picked), np.zeros((m, m)))
        left = _variances.left(found.place.basis, found.place.y, look.weight, columns_of(found.place, broad.chosen), picked)
        scatter = _scatter.scatter(left.residual, left.own, members, left, least)
        groupings = [scatter.by, scatter.rival] if scatter.by is not None and scatter.evidence > _scatter.CLEAR else [scatter.by]
        result = []
        for by in groupings:
            wild: list[_explain.Rough] = []
            if by is not None and not (by == "facet" and families.scattering("facet") in excluded):
                own = seen.facet if by == "facet" else tuple(map(str, members[by]))
                wild = _explain.rough(replace(found, chosen=(*broad.chosen, *_narrow(found))), own, look.weight, smooth)
            if by is not None and wild:
                result.append(Uneven(by, wild, scatter, own))
        return result or [Uneven("", [], scatter, ())]

    turns: list[tuple[Look, Uneven]] = []
    todo, tried = [Uneven("", [], _scatter.EVEN, ())], {frozenset[tuple[str, str]]()}
    while todo and len(turns) < ROUNDS:
        weights = todo.pop(0)
        look = glance.look(weights.weight(len(seen)), weights.price)
        # Weights that were clear once stay as long as anything speaks for them: shapes may take their place and give it back.
        found = spread(look, True, 0.0 if weights.rough else _scatter.CLEAR)
        turns.append((look, weights if weights.rough else found[0]))
        if not turns[0][1].rough and look is turns[0][0] and look.outcome.shapes:
            found = spread(look, False, _scatter.CLEAR)
        for one in found:
            if one.key not in tried:
                tried.add(one.key)
                todo.append(one)
    if turns[0][1].rough and len(turns) > 1:  # what is clear with shapes beside it is no choice
        del turns[0]
    look, weights = max(turns, key=lambda t: t[0].value)
    behind = [look.value - other.value for other, by in turns if by.rough and by.by != weights.by]
    clear = weights.by == "facet" and (weights.scatter.clear or (bool(behind) and min(behind) > _scatter.APART))
    return Searched(look.found, look.weight, weights.rough if clear else [], weights.scatter, look.field, look.outcome)


@dataclass(frozen=True)
class Uneven:
    """Rows that scatter more than the others."""

    by: str  # what they are grouped by
    rough: list[_explain.Rough]
    scatter: Scatter
    own: Sequence[str]  # (n,) group of every row

    @property
    def key(self) -> frozenset[tuple[str, str]]:
        """→ which groups they are."""
        return frozenset((self.by, r.key) for r in self.rough)

    @property
    def price(self) -> float:
        """→ what their variances cost (Schwarz 1978)."""
        return sum(float(np.log(self.own.count(r.key))) for r in self.rough)

    def weight(self, n: int) -> Array:
        """number of rows → (n,) weights that make them scatter alike."""
        lighter = {r.key: r.weight for r in self.rough}
        return np.array([lighter.get(group, 1.0) for group in self.own]) if self.rough else np.ones(n)


class _Glance:
    """What is the same in every look."""

    def __init__(
        self, before: Estimate, means: Rows, what: Tried, excluded: Collection[str], seed: int, moments: Sequence[Moment]
    ) -> None:
        self.means, self.what, self.seed = means, what, seed
        self.every = list(what.candidates)
        self.offsets = {name: p.value for name, p in before.facets.items()}
        self.causes = families.causes()
        self.awaited = {
            name: (*cause.mistaken, *(n for n, other in self.causes.items() if name in other.mistaken))
            for name, cause in self.causes.items()
            if cause.expected
        }
        gaps, jacobian = (means.of(x) for x in linearise(before.model, before.values))
        jacobian = np.hstack([jacobian, *(means.of(m.columns) for m in moments)])
        distances, rows, uncertainty = known(before.model, before.values)
        self.gaps, self.jacobian, self.distances = gaps, jacobian, distances
        self.rows = np.pad(rows, ((0, 0), (0, jacobian.shape[1] - rows.shape[1])))
        self.certain = before.sigma / uncertainty
        self.kernels = kernels(means.seen)
        self.even: Array | None = None  # (n, m) outside the model where all weights are one

    def _compatible(self, c: Candidate, others: Sequence[Candidate]) -> bool:
        """Waves of nearly one period, or kinks upon kinks, cancel each other and follow anything."""
        if c.cause in self.causes and self.causes[c.cause].in_place_of:
            return False  # it is tried where the other one was found
        same = [o.setting for o in others if o.cause == c.cause and o.setting.get("axis") == c.setting.get("axis")]
        return c.cause not in self.causes or self.causes[c.cause].beside(self.means.whole, c.setting, same)

    def _plausible(self, weight: Array) -> Callable[[Candidate, Array], bool]:
        means, causes = self.means, self.causes
        absorbed = np.linalg.qr(self.jacobian * weight[:, None] / np.maximum(np.linalg.norm(self.jacobian, axis=0), 1e-300))[0]

        def plausible(c: Candidate, values: Array) -> bool:
            if c.cause in causes and not causes[c.cause].plausible(values, c.setting, self.offsets):
                return False
            pattern = c.columns @ values / means.scale
            size = float(np.abs(pattern).max())
            if c.cause in ("", "outlier") or size < ABSURD:
                return True
            # Millimetres of which the model swallows all but a few micrometres are its blind spot and no cause.
            inside = absorbed @ (absorbed.T @ (pattern * means.scale)) / means.scale
            return float(np.abs(pattern - inside).max()) > SHOWS * size

        return plausible

    def look(self, weight: Array, price: float) -> Look:
        """weight (n,) of every row, what it costs that they differ → what explains the rows then."""
        means, causes, certain = self.means, self.causes, self.certain
        even = bool(np.all(weight == 1.0))
        plausible = self._plausible(weight)

        def weighed(c: Candidate) -> Candidate:
            return replace(c, columns=c.columns * weight[:, None])

        for _ in range(BLIND + 1):
            found = _explain.explain(
                np.concatenate([self.gaps * weight, self.distances * certain]),
                np.vstack([self.jacobian * weight[:, None], self.rows * certain[:, None]]),
                len(means.seen),
                self.every if even else [weighed(c) for c in self.every],
                [k * np.outer(weight, weight) for k in self.kernels],
                {name: cause.refine for name, cause in causes.items()},
                lambda cause, setting: weighed(means.candidate(candidate(means.whole, cause, setting))),
                plausible,
                self._compatible,
                expected=self.awaited,
                plainer={name: cause.plainer for name, cause in causes.items() if cause.plainer},
                twins=twins(causes),
                seed=self.seed,
            )
            # Plausible beside what was there when it was chosen, and no longer beside what is there now.
            absurd = {_where(c.candidate) for c, v in _explain.sizes(found) if not plausible(c.candidate, v)}
            if not absurd:
                break
            self.every = [c for c in self.every if _where(c) not in absurd]
        found = _with_learned(found)
        field, outcome = _contested(means, found, weight, self.what)
        found = replace(found, chosen=tuple(c for c in found.chosen if not any(c is o for o in outcome.needless)))
        if even:
            self.even = found.place.basis
        return Look(found, weight, field, outcome, outcome.best - self._stretched(weight) - price)

    def _stretched(self, weight: Array) -> float:
        """weight (n,) → log determinant by which the data that the model leaves are stretched, so that likelihoods compare."""
        if self.even is None or np.all(weight == 1.0):
            return 0.0
        inside = (self.even * (weight[:, None] ** -2 - 1)).T @ self.even
        return float(np.linalg.slogdet(np.eye(len(inside)) + inside)[1])


def _narrow(found: Explanation) -> list[Chosen]:
    return [c for c in found.chosen if _explain.narrow(c)]


def _known_shapes(
    touches: Touches, present: Collection[str], excluded: Collection[str], learned: Sequence[Mapping[str, Any]]
) -> list[Candidate]:
    """Shapes of this machine that are not in the model yet; what these touches have no covariate for is left out."""
    found = []
    kept = families.serving("learned")
    for shape in learned if kept not in excluded else ():
        setting = {key: shape[key] for key in ("name", "factors", "weight", "values")}
        try:
            one = candidate(touches, kept, setting)
        except InputError:
            continue
        if one.coefficients[0].name not in present:
            found.append(one)
    return found


def _where(c: Candidate) -> tuple[str, object]:
    """→ the cause and the axis or coefficient that it acts on."""
    return c.cause, c.setting.get("axis", c.setting.get("name"))


def kernels(touches: Touches) -> tuple[Array, Array]:
    """touches → covariances (n, n) of a wandering and of a new seat at every indexation, machine frame, unit size.

    The wandering is a random walk of x y z with variance 1 after an hour.
    """
    alike = touches.machine_normal @ touches.machine_normal.T
    hours = (touches.time - touches.time.min()) / 3600
    same = touches.indexation[:, None] == touches.indexation[None, :]
    return alike * np.minimum(hours[:, None], hours[None, :]), alike * same


__all__ = ["Tried", "explained", "kernels", "tried"]


def twins(causes: Mapping[str, families.Cause]) -> dict[str, tuple[str, ...]]:
    """causes by name → {one that is searched for: those that are tried in its place alone}."""
    found: dict[str, tuple[str, ...]] = {}
    for name, cause in causes.items():
        if cause.in_place_of:
            found[cause.in_place_of] = (*found.get(cause.in_place_of, ()), name)
    return found
