"""In which order the chosen indexations are visited: by the way, and by what a part of the run is worth.

A run that is broken off should have told nearly as much as its time allows, and time must not follow the position of an axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Indexation
from . import order
from .criterion import Criterion, State, value
from .problem import Problem, lighter
from .senses import of_order

SIDES = 0.5  # part of φ that an order may save by from where axes come, at most
EARLY = 0.15  # of the time that an order may cost in which a part of the run is worth e times as much
DRIFT = 0.3  # correlation of time with the position of an axis that is taken without asking for another order
FRACTIONS = (0.25, 0.5, 0.75)
Mask = NDArray[np.bool_]


def sequence(problem: Problem, mask: Mask, visits: list[int], sides: bool = False) -> list[int]:
    """chosen touches → indexations in the order in which they are visited.

    `sides`: it may take longer where rotary axes then come from sides that tell more.
    """
    choice = problem.choice
    indexations = [choice.cell.strategy.indexations[j] for j in visits]
    facets = [choice.facet[int(np.flatnonzero(mask & (choice.pose == j))[0])] for j in visits]
    single = [replace(i, facets=(f,)) for i, f in zip(indexations, facets, strict=True)]
    times = order.turns(choice.cell, single, problem.feed)
    own = [choice.rows[mask & (choice.pose == j)] for j in visits]
    ways = [_greedy(problem, own, times), order.path(times)]

    best_worth, least, whole = _worth(problem, ways[0], own), np.inf, _whole(problem, mask, visits)
    usual = whole(ways[0]) if sides else 0.0
    rest = problem.seconds - order.length(ways[1], times)

    def cost(way: list[int]) -> float:
        nonlocal least
        long = order.length(way, times) * (1 + _late(problem, way, own, indexations))
        if sides and usual > 0 and long < least * (1 + SIDES):
            # What all of it tells goes by from where axes come; twice the variance is worth twice the time of the run.
            long += max(rest, 0.0) * float(np.clip(whole(way) / usual - 1, -SIDES, 1 / SIDES))
        if long < least:  # what a part of it is worth takes longer to find out than how long it takes
            lost = float(np.maximum(np.log(_worth(problem, way, own) / best_worth) / 2, 0.0).mean())
            least = min(least, long := long * (1 + EARLY * lost))
        return long

    way = order.improved(min(ways, key=cost), cost, rounds=3)
    return [visits[i] for i in way]


def _whole(problem: Problem, mask: Mask, visits: list[int]) -> Callable[[Sequence[int]], float]:
    """chosen touches, visits → an order of these → φ when axes come as it makes them; of the determinant, its p-th root."""
    light = lighter(problem)
    choice, senses = light.choice, light.senses
    own = [np.flatnonzero(mask & (choice.pose == j)) for j in visits]

    def found(way: Sequence[int]) -> float:
        if senses is None or not len(senses.axes):
            return 1.0
        came = of_order(choice, senses, [visits[i] for i in way])
        rows = np.vstack([senses.rows(choice.rows, own[i], sense) for i, sense in zip(way, came, strict=True)])
        phi = value(light.criterion, light.held + rows.T @ rows)
        return float(np.exp(phi / len(light.held))) if light.criterion.determinant else phi

    return found


def _worth(problem: Problem, way: Sequence[int], own: Sequence[Array]) -> Array:
    """visits in their order → (3,) φ of what is known after `FRACTIONS` of them."""
    criterion, found = trace(problem.criterion), []
    for part in FRACTIONS:
        rows = np.vstack([own[i] for i in way[: max(1, round(part * len(way)))]])
        phi = value(criterion, problem.begin + rows.T @ rows)
        found.append(np.exp(2 * phi / len(problem.begin)) if criterion.determinant else phi)
    return np.array(found)


def _late(problem: Problem, sequence: Sequence[int], own: Sequence[Array], indexations: Sequence[Indexation]) -> float:
    """→ how much time runs together with the pose beyond `DRIFT`, as a share of the time that another order may cost."""
    names = problem.choice.cell.machine.rotary
    position = np.array([[indexations[i].position[name] for name in names] for i in sequence])
    count = np.array([len(own[i]) for i in sequence])
    at = np.repeat(position, count, axis=0)
    return max(0.0, order.runs_with_time(at, np.arange(len(at), dtype=float)) - DRIFT)


def _greedy(problem: Problem, own: Sequence[Array], times: Array) -> list[int]:
    """→ visits in the order in which each adds most for its time to what is known of a usual machine."""
    information = problem.begin
    state = State.of(trace(problem.criterion), information)
    left, sequence = set(range(len(own))), list[int]()
    while left:
        price = {i: len(own[i]) * 2.0 + (times[sequence[-1], i] if sequence else 0.0) for i in left}
        best = max(left, key=lambda i: state.block_benefit(own[i]) / price[i])
        sequence.append(best)
        left.remove(best)
        information = information + own[best].T @ own[best]
        state = State.of(trace(problem.criterion), information)
    return sequence


def trace(criterion: Criterion) -> Criterion:
    """criterion → the same; of the worst of many the mean."""
    if criterion.worst is None:
        return criterion
    return Criterion(criterion.name, criterion.worst.T @ criterion.worst / len(criterion.worst))
