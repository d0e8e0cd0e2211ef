"""Names against shapes: which of them, and together with what, explain the residuals best.

Evidence is twice the log of the marginal likelihood less a price: for a name log m a coefficient and twice the log of the
variants that were tried; for a shape log m for its variance and twice the log of all shapes. All is compared in the space
that the model does not reach; what is chosen whitens the data and all shapes, so that each step costs as much as the first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as field_of

import numpy as np
from scipy import linalg

from ..records import Array
from ._catalogue import Chosen
from ._field import Field, Picked, State, asked, begin, columns_of, first, grown, price
from ._names import akin, discounts, once
from ._smooth import Kernel
from ._space import orthonormal

NEAR = 60  # shapes that are compared again in every subset
ABSORBED = 0.5  # part of the pattern of a name that shapes beside it could take: it is a part of them
MARGIN = 6.0  # evidence by which names must beat shapes: strong (Kass & Raftery 1995)
ALONE = 10.0  # and by which a name explains the touches, and not one of both, and by which several must: very strong
SURE = 20.0  # and where something is left beside them, of which they may be a part, or where there are several


def evidence(field: Field, s: State, names: Sequence[Chosen]) -> float:
    """state, its names → evidence."""
    m = len(s.y)
    prices = sum(c.price for c in names) + sum(price(field, m, p.kernel) for p in s.picked)
    return -m * float(np.log(s.y @ s.y)) - s.logdet - prices


def shortlist(field: Field, y: Array, names: Sequence[Chosen], outcome: Outcome) -> list[Kernel]:
    """field, data, names, outcome → the shapes that come next to the names and to nothing: few enough for many subsets."""
    near: set[int] = set()
    for kept in ((), tuple(names)):
        _, (best, _) = first(field, y, (), kept)
        near |= set(np.argsort(-best[:, 0])[:NEAR].tolist())
    near |= {i for i, k in enumerate(field.kernels) if k.noise}
    return [*(field.kernels[i] for i in sorted(near)), *(p.kernel for p in outcome.picked if p.kernel.kind == "window")]


@dataclass(frozen=True)
class Outcome:
    """What stands after the contest."""

    named: tuple[Chosen, ...]  # names that no shape does as well as
    resembled: tuple[Chosen, ...]  # names that a shape does as well as
    picked: tuple[Picked, ...]  # shapes, noises and events, as they were chosen
    nothing: float  # evidence of nothing at all
    by_names: float  # with the names that were found, and noises
    by_shapes: float  # without any name
    needless: tuple[Chosen, ...] = ()  # single touches that stood apart only beside a name that did not stand
    above: Mapping[int, float] = field_of(default_factory=dict)  # by id of a name, the evidence that it has over every shape
    nearest: Mapping[int, str] = field_of(default_factory=dict)  # and the covariates of the largest shape in its place then
    best: float = -np.inf  # evidence of the best of all that was compared, whatever stands

    @property
    def shapes(self) -> tuple[Picked, ...]:
        """→ patterns without a name."""
        return tuple(p for p in self.picked if p.kernel.kind == "shape")

    @property
    def events(self) -> tuple[Picked, ...]:
        """→ what belongs to one moment or one pose."""
        return tuple(p for p in self.picked if p.kernel.event)


def contest(field: Field, y: Array, fixed: Sequence[Chosen], names: Sequence[Chosen], margin: float = MARGIN) -> Outcome:
    """field, data (m,), single touches that are set aside, names that were found → what stands.

    A name stands when it beats every combination of shapes in its place by a margin; a shape that was learned before needs none.
    Beside a shape that has more evidence it does not stand: it may be a part of what this shape is a part of. Where they follow
    nothing in common, it stands if it is sure. Subsets of the touches (margin below 0) do not ask for that.
    """
    asking = _Asking(field, y, fixed, discounts(y, [*fixed, *names], names))
    nothing = evidence(field, begin(field, y, columns_of(len(y), fixed)), ()) - sum(c.price for c in fixed)
    shapes = asking.of((), away=names)
    if not names:
        alone, needless = asking.of((), True).value, tuple(c for c in fixed if c not in shapes.apart)
        return Outcome((), (), shapes.picked, nothing, alone, shapes.value, needless, best=shapes.value)
    by_names = asking.of(names, True).value
    stands = asking.of(once(names))
    best = max(stands.value, shapes.value)
    stands, order, without = _without_needless(asking, stands, shapes, margin)
    value, smaller = stands.value, []
    if stands.kept and margin > 0:
        still = [
            c
            for c, w in zip(stands.kept, without, strict=True)
            if c.candidate.learned or _larger(c, value - w.value, stands.picked)
        ]
        smaller = [c for c in stands.kept if c not in still]
        stands = asking.of(still) if smaller else stands
    stands = _outside_of_shapes(asking, stands)
    kept, picked = stands.kept, stands.picked
    beaten = {id(c): w for c, w in zip(order, without, strict=True) if c in kept and _patterns(w.picked)}
    above_shapes = {key: value - w.value for key, w in beaten.items()}
    nearest = {
        key: max((p for p in w.picked if not p.kernel.noise), key=lambda p: p.score).kernel.covariate for key, w in beaten.items()
    }
    lost = tuple(c for c in names if c not in kept)
    apart = [c for c in needed(y, fixed, kept, picked) if c in stands.apart] if lost or picked else fixed
    needless = tuple(c for c in fixed if c not in apart)
    resembled = tuple(c for c in lost if c not in smaller)
    return Outcome(tuple(kept), resembled, picked, nothing, by_names, shapes.value, needless, above_shapes, nearest, best)


@dataclass(frozen=True)
class _Stands:
    """Names, their evidence together, what was picked beside them, single touches that are set aside."""

    kept: Sequence[Chosen]
    value: float
    picked: tuple[Picked, ...]
    apart: Sequence[Chosen]


@dataclass(frozen=True)
class _Asking:
    """Field, data (m,), single touches that may be set aside, by id of a name what it costs less beside the others."""

    field: Field
    y: Array
    fixed: Sequence[Chosen]
    cheaper: Mapping[int, float]

    def of(self, kept: Sequence[Chosen], noises: bool = False, away: Sequence[Chosen] = ()) -> _Stands:
        """names, whether only noises stand beside them, names that are out → what stands then.

        Shapes are also looked for with all touches: what a few of them show would never be seen where these few were set aside
        before.
        """
        best = self._beside(kept, noises, self.fixed, away)
        tried = {len(self.fixed)}
        for one in (best, *((self._beside(kept, noises, (), away),) if self.fixed else ())):
            apart = needed(self.y, self.fixed, kept, one.picked)
            if len(apart) not in tried:
                tried.add(len(apart))
                best = max(best, self._beside(kept, noises, apart, away), key=lambda s: s.value)
        return replace(best, value=best.value + sum(self.cheaper[id(c)] for c in kept))

    def _beside(self, kept: Sequence[Chosen], noises: bool, apart: Sequence[Chosen], away: Sequence[Chosen]) -> _Stands:
        known, key = asked(self.field, self.y, apart, kept).grown, (noises, *sorted(id(c.candidate) for c in away))
        if key not in known:
            s = grown(self.field, self.y, apart, kept, noises, away)
            known[key] = evidence(self.field, s, kept) - sum(c.price for c in apart), s.picked
        return _Stands(kept, *known[key], apart)


def _without_needless(
    asking: _Asking, stands: _Stands, shapes: _Stands, margin: float
) -> tuple[_Stands, Sequence[Chosen], Sequence[_Stands]]:
    """names that stand, shapes in place of all of them, margin → those that beat what stands in their place, the names that were
    compared last, what stands without each of them.
    """
    order: Sequence[Chosen] = ()
    without: list[_Stands] = []
    while stands.kept:
        order = kept = list(stands.kept)
        without = [asking.of([c for c in kept if c is not old], away=[old]) for old in kept]
        margins = [0.0 if c.candidate.learned else max(margin, ALONE) if margin > 0 and len(kept) > 1 else margin for c in kept]
        above = [w.value + (m if _patterns(w.picked) else 0.0) for w, m in zip(without, margins, strict=True)]
        if _patterns(shapes.picked) and shapes.value + min(margins) > stands.value:
            stands = replace(stands, kept=(), picked=shapes.picked, apart=shapes.apart)
            break
        worst = int(np.argmax(above))
        if above[worst] <= stands.value:
            break
        stands = without[worst]
    return stands, order, without


def _outside_of_shapes(asking: _Asking, stands: _Stands) -> _Stands:
    """what stands → the same without names that its shapes hold already."""
    own = [p.columns for p in stands.picked if not p.kernel.noise]
    if not own or not stands.kept:
        return stands
    q = orthonormal(np.hstack(own))
    still = [c for c in stands.kept if c.candidate.learned or not _inside(c.columns, q)]
    return asking.of(still) if len(still) < len(stands.kept) else stands


def needed(y: Array, fixed: Sequence[Chosen], kept: Sequence[Chosen], picked: Sequence[Picked]) -> list[Chosen]:
    """data (m,), single touches that were set aside beside some names, names and shapes that explain the rest → those of them
    that are worth their price even so.

    A name that only resembles what is there leaves single touches far away; set aside for nothing, they would speak for it.
    """
    if not fixed:
        return []
    m = len(y)
    lower = np.linalg.cholesky(np.eye(m) + sum((p.tau * p.columns @ p.columns.T for p in picked), np.zeros((m, m))))
    white, own, names = np.split(
        linalg.solve_triangular(lower, np.hstack([y[:, None], columns_of(m, fixed), columns_of(m, kept)]), lower=True),
        [1, 1 + len(fixed)],
        axis=1,
    )
    found = []
    for i, c in enumerate(fixed):
        basis = orthonormal(np.hstack([names, np.delete(own, i, axis=1)]))
        left, column = (x - basis @ (basis.T @ x) for x in (white[:, 0], own[:, i]))
        part = float(column @ left) ** 2 / max(float(column @ column) * float(left @ left), 1e-300)
        if -m * float(np.log(max(1 - part, 1e-9))) > c.price:
            found.append(c)
    return found


def largest(picked: Sequence[Picked]) -> float:
    """what was chosen → evidence of the largest shape among it."""
    return max((p.score for p in picked if p.kernel.kind == "shape"), default=0.0)


def _larger(c: Chosen, above: float, picked: Sequence[Picked]) -> bool:
    """a name, its evidence over every shape in its place, what stands beside it → whether no shape is in its way."""
    near = [p for p in picked if akin(c.candidate, p.kernel.covariate)]
    return above > largest(near) and (above > SURE or above > largest(picked))


def _patterns(picked: Sequence[Picked]) -> bool:
    return any(not p.kernel.noise for p in picked)


def _inside(columns: Array, q: Array) -> bool:
    return float(np.sum((q.T @ columns) ** 2)) > ABSORBED * float(np.sum(columns**2))


def refinement(p: Picked, names: Sequence[Chosen]) -> bool:
    """a shape, names → whether it only refines one that was learned before and has come back."""
    q = orthonormal(p.columns)
    return any(c.candidate.learned and _inside(c.columns, q) for c in names)


__all__ = ["ALONE", "MARGIN", "SURE", "Outcome", "contest", "evidence", "largest", "needed", "refinement", "shortlist"]
