"""The order of facets and of indexations: by the real times of the machine, and by what a part of the run is worth.

The travelling salesman's way is shortest; but a run that is broken off should have told nearly as much as its time allows, and time
and pose must not run together, or drift would look like an error motion. So indexations come in the order in which each adds
most for its time, and exchanges that save time are made where they leave that worth.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import check, kinematics
from ..duration import DEFAULT_ACCELERATION, DEFAULT_RAPID, of_moves, trapezoid
from ..plan import attempt, plan
from ..plan.travel import Roof, Travels
from ..records import Array, Cell, Indexation, InputError, Machine, Strategy

Rows = NDArray[np.int64]
Turning = tuple[int, int]  # from one visit to another
Known = dict[tuple[object, ...], NDArray[Any]]  # indexation, approach and facets: s from each to each, or a way
LEG = 1e-9
TOUCHING = ("probe", "find", "off", "near", "back")  # the moves of a touch itself


class Legs:
    """Times between facets of one indexation: up, over and down, as the planner goes and the machine moves."""

    def __init__(self, cell: Cell, feed: float | None, known: Known | None = None) -> None:
        """cell, mm/min of protected moves, what is known of the same machine and table at this feed."""
        machine = cell.machine
        self._known: Known = {} if known is None else known
        self._cell, self._chain = cell, kinematics.chain(machine)
        self._roof = Roof(check.solid(cell.artefact), machine.probe)
        linear = [machine.axis(name) for name in machine.linear]
        self._speed = (feed or min(axis.rapid or DEFAULT_RAPID["linear"] for axis in linear)) / 60
        self._slowest = 1000 * min(axis.acceleration or DEFAULT_ACCELERATION["linear"] for axis in linear)
        self._probe = cell.strategy.approach

    def between(self, position: dict[str, float], facets: Sequence[str]) -> Array:
        """indexation (rad), m facets → (m, m) s from stand-off to stand-off; worked out once."""
        key = *sorted(position.items()), self._probe, *facets
        if key not in self._known:
            self._known[key] = self._between(position, facets)
        return self._known[key]

    def way(self, position: dict[str, float], facets: Sequence[str]) -> list[str]:
        """indexation (rad), m facets → these in the order of a short way through all."""
        key = "way", *sorted(position.items()), self._probe, *facets
        if key not in self._known:
            self._known[key] = np.array(path(self.between(position, facets)), dtype=int)
        return [facets[i] for i in self._known[key].tolist()]

    def _between(self, position: dict[str, float], facets: Sequence[str]) -> Array:
        machine, standoff = self._cell.machine, self._probe.standoff
        at = np.array([[position.get(name, 0.0) for name in machine.names]])
        up = kinematics.spindle_axis(self._chain, at)[0]
        known = [self._cell.artefact.facets[f] for f in facets]
        tip = np.array([np.array(f.point) + (machine.probe.tip_radius + standoff) * np.array(f.normal) for f in known])
        m = len(facets)
        start, end = np.repeat(tip, m, axis=0), np.tile(tip, (m, 1))
        rise, fall = self._roof.lifts(Travels(start, end, np.tile(up, (m * m, 1))), np.full(m * m, np.inf))
        over = np.linalg.norm(end + fall[:, None] * up - start - rise[:, None] * up, axis=1)
        times = sum(self._time(way) for way in (rise, over, fall))
        return np.asarray(times).reshape(m, m)

    def _time(self, way: Array) -> Array:
        reached = way * self._slowest >= self._speed**2
        return np.where(reached, way / self._speed + self._speed / self._slowest, 2 * np.sqrt(np.maximum(way, 0) / self._slowest))


def path(times: Array) -> list[int]:
    """(m, m) s → order of the m places with a short way through all: nearest neighbour, then 2-opt and moves of single places."""
    m = len(times)
    if m < 3:
        return list(range(m))
    best: list[int] = []
    for start in range(m):
        left, order = set(range(m)) - {start}, [start]
        while left:
            order.append(min(left, key=lambda k: times[order[-1], k]))
            left.remove(order[-1])
        if not best or length(order, times) < length(best, times) - LEG:
            best = order
    return improved(best, lambda order: length(order, times))


def improved(order: list[int], cost: Callable[[list[int]], float], rounds: int = 10) -> list[int]:
    """order, its cost → the order after reversals and moves of one place, each of which lowers the cost."""
    here = cost(order)
    for _ in range(rounds):
        before = here
        for i in range(len(order)):
            for k in range(len(order)):
                if k == i:
                    continue
                moved = order[:i] + order[i + 1 :]
                moved.insert(k, order[i])
                tries = [moved]
                if k > i + 1:
                    tries.append([*order[:i], *reversed(order[i : k + 1]), *order[k + 1 :]])
                for other in tries:
                    if (new := cost(other)) < here - LEG:
                        order, here = other, new
        if here > before - LEG:
            break
    return order


def length(order: Sequence[int], times: Array) -> float:
    """order, (m, m) s → s from the first place to the last one."""
    return float(times[list(order[:-1]), list(order[1:])].sum())


def turning(machine: Machine, one: dict[str, float], other: dict[str, float]) -> float:
    """machine, two indexations (rad) → s that the rotary axes and the spindle take, one after the other."""
    total = 0.0
    for name in (*machine.rotary, "S"):
        axis, way = machine.axis(name), abs(one.get(name, 0.0) - other.get(name, 0.0))
        if way > LEG:
            speed = (axis.rapid or DEFAULT_RAPID[axis.kind]) / 60
            total += axis.clamp_time + trapezoid(way, speed, axis.acceleration or DEFAULT_ACCELERATION[axis.kind])
    return total


def turns(
    cell: Cell,
    visits: Sequence[Indexation],
    feed: float | None,
    closed: Collection[Turning] = (),
    looked: dict[tuple[object, ...], bool] | None = None,
) -> tuple[Array, dict[Turning, str]]:
    """cell, m visits, mm/min of protected moves → (m, m) s from a touch at one to a touch at the other; turns that are impossible.

    One touch each, and a tour that makes every turn once: planned as any plan is, with its ways up and down. What is not
    possible one way is tried the other way. `closed`: turns of which that is known; times are NaN where both ways are.
    """
    m = len(visits)
    if m < 2:
        return np.zeros((m, m)), {}
    times, faults = np.full((m, m), np.nan), dict[Turning, str]()
    single = [replace(i, facets=i.facets[:1]) for i in visits]
    for tour in (_walk(m, closed) if closed else _tour(m), None):
        tour = [i for one, other in faults for i in (other, one)] if tour is None else tour
        if len(tour) < 2:
            break
        strategy = Strategy("every turn", cell.strategy.approach, tuple(single[i] for i in tour))
        made, found = attempt(replace(cell, strategy=strategy), "leave-out", looked, turns_alone=True)
        spent, number = np.zeros(len(tour) + 1), 0
        for move, seconds in zip(made.moves, of_moves(made, feed), strict=True):
            if move.kind == "probe":
                number += 1
            elif move.kind not in TOUCHING:
                spent[number] += seconds
        times = _filled(times, tour, spent)
        faults |= {(tour[n - 2], tour[n - 1]): why for n, why in found.items() if 1 < n <= len(tour)}
    return times, faults


def again(cell: Cell, feed: float | None) -> float:
    """cell, mm/min of protected moves → s that one more touch of the facet takes that has just been touched."""
    for indexation in cell.strategy.indexations:
        with suppress(InputError):
            once, twice = (_lasts(cell, replace(indexation, facets=indexation.facets[:1] * n), feed) for n in (2, 3))
            return twice - once
    return 0.0


def _lasts(cell: Cell, visit: Indexation, feed: float | None) -> float:
    made = plan(replace(cell, strategy=replace(cell.strategy, indexations=(visit,))), "leave-out")
    return sum(of_moves(made, feed))


def _filled(times: Array, tour: Sequence[int], spent: Array) -> Array:
    """spent: (k + 1,) s, the way to the first touch, then after each touch that to the next → (m, m)."""
    for number, (i, k) in enumerate(pairwise(tour), 1):
        times[i, k] = times[k, i] = spent[number]
    np.fill_diagonal(times, 0.0)
    return times


def _tour(count: int) -> list[int]:
    """→ a sequence of 0 … count − 1 in which every two of them come one after the other at least once (Hierholzer 1873)."""
    left = {(i, k) for i in range(count) for k in range(i + 1, count)}
    extra = [] if count % 2 else [(i, i + 1) for i in range(0, count, 2)]  # every place needs an even number of ways
    ways: dict[int, list[int]] = {i: [] for i in range(count)}
    for i, k in [*sorted(left), *extra]:
        ways[i].append(k)
        ways[k].append(i)
    stack, tour = [0], []
    while stack:
        here = stack[-1]
        if ways[here]:
            there = ways[here].pop()
            ways[there].remove(here)
            stack.append(there)
        else:
            tour.append(stack.pop())
    return tour


def _walk(count: int, closed: Collection[Turning]) -> list[int]:
    """→ a sequence in which every two places come one after the other at least once in a direction that is not closed."""
    left = {(i, k) for i in range(count) for k in range(i + 1, count) if (i, k) not in closed or (k, i) not in closed}
    walk: list[int] = []
    while left:
        here = walk[-1] if walk else -1
        ways = [(one, other) for pair in sorted(left) for one, other in (pair, pair[::-1]) if (one, other) not in closed]
        one, other = next((way for way in ways if way[0] == here), ways[0])
        walk += [other] if one == here else [one, other]
        left.discard((min(one, other), max(one, other)))
    return walk


def runs_with_time(position: Array, time: Array) -> float:
    """(n, k) axis positions, (n,) s → largest correlation of time with the position of an axis, 0 … 1."""
    found = 0.0
    for column in position.T:
        if np.ptp(column) > 1e-6 and np.ptp(time) > 0:
            found = max(found, abs(float(np.corrcoef(column, time)[0, 1])))
    return found
