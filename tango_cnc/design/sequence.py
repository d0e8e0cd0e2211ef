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
from .ways import LONG, reason

SIDES = 0.5  # part of φ that an order may save by from where axes come, at most
EARLY = 0.15  # of the time that an order may cost in which a part of the run is worth e times as much
DRIFT = 0.3  # correlation of time with the position of an axis that is taken without asking for another order
FRACTIONS = (0.25, 0.5, 0.75)
Mask = NDArray[np.bool_]


def sequence(problem: Problem, mask: Mask, visits: list[int], sides: bool = False) -> list[int]:
    """chosen touches → indexations in the order of the visits; without those that no safe way leads to, which are noted.

    `sides`: it may take longer where rotary axes then come from sides that tell more.
    """
    choice, known = problem.choice, problem.ways
    facets = [choice.facet[int(np.flatnonzero(mask & (choice.pose == j))[0])] for j in visits]
    single = [replace(choice.cell.strategy.indexations[j], facets=(f,)) for j, f in zip(visits, facets, strict=True)]
    times, faults = order.turns(choice.cell, single, problem.feed, known.seen(visits), known.looked)
    known.turns |= {(visits[i], visits[k]): reason(why) for (i, k), why in faults.items()}
    if choice.cell.machine.obstacles:
        times = known.remembered(visits, times)
    times, ends = known.priced(visits, times, problem.repeats > 0)
    left = list(range(len(visits)))
    while len(left) > 1:
        own, at = [visits[i] for i in left], np.ix_(left, left)
        way = _ordered(problem, mask, own, times[at], ends[left], sides)
        if _length(way, times[at], ends[left], problem.repeats > 0) < LONG:
            return [own[i] for i in way]
        worst = int(np.argmax((times[at] >= LONG).sum(axis=0) + (times[at] >= LONG).sum(axis=1) + (ends[left] > 0).sum(axis=1)))
        known.leave_out(visits[left.pop(worst)], own)
    return [visits[i] for i in left]


def _length(way: Sequence[int], times: Array, ends: Array, closed: bool) -> float:
    """→ s of an order; at least `LONG` where it holds a turn that is not possible."""
    back = times[way[-1], way[0]] if closed else 0.0
    return order.length(way, times) + ends[way[0], 0] + ends[way[-1], 1] + (back if back >= LONG else 0.0)


def _ordered(problem: Problem, mask: Mask, visits: list[int], times: Array, ends: Array, sides: bool) -> list[int]:
    """chosen touches, visits, (m, m) s, (m, 2) s of being first and last → their order."""
    choice, closed = problem.choice, problem.repeats > 0
    indexations = [choice.cell.strategy.indexations[j] for j in visits]
    own = [choice.rows[mask & (choice.pose == j)] for j in visits]
    ways = [_greedy(problem, own, times), order.path(times)]

    best_worth, least, whole = _worth(problem, ways[0], own), np.inf, _whole(problem, mask, visits)
    usual = whole(ways[0]) if sides else 0.0
    rest = problem.seconds - order.length(ways[1], times)

    def cost(way: list[int]) -> float:
        nonlocal least
        long = _length(way, times, ends, closed) * (1 + _late(problem, way, own, indexations))
        if sides and usual > 0 and long < least * (1 + SIDES):
            # What all of it tells goes by from where axes come; twice the variance is worth twice the time of the run.
            long += max(rest, 0.0) * float(np.clip(whole(way) / usual - 1, -SIDES, 1 / SIDES))
        if long < least:  # what a part of it is worth takes longer to find out than how long it takes
            lost = float(np.maximum(np.log(_worth(problem, way, own) / best_worth) / 2, 0.0).mean())
            least = min(least, long := long * (1 + EARLY * lost))
        return long

    return order.improved(min(ways, key=cost), cost, rounds=3)


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
