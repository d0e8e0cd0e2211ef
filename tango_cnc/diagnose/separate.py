"""Which few touches would tell two causes apart, before anything is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import terms as families
from ..identify import select
from ..model import known, linearise
from ..records import Array, InputError, TermItem
from ..touches import Touches
from ._candidates import Candidate, candidate
from ._seen import _taken
from ._space import Space, space

PAIRS = 40  # variants of each cause that are compared


@dataclass(frozen=True)
class Addition:
    """One indexation to append to the strategy."""

    position: dict[str, float]  # rotary axes and S, rad
    facets: tuple[str, ...]
    apart: float  # part of one pattern that the other cannot imitate, with these touches


@dataclass(frozen=True)
class Separation:
    """How alike two causes look to a plan, and what would change that."""

    causes: tuple[str, str]
    settings: tuple[dict[str, object], dict[str, object]]  # the variants that look most alike
    apart: float  # part of the one that the other cannot imitate, 0 the same … 1 nothing in common
    additions: tuple[Addition, ...]


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
        raise InputError(f"--separate: this plan sees nothing of {one} or {other}; it cannot tell what it cannot see")
    apart, a, b = alike[0]
    additions = []
    spindle = sorted({round(float(s), 6) for s in touches.axis("S")} | {0.0, round(float(np.pi), 6)})
    column = touches.machine.column("S")
    gap = float(np.median(np.diff(touches.time))) if len(touches) > 1 else 5.0
    for number in np.unique(touches.indexation):
        rows = np.flatnonzero(touches.indexation == number)
        for angle in spindle:
            position = touches.position[rows].copy()
            position[:, column] = angle
            longer = _taken(touches, np.concatenate([np.arange(len(touches)), rows]), position, gap)
            wider = _space(longer, terms)
            columns = [wider.project(candidate(longer, c.cause, c.setting).columns) for c in (a, b)]
            names = (*touches.machine.rotary, "S")
            where = {name: float(position[0, touches.machine.column(name)]) for name in names}
            additions.append(Addition(where, tuple(touches.facet[r] for r in rows), _apart(*columns)))
    additions.sort(key=lambda x: -x.apart)
    return Separation((one, other), (dict(a.setting), dict(b.setting)), apart, tuple(additions[:most]))


def _variants(touches: Touches, name: str, present: set[str]) -> list[Candidate]:
    module = families.causes().get(name)
    if module is None or not hasattr(module, "variants"):
        allowed = [n for n, m in families.causes().items() if hasattr(m, "variants")]
        raise InputError(f"--separate: found {name!r}; allowed: two of {', '.join(allowed)}")
    settings = list(module.variants(touches))
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
