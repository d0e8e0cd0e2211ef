"""What is left beside the names: shapes, facets that scatter or are loose, noises, and reasons to doubt a name."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import _loose, _moments, _scatter, _shapes, _spread, _together
from ._catalogue import APART
from ._changing import over, unsteady
from ._contest import ALONE, SURE, largest
from ._grounds import Grounds, outliers, rows_of
from ._moments import Moment
from ._names import akin, foreign
from ._records import Finding, Remainder
from ._scatter import Scatter
from ._standing import Standing, resting


@dataclass(frozen=True, eq=False)
class Remaining:
    """What a diagnosis reports beside the names."""

    remains: Sequence[Remainder]
    spreads: Sequence[Finding]  # causes that show in the spread of the touches
    scatter: Scatter


def remaining(
    g: Grounds,
    stand: Standing,
    named: Sequence[Finding],
    moments: Sequence[Moment],
    excluded: Collection[str],
    days: Mapping[str, str | None],
    seed: int,
) -> Remaining:
    """what to judge on, names that stand, their findings, moments set aside, excluded causes, days of learned shapes → the rest."""
    n = len(g.means.seen)
    remains, spreads = _patterns(g, stand, bool(moments), excluded, days)
    remains += _drifting(g, stand, not remains and not named and not spreads)
    remains += _moments.left(g.means, g.found, stand.outcome, g.search.weight, moments)
    scatter = _scatter.remembering(_scatter.EVEN if any(r.form for r in remains) else g.search.scatter, stand.outcome)
    if not remains:
        remains += _memory(g, stand)
    if not remains:
        refusals = [(c, g.sizes[id(c)].amplitude) for c in g.whole.chosen if stand.why.get(id(c)) is not None]
        remains += _shapes.refused(g.found, refusals, n)
    if not remains:
        remains += resting(g, stand.accepted, stand.outcome, seed, bool(named or spreads or moments))
    if g.means.all:
        lonely = outliers(g.whole)
        amplitudes = {row: g.sizes[id(c)].amplitude for row, c in zip(rows_of(lonely), lonely, strict=True)}
        remains += _together.together(g.means.seen, amplitudes)
    if stand.accepted and not remains and _scatter.uneven(g.search.scatter):
        remains.append(Remainder(str(g.search.scatter.by), "none", "uneven", g.found.sigma, 0.0, np.zeros(n)))
    if not remains:
        remains += _undecided([*named, *spreads], n, _followed(stand))
    if not remains:
        remains += _unsteady(g, stand, n)
    return Remaining(remains, spreads, scatter)


def _patterns(
    g: Grounds, stand: Standing, aside: bool, excluded: Collection[str], days: Mapping[str, str | None]
) -> tuple[list[Remainder], list[Finding]]:
    """→ shapes without a name and facets that may be loose; causes that show in the spread of the touches."""
    linear, means, weight, outcome = g.design, g.means, g.search.weight, stand.outcome
    held_out = linear.columns, linear.data, linear.schemes, linear.keep
    remains = _shapes.remainders(g.found, outcome, means, weight, stand.accepted, *held_out, days)
    seats, shown = any(p.kernel.noise and p.kernel.kind == "seat" for p in outcome.picked), largest(outcome.picked)
    spreads = _spread.findings(g.whole, means.seen, g.search.rough, excluded, remains, seats, shown, aside)
    scattering = [r for r in g.search.rough if any(r.key in f.setting.get("facets", ()) for f in spreads)]
    stood = linear.beside([*g.alone, *stand.accepted])
    follows = _loose.loose(means, weight, stood, linear.data, outcome.picked, scattering)
    scattering, loose = _loose.parted(scattering, follows)
    if loose:
        remains += loose
        spreads = _spread.findings(g.whole, means.seen, scattering, excluded, remains, seats, shown, aside)
    none = np.zeros(len(means.whole))
    return remains, [] if g.few else [replace(_loose.beside(f, follows), pattern=none) for f in spreads]


def _drifting(g: Grounds, stand: Standing, nothing: bool) -> Iterator[Remainder]:
    """what stands, whether nothing is named or left so far → walks, and seats where a name had taken what is there all the same."""
    picked = stand.outcome.picked
    wandering = []
    if not picked or any(p.kernel.noise and p.kernel.kind == "walk" for p in picked):
        wandering = _spread.wandering(g.whole, g.means.seen)
    yield from wandering
    if nothing and not wandering:  # names that did not stand had taken what is there all the same
        for p in picked:
            if p.kernel.kind in ("walk", "seat"):
                yield _shapes.unnamed(p.kernel.kind, g.found.sigma * float(np.sqrt(p.tau)), len(g.means.seen))


def _memory(g: Grounds, stand: Standing) -> Iterator[Remainder]:
    """→ touches that remember the one before: as a walk of the machine, this is more than scatter."""
    like = [p for p in stand.outcome.picked if p.kernel.kind == "memory" and p.score > _scatter.CLEAR]
    for p in like[:1]:
        size = g.found.sigma * float(np.sqrt(p.tau))
        yield Remainder("order", "none", "memory", size, 0.0, np.zeros(len(g.means.seen)))


def _followed(stand: Standing) -> list[bool]:
    """names that stand → of each, whether another one follows what it follows, or a shape in its place something else."""
    return [
        any(o is not c and akin(c.candidate, over(o.candidate)) for o in stand.accepted)
        or (len(stand.accepted) > 1 and foreign(c.candidate, stand.outcome.nearest.get(id(c), "")))
        for c in stand.accepted
    ]


def _undecided(findings: Sequence[Finding], n: int, akin_to: Sequence[bool] = ()) -> list[Remainder]:
    """what is named, number of rows, whether another name follows what the first of them do → of which of these another cause, or
    a shape, does nearly as well: that one of them is there explains the touches, and not what it is.

    A name may follow what another one leaves that only resembles what is there: names of one covariate have to be sure, and
    so has one of several where the shape follows something that the name does not.
    """
    found = []
    for i, f in enumerate(findings):
        near = tuple(dict.fromkeys(cause for cause, _, behind in f.alternatives if behind <= APART))
        if near:
            found.append(Remainder("", "none", "undecided", f.size.amplitude, 0.0, np.zeros(n), rivals=near, confirm=f.cause))
        if f.nearest is not None and f.nearest[1] < (SURE if any(akin_to[i : i + 1]) else ALONE):
            found.append(Remainder(f.nearest[0], "none", "near", f.size.amplitude, 0.0, np.zeros(n), confirm=f.cause))
    return found


def _unsteady(g: Grounds, stand: Standing, n: int) -> Iterator[Remainder]:
    """→ names whose size changes with something."""
    for c, covariate in unsteady(g.search.field, g.y, g.alone, stand.accepted, stand.outcome.picked):
        about = g.sizes[id(c)].amplitude, 0.0, np.zeros(n)
        yield Remainder(covariate, "none", "near", *about, confirm=c.candidate.cause)


__all__ = ["Remaining", "remaining"]
