"""A bound on what any choice of touches at the indexations of a plan could reach, in the order in which the plan turns to them.

Theory of operation. Every turn is made and paid for; T seconds are left for touches of c seconds each, every facet at most once at
each visit. Touches by the fraction, 0 ≤ w ≤ 1, hold all such plans. φ is convex in w. Its gradient is −g (`criterion.State`), and

    K = max Σ v g   over   0 ≤ v ≤ 1,  Σ v c ≤ T

is reached by the touches of largest g / c, the last one in part (Dantzig 1957). So Σ g over the touches of any such plan is at most
K, and `relaxed.below` makes of K − Σ w g a bound on φ, at any w. Weights follow by the multiplicative algorithm, none above 1.

`relaxed.relax` bounds plans that may turn by the fraction as well: what lies between both bounds is what whole turns cost.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from ..records import Array
from .criterion import Criterion, State, parts, value
from .problem import Chosen
from .relaxed import POWER, SETTLED, below
from .senses import of_order

STEPS = 150
HALVINGS = 60  # of the factor that makes weights take the time there is


def bound_here(rows: Array, held: Array, touch: Array, seconds: float, criterion: Criterion, most: float = 1.0) -> float:
    """(n, p) touches, (p, p) known without them, (n,) s of each, s for all of them, criterion → bound on φ.

    `most`: how often each is made at most.
    """
    root = most**0.5
    rows, touch = rows * root, touch * most
    weight = np.full(len(rows), min(1.0, seconds / float(touch.sum())))
    many = None if criterion.worst is None else np.full(len(criterion.worst), 1 / len(criterion.worst))
    here, lowest = criterion, -np.inf
    for _ in range(STEPS):
        information = held + (rows.T * weight) @ rows
        if many is not None:
            many = many * parts(criterion, information) ** POWER
            many /= many.sum()
            here = criterion.with_weights(many)
        gradient = State.of(here, information).slope(rows)
        now = value(Criterion(here.name, here.spread), information)
        excess = _most(gradient, touch, seconds) - float(weight @ gradient)
        lowest = max(lowest, below(here, now, excess))
        worst = now if many is None else value(criterion, information)
        if worst - lowest < SETTLED * (len(held) if here.determinant else abs(worst)):
            break
        weight = weight * (np.maximum(gradient, 0.0) / touch) ** POWER
        if not weight.any():  # no touch here tells anything of it
            break
        weight = _within(weight, touch, seconds)
    return lowest


def certified_here(found: Chosen) -> float:
    """plan → bound on φ of every choice of touches at its indexations in its order, for what touches and turns take in it.

    No facet is touched more often in a row than the plan does.
    """
    problem, choice = found.problem, found.problem.choice
    number = {tuple(sorted(i.position.items())): j for j, i in enumerate(choice.cell.strategy.indexations)}
    visits = [number[tuple(sorted(i.position.items()))] for i in found.cell.strategy.indexations]
    own = [choice.of_pose[j] for j in visits]
    if problem.senses is None:
        rows = choice.rows[np.concatenate(own)]
    else:
        came = of_order(choice, problem.senses, visits)
        rows = np.vstack([problem.senses.rows(choice.rows, some, sense) for some, sense in zip(own, came, strict=True)])
    touch, spent = found.costs[0], found.costs[0] * len(found.rows) / problem.times
    spare = max(problem.seconds - found.seconds, 0.0)
    most = most_in_a_row(found) / problem.times
    return bound_here(rows, problem.held, np.full(len(rows), touch), spent + spare, problem.criterion, most)


def most_in_a_row(found: Chosen) -> int:
    """plan → how often it touches a facet at one indexation, at most."""
    return max(Counter((each.indexation, each.facet) for each in found.plan.touches).values())


def _most(gradient: Array, touch: Array, seconds: float) -> float:
    """(n,) g, (n,) s, s → K."""
    first = np.argsort(-gradient / touch, kind="stable")
    share = np.clip((seconds - np.cumsum(touch[first])) / touch[first] + 1, 0.0, 1.0)
    return float(share @ gradient[first])


def _within(weight: Array, touch: Array, seconds: float) -> Array:
    """(n,) weights → the same times a factor, none above 1, that take these seconds; all 1 where all of them take less."""
    if touch.sum() <= seconds:
        return np.ones(len(weight))
    low, high = 0.0, seconds / float(weight @ touch)
    while float(np.minimum(high * weight, 1.0) @ touch) < seconds and (weight[weight > 0] * high < 1).any():
        high *= 2
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if float(np.minimum(middle * weight, 1.0) @ touch) < seconds else (low, middle)
    return np.asarray(np.minimum(high * weight, 1.0))
