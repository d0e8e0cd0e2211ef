"""Indexations that take no part in the estimate are predicted by it (thesis section 4.8, Table 4-9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..estimate import Estimate, estimate
from ..files.readings import degrees_of
from ..model import Model, linearise
from ..records import Array, Artefact, InputError, Machine, Readings, TangoError, TermItem
from ..touches import from_readings
from ._shared import Figures, figures

Groups = tuple[tuple[int, ...], ...]
SELDOM = 1e-3  # chance of a ratio that is taken for more than chance
TOGETHER = 2.0  # groups whose predictions count for those of one that stands alone
MEDIAN = 0.6745  # of the absolute value of a normal quantity with standard deviation 1
SAME = 1e-3  # of what an unknown does to a touch: less is the same


@dataclass(frozen=True)
class HeldOut:
    """One row a touch that was predicted without its group: residual and how far it was to be expected, mm."""

    groups: Groups
    touch: NDArray[np.int64]
    facet: tuple[str, ...]
    indexation: NDArray[np.int64]  # from 1, as in the strategy
    group: NDArray[np.int64]  # place in `groups`
    residual: Array  # positive = the ball stands off the predicted surface
    expected: Array  # one standard deviation: touch, parameters and facet offsets together
    told: NDArray[np.bool_]  # whether the other touches determine all that moves it
    fitted: Array  # residuals of the estimates' own touches, all groups
    unpredictable: tuple[str, ...]  # facets that only held-out indexations touch
    unseen: tuple[str, ...]  # what the remaining indexations cannot tell apart, in words
    chance: float = 0.0  # ratio that a model which lacks nothing exceeds once in 1000 runs
    skipped: Groups = ()  # groups without which the other touches support no estimate

    @property
    def figures(self) -> Figures:
        """→ figures of the held-out residuals."""
        return figures(self.residual)

    @property
    def ratio(self) -> float:
        """→ rms of residual over expectation: 1 where the model predicts as well as it claims; 0 where there is nothing to judge.

        A touch that depends on what only its own group tells is no test of the model: an expectation knows nothing of that.
        """
        return self.ratio_of(self.told)

    def ratio_of(self, rows: NDArray[np.bool_]) -> float:
        """(n,) which rows → their rms of residual over expectation; 0 of none."""
        return float(np.sqrt(np.mean((self.residual[rows] / self.expected[rows]) ** 2))) if rows.any() else 0.0

    @property
    def far(self) -> NDArray[np.bool_]:
        """→ (n,) rows that are further off than any touch of as many is by chance (one run in 1000), as the others scatter."""
        off = np.abs(self.residual / self.expected)
        scatter = float(np.median(off[self.told])) / MEDIAN if self.told.any() else 1.0
        limit = -special.ndtri(SELDOM / 2 / max(len(off), 1))
        return self.told & (off > limit * max(scatter, 1.0))

    @property
    def beyond(self) -> float:
        """→ `ratio` where chance does not explain it; else 1 at most: what few touches predict is off by much now and then."""
        return self.ratio if self.ratio > self.chance else min(self.ratio, 1.0)


def indexations(readings: Readings, machine: Machine) -> NDArray[np.int64]:
    """readings → (n,) number of the indexation from 1, the same in every cycle.

    A new one begins when a rotary axis or the spindle has turned; rows of any status count.
    """
    columns = [machine.column(name) for name in (*machine.rotary, "S")]
    turned = (np.abs(np.diff(readings.position[:, columns], axis=0)) > np.radians(0.05)).any(axis=1)
    fresh = (np.diff(readings.cycle) != 0) | (np.diff(readings.day) != 0)
    number = np.ones(len(readings), dtype=np.int64)
    for i in range(1, len(readings)):
        number[i] = 1 if fresh[i - 1] else number[i - 1] + turned[i - 1]
    return number


def leave_one_out(number: NDArray[np.int64]) -> Groups:
    """(n,) indexation numbers → one group each."""
    return tuple((int(i),) for i in np.unique(number))


def dealt(number: NDArray[np.int64], size: int) -> Groups:
    """(n,) indexation numbers, indexations a group → groups, dealt like cards so that each is spread over the whole plan.

    Raises InputError when nothing would be left to estimate from.
    """
    every = np.unique(number)
    if not 1 <= size < len(every):
        raise InputError(f"--groups: found {size}; allowed: 1 to {len(every) - 1}, the readings have {len(every)} indexations")
    count = -(-len(every) // size)
    return tuple(tuple(int(i) for i in every[k::count]) for k in range(count))


def held_out(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    terms: Sequence[TermItem],
    groups: Groups,
    degree: int = 3,
    whole: bool = True,
) -> HeldOut:
    """readings, terms, groups of indexations, whether each must be → each group predicted by an estimate from all others.

    Raises InputError for an indexation that the readings lack, TangoError when what remains supports no estimate; unless each
    must be predicted, only when that holds for all of them.
    """
    number = indexations(readings, machine)
    every = estimate(machine, artefact, readings, terms, degree).model
    known = set(number.tolist())
    for i in (i for group in groups for i in group):
        if i not in known:
            raise InputError(f"--hold-out: found indexation {i}; allowed: 1 to {max(known)}, counted as in the strategy")
    parts: list[tuple[Readings, NDArray[np.int64], int, NDArray[np.bool_], Array, Array]] = []
    worth: list[tuple[float, float, int]] = []
    lost: set[str] = set()
    fitted: list[Array] = []
    unseen: dict[str, None] = {}
    skipped: list[tuple[int, ...]] = []
    for place, group in enumerate(groups):
        out = np.isin(number, group)
        try:
            result = estimate(machine, artefact, readings.rows(~out & _whole_balls(artefact, readings, ~out)), terms, degree)
        except TangoError as error:
            if not whole and len(skipped) < len(groups) - 1:
                skipped.append(group)
                continue
            raise TangoError(f"without indexations {', '.join(map(str, group))}: {error}") from None
        fitted.append(result.residuals)
        unseen |= {c.text: None for c in result.selection.unseen}
        seen = set(result.model.touches.facets) | {f.id for f in artefact.facets.values() if f.ball in result.model.touches.balls}
        rows = np.flatnonzero(out & readings.ok)
        lost |= {readings.facet[i] for i in rows} - seen
        rows = rows[[readings.facet[i] in seen for i in rows]]
        if len(rows):
            told = _told(every, result.model, np.flatnonzero(readings.ok), rows, out)
            gaps, covariance = _predicted(result, readings, rows)
            expected = np.sqrt(np.diag(covariance))
            parts.append((readings.rows(rows), number[rows], place, told, gaps, expected))
            alike = (covariance / np.outer(expected, expected))[np.ix_(told, told)]
            worth.append((float(told.sum()), float(np.sum(alike**2)), result.dof))
    if not parts:
        raise TangoError(
            f"held out: every facet of indexations {groups} is touched there alone ({', '.join(sorted(lost))}); hold out fewer"
        )
    return HeldOut(
        groups,
        np.concatenate([p[0].touch for p in parts]),
        tuple(f for p in parts for f in p[0].facet),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([np.full(len(p[1]), p[2]) for p in parts]),
        np.concatenate([p[4] for p in parts]),
        np.concatenate([p[5] for p in parts]),
        np.concatenate([p[3] for p in parts]),
        np.concatenate(fitted),
        tuple(f for f in artefact.facets if f in lost),
        tuple(unseen),
        _chance(worth),
        tuple(skipped),
    )


def _chance(worth: Sequence[tuple[float, float, int]]) -> float:
    """of each group: touches predicted, sum of their squared correlations, degrees of freedom of its estimate → `HeldOut.chance`.

    The touches of a group are off together, by what its estimate is off: they count for as many as have the same variance of the
    mean square (Satterthwaite 1946). Every touch serves in the predictions of the other groups, so that groups are off together,
    too: they count for half of that, as simulated runs of short plans have it. The scatter that they are compared with comes from
    few touches: F distribution.
    """
    touches, squares = sum(w[0] for w in worth), sum(w[1] for w in worth)
    if not touches:
        return 0.0
    dof = sum(w[2] for w in worth) / len(worth)
    return float(special.fdtri(touches**2 / squares / TOGETHER, max(dof, 1.0), 1 - SELDOM) ** 0.5)


def _told(whole: Model, few: Model, used: NDArray[np.int64], rows: NDArray[np.int64], out: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """model of all touches, of those left, rows of all (n,), of those to predict (m,), mask of the group → (m,) `HeldOut.told`.

    What the touches left cannot tell apart counts there as something else, D = K W. It does the same to a touch of the group, or
    the group alone knows of it.
    """
    known = set(few.names)
    gone = [j for j, c in enumerate(whole.coefficients) if c.name not in known]
    if not gone:
        return np.ones(len(rows), dtype=np.bool_)
    start = np.zeros(len(whole.names))
    _, jacobian = linearise(whole, start)
    jacobian = jacobian / np.where((size := np.sqrt(np.mean(jacobian**2, axis=0))) > 0, size, 1.0)
    kept = [j for j, name in enumerate(whole.names) if name in known]
    left, own = jacobian[~out[used]], jacobian[np.searchsorted(used, rows)]
    weights = np.linalg.lstsq(left[:, kept], left[:, gone], rcond=1e-9)[0]
    return np.asarray((np.abs(own[:, gone] - own[:, kept] @ weights) < SAME).all(axis=1))


def _whole_balls(artefact: Artefact, readings: Readings, left: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """→ (n,) mask without the balls of which what is left does not fix the centre (three facets at least)."""
    ball = [artefact.facets[f].ball for f in readings.facet]
    facets: dict[str, set[str]] = {b: set() for b in ball if b is not None}
    for i in np.flatnonzero(left & readings.ok):
        if (own := ball[i]) is not None:
            facets[own].add(readings.facet[i])
    return np.array([b is None or len(facets[b]) >= 3 for b in ball], dtype=np.bool_)


def predict(result: Estimate, readings: Readings, rows: NDArray[np.int64]) -> tuple[Array, Array]:
    """estimate, all readings, rows (m,) of touches to predict → their gaps (m,) mm, their standard deviations to expect (m,) mm.

    All readings are needed for terms that remember what came before. Variance of a prediction: J C Jᵀ + σ² (GUM 5.2.2).
    Raises InputError for a facet that the estimate does not know.
    """
    gaps, covariance = _predicted(result, readings, rows)
    return gaps, np.sqrt(np.diag(covariance))


def _predicted(result: Estimate, readings: Readings, rows: NDArray[np.int64]) -> tuple[Array, Array]:
    """as `predict` → gaps (m,) mm, covariance (m, m) mm² of these predictions."""
    model = result.model
    touches = from_readings(model.touches.machine, model.touches.artefact, readings)
    everything = Model(touches, model.coefficients)
    place = {name: i for i, name in enumerate(model.names)}
    values = np.array([result.values[place[name]] if name in place else 0.0 for name in everything.names])
    gaps, jacobian = linearise(everything, values)
    among = np.cumsum(readings.ok) - 1
    gaps, jacobian = gaps[among[rows]], jacobian[among[rows]]
    unknown = [j for j, name in enumerate(everything.names) if name not in place]
    if np.any(jacobian[:, unknown]):
        raise InputError("prediction: found touches on facets that the estimate has not touched; allowed: facets that it knows")
    here = [j for j, name in enumerate(everything.names) if name in place]
    index = [place[everything.names[j]] for j in here]
    own = jacobian[:, here]
    return gaps, own @ result.covariance[np.ix_(index, index)] @ own.T + result.sigma**2 * np.eye(len(own))


def in_words(readings: Readings, machine: Machine, group: Sequence[int]) -> str:
    """readings, indexation numbers → where they are: `3 (B 90 C −270), …` in degrees."""
    number = indexations(readings, machine)
    degrees = readings.position / degrees_of(machine)
    names = [name for name in (*machine.rotary, "S")]

    def one(i: int) -> str:
        row = degrees[np.flatnonzero(number == i)[0]]
        return f"{i} ({' '.join(f'{name}{row[machine.column(name)]:.0f}' for name in names)})"

    return ", ".join(one(i) for i in group)
