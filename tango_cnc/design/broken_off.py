"""The order of the indexations of a plan that is made: a run that is broken off is to have determined what its time allows.

The search chooses touches for the whole time, in an order that is short. Which indexations come first decides what a part of the
run is worth: of one order three quarters determine all errors, of another one they leave one free. Here the visits of the plan are
put into another order, judged by what can be estimated of the touches made by then. The whole plan may lose `LOSS` by it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from ..plan import attempt
from ..records import Array, Cell, Indexation, InputError
from . import order
from .criterion import value
from .enough import believed, determined, serves
from .in_a_row import POWER, smooth, stays, without_each
from .on_the_way import on_the_way, visits_of
from .problem import Chosen, Problem
from .proving import beginnings
from .relaxed import Rows
from .senses import of_order
from .sequence import DRIFT, FRACTIONS
from .spare import state_of
from .timed import broken_off, judged
from .visits import again_at_the_end
from .ways import LONG

LOSS = 0.03  # of the standard uncertainty of the whole plan
WHOLE = (1.5, 4.0)  # times ln φ of the whole plan counts, beside that of each part: both are tried
DEAR = 2.0  # part of ln φ that goes by the logarithm of the time
ROUNDS = 3
STARTS = 3  # orders at random, besides that of the plan
FEW = 12  # visits; with more of them the order of the plan alone is made better
TRIMS = 4


@dataclass
class Parts:
    """A plan whose visits can be put into any order: what each tells, from whichever side axes come, and how long it takes."""

    found: Chosen
    problem: Problem  # with single touches
    visits: list[Indexation]
    poses: list[int]
    touches: list[Rows]  # candidates touched at each visit, as often as they are
    times: Array  # (m, m) s of turns
    first: list[bool]  # whether the run may begin there

    @classmethod
    def of(cls, found: Chosen) -> Parts:
        """plan → its parts."""
        problem = found.problem.in_a_row(1)
        choice, visits = problem.choice, visits_of(found)
        number = {tuple(sorted(i.position.items())): j for j, i in enumerate(choice.cell.strategy.indexations)}
        poses = [number[tuple(sorted(i.position.items()))] for i in visits]
        place = [{choice.facet[i]: int(i) for i in choice.of_pose[j]} for j in poses]
        touches = [np.array([own[f] for f in i.facets]) for own, i in zip(place, visits, strict=True)]
        single = [replace(i, facets=i.facets[:1]) for i in visits]
        known = problem.ways
        times, _ = order.turns(choice.cell, single, problem.feed, known.seen(poses), known.looked)
        if choice.cell.machine.obstacles:
            times = known.remembered(poses, times)
        times, _ = known.priced(poses, times, problem.repeats > 0)
        begin = [[bool(one[own].any()) for own in touches] for one in beginnings(choice, problem.gate)]
        proves = next((first for first in begin if any(first)), [True] * len(touches))
        return cls(found, problem, visits, poses, touches, np.nan_to_num(times, nan=LONG), proves)

    @cached_property
    def since(self) -> list[Array]:
        """→ of each visit, s from its first touch to each of its touches."""
        at = np.array([touch.indexation for touch in self.found.plan.touches])
        return [self.found.time[at == v] - self.found.time[at == v][0] for v in range(len(self.visits))]

    @cached_property
    def turn(self) -> float:
        """→ s that a turn takes longer than `times` says: one touch, and what lies between facets that are not the first ones."""
        as_made = list(range(len(self.visits)))
        last = int(np.flatnonzero(np.array([t.indexation for t in self.found.plan.touches]) == as_made[-1])[-1])
        taken = float(self.found.time[last] - self.found.time[0]) - sum(own[-1] for own in self.since)
        return (taken - order.length(as_made, self.times)) / max(len(as_made) - 1, 1)

    @cached_property
    def _told(self) -> dict[tuple[int, bytes], tuple[Array, Array]]:
        return {}

    def _tells(self, visit: int, sense: Array) -> tuple[Array, Array]:
        """visit, (a,) senses → (n, p) rows, (p, p) information of its touches when the axes come so."""
        key = visit, sense.tobytes()
        if key not in self._told:
            assert self.problem.senses is not None
            rows = self.problem.senses.rows(self.problem.choice.rows, self.touches[visit], sense)
            self._told[key] = rows, rows.T @ rows
        return self._told[key]

    def known(self, way: Sequence[int], parts: Sequence[float]) -> tuple[list[Array], float]:
        """visits in their order, parts of the time → (p, p) information after each of these parts and of all visits; s of all."""
        choice, senses = self.problem.choice, self.problem.senses
        assert senses is not None
        came = of_order(choice, senses, [self.poses[i] for i in way])
        ends = [part * self.found.seconds for part in parts]
        known, now, found = choice.held, float(self.found.time[0]), list[Array]()
        for n, (visit, sense) in enumerate(zip(way, came, strict=True)):
            now += self.times[way[n - 1], visit] + self.turn if n else 0.0
            rows, own = self._tells(visit, sense)
            while len(found) < len(ends) and ends[len(found)] < now + self.since[visit][-1]:
                few = rows[: int(np.searchsorted(self.since[visit], ends[len(found)] - now, side="right"))]
                found.append(known + few.T @ few)
            known, now = known + own, now + self.since[visit][-1]
        return [*found, *[known] * (len(ends) + 1 - len(found))], now

    def worth(self, way: Sequence[int], parts: Sequence[float]) -> tuple[Array, float]:
        """visits in their order, parts of the time → (k + 1,) φ after each of these parts and of all visits; s of all."""
        known, seconds = self.known(way, parts)
        return np.array([value(self.problem.criterion, each) for each in known]), seconds

    def late(self, way: Sequence[int]) -> float:
        """visits in their order → correlation of time with the position of an axis beyond `DRIFT`."""
        names = self.problem.choice.cell.machine.rotary
        position = np.array([[self.visits[i].position[name] for name in names] for i in way]).reshape(len(way), len(names))
        count = [len(self.touches[i]) for i in way]
        at = np.repeat(position, count, axis=0)
        return max(0.0, order.runs_with_time(at, np.arange(len(at), dtype=float)) - DRIFT)

    def ordered(self, parts: Sequence[float], begin: list[int], weight: float = WHOLE[-1]) -> list[int]:
        """parts of the time that count, an order, weight of the whole → a better order."""
        usual, lasts = self.worth(begin, ())
        late = self.late(begin)

        @cache
        def known(way: tuple[int, ...]) -> float:
            if not self.first[way[0]] or order.length(way, self.times) >= LONG:
                return np.inf
            phi, seconds = self.worth(way, parts)
            lost = float(np.log(phi[-1] / usual[-1])) + DEAR * float(np.log(seconds / lasts))
            more = max(0.0, self.late(way) - late)
            return float(np.log(phi[:-1]).sum()) + weight * (lost + 10 * max(0.0, lost - 1.5 * LOSS) + more)

        def cost(way: list[int]) -> float:
            return known(tuple(way))

        rng = np.random.default_rng(len(begin))
        more_starts = STARTS if len(begin) <= FEW else 0
        starts = [begin, *(rng.permutation(len(begin)).tolist() for _ in range(more_starts))]
        found = [order.improved(start, cost, ROUNDS) for start in starts if np.isfinite(cost(start))]
        return min(found, key=cost) if found else begin

    def made(self, way: Sequence[int], again: float) -> Chosen | None:
        """visits in their order, s of one more touch in a row → the plan, with fewer touches where it takes too long.

        None where it has no safe way.
        """
        problem, choice = self.problem, self.problem.choice
        indexations = [self.visits[i] for i in way]
        if problem.repeats and len(way) > 1:
            mask = np.zeros(len(choice.rows), dtype=bool)
            mask[np.concatenate([self.touches[i] for i in way])] = True
            once = replace(indexations[0], facets=tuple(dict.fromkeys(indexations[0].facets)))
            indexations.append(again_at_the_end(problem, mask, self.poses[way[0]], once))
        cell = replace(self.found.cell, strategy=replace(self.found.cell.strategy, indexations=tuple(indexations)))
        return fitted(cell, problem, again)


def worth_when_broken_off(found: Chosen, again: float, loss: float = LOSS) -> Chosen:
    """plan, s of one more touch in a row, what the whole plan may lose → its visits in the order whose parts are worth most."""
    problem = found.problem
    if problem.criterion.determinant or problem.choice.twice or problem.senses is None or len(visits_of(found)) < 3:
        return found
    problem.say(f"a plan of {problem.seconds / 60:.1f} min: which indexations come first")
    parts, best, tried = Parts.of(found), found, {tuple(range(len(visits_of(found))))}
    for weight in WHOLE:
        way = _way(parts, weight)
        if tuple(way) in tried:
            continue
        tried.add(tuple(way))
        with suppress(InputError):  # nothing left that proves the probe
            made = parts.made(way, again)
            for other in [] if made is None else [made, on_the_way(made, again)]:
                if other.value <= found.value * (1 + loss) ** 2 and stands(other, found) and _better(other, best):
                    best = other
    return best


def _way(parts: Parts, weight: float) -> list[int]:
    """parts, weight of the whole → order of the visits by which the longest parts that determine the goal are worth most."""
    way, counted = list(range(len(parts.visits))), list[float]()
    for part in reversed(FRACTIONS):
        tried = parts.ordered([part, *counted], way, weight)
        if not determined(parts.problem, parts.known(tried, [part])[0][0]):
            break
        way, counted = tried, [part, *counted]
    return way


def stands(one: Chosen, other: Chosen) -> bool:
    """→ whether a plan is worth making, if another one is."""
    return serves(one.problem, one.information) and (believed(one) or not believed(other))


def _better(one: Chosen, other: Chosen) -> bool:
    """→ whether the parts of a plan are worth more than those of another one."""
    first, second = broken_off(one), broken_off(other)
    if np.isfinite(first).sum() != np.isfinite(second).sum():
        return bool(np.isfinite(first).sum() > np.isfinite(second).sum())
    both = np.isfinite(first) & np.isfinite(second)
    return bool(np.log(first[both]).sum() < np.log(second[both]).sum())


def fitted(cell: Cell, problem: Problem, again: float, begin: int = 0) -> Chosen | None:
    """cell with a strategy, its problem, s of one more touch in a row, first visits that stay → the plan, as short as the time asks
    for; None where it cannot be made.
    """
    for _ in range(TRIMS):
        planned, faults = attempt(cell, "leave-out", problem.ways.looked)
        if faults:
            return None
        made = judged(problem, cell, planned)
        if made.seconds <= problem.seconds:
            return made
        cell = shorter(made, made.seconds - problem.seconds, again, begin)
    return None


def shorter(found: Chosen, over: float, again: float, first: int = 0) -> Cell:
    """plan, s that it takes too long, s of one more in a row, first visits that stay → cell without what tells least."""
    criterion, keys = found.problem.criterion, [(t.indexation, t.facet) for t in found.plan.touches]
    left, seconds = Counter(keys), max(again, found.costs[0] * len(keys) / len(set(keys)) - again)
    state, now = state_of(criterion, found.information), smooth(criterion, found.information)
    out = set[int]()
    while over > 0:
        some = [n for n, key in enumerate(keys) if n not in out and key[0] >= first and (left[key] > 1 or not stays(found, key))]
        if not some:
            break
        lost = without_each(criterion, state, now, found.rows[some], POWER)
        dear = np.array([again if left[keys[n]] > 1 else seconds for n in some])
        n = some[int(np.argmin((lost - now) / dear))]
        over -= again if left[keys[n]] > 1 else seconds
        now = float(lost[some.index(n)])
        state.change(found.rows[n], -1)
        out.add(n)
        left[keys[n]] -= 1
    facets: list[list[str]] = [[] for _ in found.cell.strategy.indexations]
    for n, (number, facet) in enumerate(keys):
        if n not in out:
            facets[number].append(facet)
    made = zip(found.cell.strategy.indexations, facets, strict=True)
    return replace(
        found.cell, strategy=replace(found.cell.strategy, indexations=tuple(replace(i, facets=tuple(f)) for i, f in made))
    )
