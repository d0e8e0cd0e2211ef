"""Time that a plan leaves over goes into facets that are touched once more while the probe is there: a second each.

Too little for another facet with its way is enough for several of these. Each goes to where it makes the plan best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..plan import plan
from ..records import Array, Indexation
from .criterion import Criterion, State, value
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
        made = judged(problem, cell, plan(cell, "leave-out"))
        if made.seconds <= problem.seconds:
            return min(made, found, key=lambda each: each.value)
        left -= max(made.seconds - problem.seconds, again)
    return found


def _more(found: Chosen, count: int) -> tuple[Indexation, ...]:
    """plan, how many touches more → its indexations with them."""
    place = {(touch.indexation, touch.facet): n for n, touch in enumerate(found.plan.touches)}
    keys, rows = list(place), found.rows[list(place.values())]
    information, facets = found.information, [list(i.facets) for i in found.cell.strategy.indexations]
    for _ in range(count):
        best = int(np.argmin(with_each(found.problem.criterion, information, rows)))
        information = information + np.outer(rows[best], rows[best])
        number, facet = keys[best]
        facets[number].insert(facets[number].index(facet), facet)
    return tuple(_of(i, own) for i, own in zip(found.cell.strategy.indexations, facets, strict=True))


def _of(indexation: Indexation, facets: Sequence[str]) -> Indexation:
    return replace(indexation, facets=tuple(facets))


def with_each(criterion: Criterion, information: Array, rows: Array) -> Array:
    """criterion, A (p, p), (n, p) touches → (n,) φ with each of them besides."""
    if criterion.worst is None:
        state = State.of(criterion, information)
        return np.asarray(value(criterion, information) - state.benefit(*state.seen(rows)))
    covariance = np.linalg.inv(information)
    aims = criterion.worst @ covariance
    now = np.einsum("kp,kp->k", aims, criterion.worst)
    leverage = np.einsum("np,np->n", rows @ covariance, rows)
    return np.asarray((now[:, None] - (aims @ rows.T) ** 2 / (1 + leverage)).max(axis=0))
