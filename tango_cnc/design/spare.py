"""Time that a plan leaves over goes into facets that are touched once more while the probe is there: a second each.

Too little for another facet with its way is enough for several of these. Each goes to where it makes the plan best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..plan import attempt
from ..records import Array, Indexation
from .criterion import Criterion, State
from .problem import Chosen
from .timed import judged

TRIES = 3


def used_up(found: Chosen, again: float) -> Chosen:
    """plan, s of one more touch of the facet that has just been touched → the plan with as many of these as fit into its time."""
    problem = found.problem
    left = problem.seconds - found.seconds
    for _ in range(TRIES):
        count = int(left / again) if again > 0 else 0
        if count < 1:
            break
        strategy = replace(found.cell.strategy, indexations=_more(found, count))
        cell = replace(found.cell, strategy=strategy)
        planned, faults = attempt(cell, "leave-out", problem.ways.looked)
        if faults:
            break
        made = judged(problem, cell, planned)
        if made.seconds <= problem.seconds:
            return min(made, found, key=lambda each: each.value)
        left -= max(made.seconds - problem.seconds, again)
    return found


def _more(found: Chosen, count: int) -> tuple[Indexation, ...]:
    """plan, how many touches more → its indexations with them."""
    place = {(touch.indexation, touch.facet): n for n, touch in enumerate(found.plan.touches)}
    keys, rows = list(place), found.rows[list(place.values())]
    criterion, facets = found.problem.criterion, [list(i.facets) for i in found.cell.strategy.indexations]
    state, now = state_of(criterion, found.information), found.value
    for _ in range(count):
        worth = with_each(criterion, state, now, rows)
        best = int(np.argmin(worth))
        now = float(worth[best])
        state.change(rows[best], 1)
        number, facet = keys[best]
        facets[number].insert(facets[number].index(facet), facet)
    return tuple(_of(i, own) for i, own in zip(found.cell.strategy.indexations, facets, strict=True))


def _of(indexation: Indexation, facets: Sequence[str]) -> Indexation:
    return replace(indexation, facets=tuple(facets))


def state_of(criterion: Criterion, information: Array) -> State:
    """criterion, A (p, p) → state that follows touches one by one; of the worst of many its covariance alone is used."""
    return State.of(Criterion(criterion.name) if criterion.worst is not None else criterion, information)


def with_each(criterion: Criterion, state: State, now: float, rows: Array, power: float = np.inf) -> Array:
    """criterion, state, its φ, (n, p) touches → (n,) φ with each of them besides; `power`: of the norm of the many."""
    if criterion.worst is None:
        return np.asarray(now - state.benefit(*state.seen(rows)))
    aims = criterion.worst @ state.covariance
    variance = np.einsum("kp,kp->k", aims, criterion.worst)
    leverage = np.einsum("np,np->n", rows @ state.covariance, rows)
    return norm(variance[:, None] - (aims @ rows.T) ** 2 / (1 + leverage), power)


def norm(variance: Array, power: float) -> Array:
    """(k, n) variances, power → (n,) their norm by that power: a smooth stand-in for the worst of many, never below it."""
    worst = variance.max(axis=0)
    if np.isinf(power):
        return np.asarray(worst)
    return np.asarray(worst * np.sum((np.maximum(variance, 0.0) / worst) ** power, axis=0) ** (1 / power))
