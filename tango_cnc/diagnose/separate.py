"""Which few touches would tell two causes apart, before anything is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import terms as families
from ..files.checked import suggestion
from ..identify import select
from ..model import known, linearise
from ..records import Array, InputError, TermItem
from ..touches import Touches
from ._candidates import Candidate, candidate
from ._seen import taken
from ._space import Space, space

USUAL = 0.005  # mm: size of the largest effect on a touch for which evidence is counted
PAIRS = 40  # variants of each cause that are compared


@dataclass(frozen=True)
class Addition:
    """One indexation to append to the strategy."""

    position: dict[str, float]  # rotary axes and S, rad
    facets: tuple[str, ...]
    apart: float  # part of one pattern that the other cannot imitate, with these touches
    evidence: float  # expected score between the two, with these touches


@dataclass(frozen=True)
class Separation:
    """How alike two causes look to a plan, and what would change that."""

    causes: tuple[str, str]
    settings: tuple[dict[str, object], dict[str, object]]  # the variants that look most alike
    apart: float  # part of the one that the other cannot imitate, 0 the same … 1 nothing in common
    evidence: float  # expected score between the two when one of them is there with its usual size
    additions: tuple[Addition, ...]  # most evidence first
    together: float  # evidence with all of them


def separation(touches: Touches, terms: Sequence[TermItem], one: str, other: str, most: int = 3) -> Separation:
    """planned touches, terms of the model, two causes → how to tell them apart. Raises InputError for other names."""
    model = select(touches, terms).model
    present = {c.name for c in model.coefficients}
    pairs = [_variants(touches, name, present) for name in (one, other)]
    place = _space(touches, terms)
    alike = sorted(
        ((_apart(place.project(a.columns), place.project(b.columns)), a, b) for a in pairs[0] for b in pairs[1]),
        key=lambda found: found[0],
    )
    if not alike:
        raise InputError(f"--separate: this plan sees nothing of {one} or {other}; it cannot separate what it cannot see")
    apart, a, b = alike[0]
    spindle = sorted({round(float(s), 6) for s in touches.axis("S")} | {0.0, round(float(np.pi), 6)})
    column = touches.machine.column("S")
    gap = float(np.median(np.diff(touches.time))) if len(touches) > 1 else 5.0

    def with_these(tries: Sequence[tuple[NDArray[np.int64], float]]) -> tuple[float, float]:
        """rows repeated at the end, each with an angle of the spindle → apart and evidence of the longer test."""
        tails = [touches.position[rows] for rows, _ in tries]
        for tail, (_, angle) in zip(tails, tries, strict=True):
            tail[:, column] = angle
        index = np.concatenate([np.arange(len(touches)), *(rows for rows, _ in tries)])
        longer = taken(touches, index, np.vstack(tails), gap)
        wider = _space(longer, terms)
        patterns = [candidate(longer, c.cause, c.setting).columns for c in (a, b)]
        mine, theirs = (wider.project(x) for x in patterns)
        return _apart(mine, theirs), _evidence(mine, theirs, patterns[0], longer)

    found = []
    for number in np.unique(touches.indexation):
        rows = np.flatnonzero(touches.indexation == number)
        for angle in spindle:
            where = {n: float(touches.position[rows[0], touches.machine.column(n)]) for n in touches.machine.rotary} | {"S": angle}
            addition = Addition(where, tuple(touches.facet[r] for r in rows), *with_these([(rows, angle)]))
            found.append((addition, (rows, angle)))
    found.sort(key=lambda x: -x[0].evidence)
    chosen: list[tuple[Addition, tuple[NDArray[np.int64], float]]] = []
    for one_more in found:
        # The same place with another angle of the spindle says nearly the same again.
        if len(chosen) < most and all(one_more[1][0][0] != c[1][0][0] for c in chosen):
            chosen.append(one_more)
    before = _evidence(place.project(a.columns), place.project(b.columns), a.columns, touches)
    together = with_these([rows for _, rows in chosen])[1]
    return Separation((one, other), (dict(a.setting), dict(b.setting)), apart, before, tuple(x for x, _ in chosen), together)


def _evidence(a: Array, b: Array, pattern: Array, touches: Touches) -> float:
    """projected columns (m, k) and (m, l), columns (n, k) → twice the log likelihood ratio of the true one to the other, expected.

    The effect is as large as usual and has any direction: the mean over them.
    """
    q = np.linalg.qr(b[:, np.any(b != 0, axis=0)])[0]
    rest = a - q @ (q.T @ a)
    peak = np.abs(pattern).max(axis=0)
    sigma = touches.machine.probe.repeatability or 1e-4
    return float(np.mean(np.sum(rest**2, axis=0) / np.where(peak > 0, peak, np.inf) ** 2)) * (USUAL / sigma) ** 2


def _variants(touches: Touches, name: str, present: set[str]) -> list[Candidate]:
    allowed = families.patterns()
    if name not in allowed:
        raise InputError(f"--separate: found {name!r}; allowed: two of {', '.join(allowed)}.{suggestion(name, allowed)}")
    settings = list(families.causes()[name].variants(touches))
    step = max(1, len(settings) // PAIRS)
    found = [candidate(touches, name, setting) for setting in settings[::step]]
    return [c for c in found if not {k.name for k in c.coefficients} <= present and np.abs(c.columns).max() > 0]


def _space(touches: Touches, terms: Sequence[TermItem]) -> Space:
    model = select(touches, terms).model
    start = np.zeros(len(model.names))
    _, jacobian = linearise(model, start)
    _, rows, uncertainty = known(model, start)
    sigma = touches.machine.probe.repeatability or 1e-4
    full = np.vstack([jacobian, rows * (sigma / uncertainty)[:, None]])
    return space(np.zeros(len(full)), full, len(touches), ())


def _apart(a: Array, b: Array) -> float:
    """projected columns (m, k) and (m, l) → 1 less the mean squared canonical correlation; 1 where one cannot be seen."""
    bases = []
    for x in (a, b):
        u, s, _ = np.linalg.svd(x, full_matrices=False)
        bases.append(u[:, s > 1e-6 * max(float(s[0]), 1e-12)] if len(s) and s[0] > 1e-9 else u[:, :0])
    if not bases[0].shape[1] or not bases[1].shape[1]:
        return 1.0
    correlation = np.linalg.svd(bases[0].T @ bases[1], compute_uv=False)
    return max(0.0, 1 - float(np.mean(correlation**2)))
