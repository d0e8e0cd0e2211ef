"""Facets that lie on the way: touches exchanged at the indexations of a plan by what the way to each really takes.

The search for facets and indexations counts the same seconds for every facet. But from one facet to the next a probe takes less
than a second or five of them, by how far they are apart and how high the table stands between them. Here every facet has the price
of its way from the one before and to the one after. What tells least for its time is given up for what tells most, on the way or in
a row, as long as that makes the plan better. The planner then says what the new plan really takes.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..duration import of_moves
from ..plan import attempt
from ..records import Array, Indexation, InputError
from . import order
from .criterion import Criterion, parts, value
from .in_a_row import MOST, POWER, smooth, stays, without_each
from .problem import Chosen
from .relaxed import Rows
from .spare import state_of, with_each
from .timed import judged

ROUNDS = 60  # exchanges at most
TRIED = 10  # of what could be given up is tried, what tells least for its time
GAIN = 1e-3  # of φ: an exchange that gains less is not made
LOOKED = 192  # of the worst of many: what is far from the worst does not become it in one exchange
PLANS = 3  # planned at most; each says how much too long the one before was
KEPT = 0.3  # s that are kept back at least where a plan was too long


@dataclass
class Tour:
    """What could be touched at one visit: legs (s) between its facets, and the way through those that are touched."""

    rows: Rows  # numbers of its touches among all
    legs: Array  # (m, m) s
    way: list[int]  # places in `rows`
    _known: tuple[list[int], Array, Rows] | None = None  # a way, and what `more` gives of it

    def more(self) -> tuple[Array, Rows]:
        """→ (m,) s that the way gets longer by each facet, (m,) place in the way where it then comes."""
        if self._known is None or self._known[0] != self.way:
            self._known = (list(self.way), *self._more())
        return self._known[1:]

    def _more(self) -> tuple[Array, Rows]:
        way = self.way
        if not way:
            return np.zeros(len(self.rows)), np.zeros(len(self.rows), dtype=int)
        between = self.legs[way[:-1]] + self.legs[:, way[1:]].T - self.legs[way[:-1], way[1:]][:, None]
        added = np.vstack([self.legs[:, way[0]], between, self.legs[way[-1]]])
        at = added.argmin(axis=0)
        return np.maximum(added[at, np.arange(len(self.rows))], 0.0), at

    def less(self, some: list[int]) -> float:
        """places in `rows` → s that the way gets shorter by without them."""
        left = [i for i in self.way if i not in some]
        return order.length(self.way, self.legs) - order.length(left, self.legs)


class Exchange:
    """Touches of a plan while they are exchanged: how often each is made, what is known by them, and the time that is left."""

    def __init__(self, found: Chosen, again: float, spare: float, stay: int = 0) -> None:
        """plan, s of one more touch of the facet that has just been touched, s left over, first visits that stay as they are."""
        problem, self.again, self.spare = found.problem, again, spare
        choice, visits = problem.choice, visits_of(found)
        self.criterion, self.information, barred = problem.criterion, found.information, problem.barred
        number = {tuple(sorted(i.position.items())): j for j, i in enumerate(choice.cell.strategy.indexations)}
        own = problem.ordered([number[tuple(sorted(i.position.items()))] for i in visits]).choice
        legs = order.Legs(choice.cell, problem.feed, problem.ways.legs)
        first = {(t.indexation, t.facet): n for n, t in reversed(list(enumerate(found.plan.touches)))}
        touched = {facet for _, facet in first}
        balls = {choice.cell.artefact.facets[f].ball for f in touched}
        self.facet: list[str] = []
        rows, counts, last, self.tours = [], [], [], []
        for v, visit in enumerate(visits):
            at = own.of_pose[number[tuple(sorted(visit.position.items()))]]
            of_pose = [i for i in at.tolist() if not barred[i] and choice.cell.artefact.facets[own.facet[i]].ball in balls]
            facets = [own.facet[i] for i in of_pose]
            begin = len(self.facet)
            self.facet += facets
            rows += [found.rows[first[v, f]] if (v, f) in first else own.rows[i] for i, f in zip(of_pose, facets, strict=True)]
            counts += [visit.facets.count(f) for f in facets]
            last += [(v, f) in first and stays(found, (v, f)) for f in facets]
            way = [facets.index(f) for f in dict.fromkeys(visit.facets)]
            self.tours.append(Tour(np.arange(begin, len(self.facet)), legs.between(dict(visit.position), facets), way))
        self.rows, self.count, self.stays = np.array(rows), np.array(counts), np.array(last)
        self.visit = np.concatenate([np.full(len(t.rows), v) for v, t in enumerate(self.tours)])
        self.touch, self.first = _touching(found), stay

    def tours_anew(self) -> None:
        """The shortest way through what is touched at each visit that was found; the time left grows by it."""
        for tour in self.tours[self.first :]:
            some = sorted(tour.way)
            way = [some[i] for i in order.path(tour.legs[np.ix_(some, some)])]
            gained = order.length(tour.way, tour.legs) - order.length(way, tour.legs)
            if gained > 0:
                tour.way, self.spare = way, self.spare + gained

    def price(self) -> Array:
        """→ (n,) s of each touch once more; infinite for one that is made often enough."""
        price = np.full(len(self.rows), self.again)
        for tour in self.tours:
            new = self.count[tour.rows] == 0
            price[tour.rows[new]] = tour.more()[0][new] + self.touch
        return np.where((self.count >= MOST) | (self.visit < self.first), np.inf, price)

    def take(self, row: int) -> None:
        """A touch once more."""
        self.spare -= float(self.price()[row])
        if not self.count[row]:
            tour = self.tours[self.visit[row]]
            place = int(row - tour.rows[0])
            tour.way.insert(int(tour.more()[1][place]), place)
        self._change(row, 1)

    def leave(self, rows: list[int]) -> None:
        """Touches of one visit once less, each."""
        self.spare += self.saved(rows)
        for row in rows:
            self._change(row, -1)
            if not self.count[row]:
                tour = self.tours[self.visit[row]]
                tour.way.remove(int(row - tour.rows[0]))

    def saved(self, rows: list[int]) -> float:
        """touches of one visit → s without one of each."""
        tour, gone = self.tours[self.visit[rows[0]]], [row for row in rows if self.count[row] == 1]
        short = tour.less([int(row - tour.rows[0]) for row in gone]) if gone else 0.0
        return short + self.touch * len(gone) + self.again * (len(rows) - len(gone))

    def _change(self, row: int, sign: int) -> None:
        self.count[row] += sign
        self.information = self.information + sign * np.outer(self.rows[row], self.rows[row])

    def keep(self) -> tuple[Array, Array, float, list[list[int]]]:
        """→ what `back` needs."""
        return self.count.copy(), self.information, self.spare, [list(t.way) for t in self.tours]

    def back(self, kept: tuple[Array, Array, float, list[list[int]]]) -> None:
        """As it was at `keep`."""
        self.count, self.information, self.spare = kept[0].copy(), kept[1], kept[2]
        for tour, way in zip(self.tours, kept[3], strict=True):
            tour.way = list(way)

    def given_up(self) -> list[list[int]]:
        """→ what could be given up: a touch, or two facets of which one comes after the other."""
        visits = np.bincount(self.visit[self.count > 0], minlength=len(self.tours))
        one = [
            i
            for i in np.flatnonzero(self.count)
            if self.visit[i] >= self.first and (self.count[i] > 1 or (not self.stays[i] and visits[self.visit[i]] > 1))
        ]
        alone = {i for i in one if self.count[i] == 1}
        found = [[int(i)] for i in one]
        for v, tour in enumerate(self.tours):
            if visits[v] > 2:
                pairs = ([int(tour.rows[i]) for i in pair] for pair in zip(tour.way, tour.way[1:], strict=False))
                found += [pair for pair in pairs if alone.issuperset(pair)]
        return found

    def improve(self) -> bool:
        """→ whether an exchange was found that makes the plan better; it is made."""
        now = value(self.criterion, self.information)
        few = few_of(self.criterion, self.information)
        state, begin = state_of(few, self.information), smooth(few, self.information)
        some = self.given_up()
        single = np.array(sorted({i for rows in some for i in rows}), dtype=int)
        lost = np.zeros(len(self.rows))
        lost[single] = without_each(few, state, begin, self.rows[single], POWER) - begin
        kept = self.keep()
        by_rate = sorted(some, key=lambda rows: float(lost[rows].sum()) / self.saved(rows))
        best: tuple[float, tuple[Array, Array, float, list[list[int]]]] | None = None
        for rows in [[], *by_rate[:TRIED]]:
            self.back(kept)
            if rows:
                self.leave(rows)
            with suppress(np.linalg.LinAlgError):
                self.fill(few)
                reached = smooth(few, self.information)
                if best is None or reached < best[0]:
                    best = reached, self.keep()
        self.back(kept)
        if best is None or not best[0] < begin - GAIN * _size(few, begin, self.information):
            return False
        self.back(best[1])
        if few.worst is None or value(self.criterion, self.information) < now * (1 + GAIN):
            return True
        self.back(kept)
        return False

    def fill(self, criterion: Criterion) -> None:
        """Takes in what tells most for its time until no time is left."""
        state, now = state_of(criterion, self.information), smooth(criterion, self.information)
        while True:
            price = self.price()
            open_to = np.flatnonzero(price <= self.spare + 1e-9)
            if not len(open_to):
                return
            reached = with_each(criterion, state, now, self.rows[open_to], POWER)
            best = int(np.argmax((now - reached) / price[open_to]))
            if not reached[best] < now:
                return
            now = float(reached[best])
            self.take(int(open_to[best]))
            state.change(self.rows[open_to[best]], 1)

    def strategy(self, found: Chosen) -> tuple[Indexation, ...]:
        """plan from which it began → its indexations with the touches that there are now."""
        visits = visits_of(found)
        made = [
            replace(i, facets=tuple(self.facet[tour.rows[k]] for k in tour.way for _ in range(self.count[tour.rows[k]])))
            for i, tour in zip(visits, self.tours, strict=True)
        ]
        return (*made, *found.cell.strategy.indexations[len(visits) :])


def on_the_way(found: Chosen, again: float, stay: int = 0) -> Chosen:
    """plan, s of one more touch in a row, first visits that stay as they are → a plan of the same visits that is no worse."""
    return exchanged(found, again, lambda start, spare: Exchange(start, again, spare, stay), lambda one: one.value)


def exchanged(
    found: Chosen,
    again: float,
    begin: Callable[[Chosen, float], Exchange],
    worth: Callable[[Chosen], float],
    rounds: int = ROUNDS,
    plans: int = PLANS,
) -> Chosen:
    """plan, s of one more touch in a row, (plan, s left over) → an exchange, plan → what is to be small, exchanges of a plan and
    plans at most → a plan of the same visits that is no worse.

    What an exchange leaves is planned and timed; where it takes too long, the next one has so much less.
    """
    if again <= 0 or found.seconds > found.problem.seconds:
        return found
    problem = found.problem.in_a_row(1)
    start = replace(found, problem=problem, costs=(found.costs[0] / found.problem.times, found.costs[1]))
    best, least, spare = found, worth(found), problem.seconds - found.seconds
    for _ in range(plans):
        exchange = begin(start, spare)
        exchange.tours_anew()
        for _ in range(rounds):
            if not exchange.improve():
                break
        cell = replace(start.cell, strategy=replace(start.cell.strategy, indexations=exchange.strategy(start)))
        planned, faults = attempt(cell, "leave-out", problem.ways.looked)
        if faults:
            break
        with suppress(InputError):  # nothing left that proves the probe
            made = judged(problem, cell, planned)
            if made.seconds > problem.seconds:
                spare -= max(made.seconds - problem.seconds, KEPT)
                continue
            if (reached := worth(made)) >= least:
                break
            start = best = made
            least, spare = reached, problem.seconds - made.seconds
    return best


def visits_of(found: Chosen) -> list[Indexation]:
    """plan → its indexations without the first one once more at the end."""
    visits, first = list(found.cell.strategy.indexations), found.cell.strategy.indexations[0].position
    return visits[:-1] if len(visits) > 1 and visits[-1].position == first else visits


def _touching(found: Chosen) -> float:
    """plan → s of a touch itself, without its way."""
    moves = zip(found.plan.moves, of_moves(found.plan, found.problem.feed), strict=True)
    return sum(s for move, s in moves if move.kind in order.TOUCHING) / len(found.rows)


def few_of(criterion: Criterion, information: Array) -> Criterion:
    """criterion, A → the same; of the worst of many those that are worst now."""
    if criterion.worst is None or len(criterion.worst) <= LOOKED:
        return criterion
    worst = np.argpartition(parts(criterion, information), -LOOKED)[-LOOKED:]
    return Criterion(criterion.name, None, criterion.worst[worst])


def _size(criterion: Criterion, now: float, information: Array) -> float:
    return float(len(information)) if criterion.determinant else now
