"""Touches of a plan exchanged by what the whole run is worth and by what parts of it are, should it be broken off.

Theory of operation. Each part of the time has an aim, φ of a plan designed for that time. The exchange makes

    ln φ + weight · Σ max(0, ln φ_k − ln (slack² · aim_k))

small, φ_k of the touches that are made by the end of part k. What a touch does to each φ_k follows by rank-one updates, and which
touches are made by then, by the ways between facets and the turns that the plan has taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from .criterion import Criterion, State
from .in_a_row import POWER, smooth, without_each
from .on_the_way import TRIED, Exchange, exchanged, few_of
from .problem import Chosen
from .spare import state_of, with_each
from .timed import broken_off

AIMED = 1.25  # times the standard uncertainty of a plan of that time: so good a part is to be
WEIGHT = 2.0  # of a part that is not, beside the whole plan
ROUNDS = 80  # exchanges at most
GAIN = 5e-4  # of ln φ: an exchange that gains less is not made
NEAR = 0.05  # of ln φ: a part that is only as much better than its aim is looked after
PLANS = 5  # planned at most
LEAST = 1e-30
NONE = 50.0  # ln φ of a part that determines nothing


@dataclass
class _Aimed:
    """The whole plan or a part of it, while touches are taken in."""

    weight: float
    criterion: Criterion
    state: State
    phi: float
    within: NDArray[np.bool_]  # (n,) whether a touch counts for it


class Weighed(Exchange):
    """An exchange that counts what parts of the run are worth beside what all of it is."""

    def __init__(self, found: Chosen, again: float, spare: float, aims: Mapping[float, float]) -> None:
        """plan, s of one more touch in a row, s left over, parts of the time with φ of a plan of each."""
        super().__init__(found, again, spare)
        self.held, self.ends = found.problem.held, [part * found.problem.seconds for part in aims]
        self.aims = [float(np.log(phi * AIMED**2)) for phi in aims.values()]
        at = np.array([touch.indexation for touch in found.plan.touches])
        first = [float(found.time[at == v][0]) for v in range(len(self.tours))]
        last = [float(found.time[at == v][-1]) for v in range(len(self.tours))]
        self.turns = [first[0], *(b - a for a, b in zip(last[:-1], first[1:], strict=True))]
        self.more = [0.0] * len(self.tours)  # s that a visit takes longer than its ways say
        self.more = [b - a - self._along(v)[1] for v, (a, b) in enumerate(zip(first, last, strict=True))]

    def _along(self, v: int) -> tuple[list[tuple[int, float]], float]:
        """visit → its touches with s from the first one to each, the first time; s of all."""
        tour, now, found = self.tours[v], 0.0, list[tuple[int, float]]()
        for n, place in enumerate(tour.way):
            row = int(tour.rows[place])
            now += float(tour.legs[tour.way[n - 1], place]) + self.touch if n else 0.0
            found.append((row, now))
            now += self.again * (int(self.count[row]) - 1)
        return found, now + self.more[v]

    def by_then(self) -> tuple[Array, NDArray[np.bool_]]:
        """→ (k, n) how often each touch is made by the end of each part; (k, n) whether its visit is over by then."""
        made, over, now = np.zeros((len(self.ends), len(self.rows))), np.zeros((len(self.ends), len(self.rows)), dtype=bool), 0.0
        for v, tour in enumerate(self.tours):
            now += self.turns[v]
            along, lasts = self._along(v)
            for k, end in enumerate(self.ends):
                for row, since in along:
                    if (left := end - now - since) >= 0:
                        made[k, row] = min(int(self.count[row]), 1 + int(left / max(self.again, LEAST)))
                over[k, tour.rows] = now + lasts < end
            now += lasts
        return made, over

    def worth(self) -> float:
        """→ what is to be small."""
        parts = [float(np.log(smooth(self.criterion, self._known(made)))) for made in self.by_then()[0]]
        late = sum(max(0.0, part - aim) for part, aim in zip(parts, self.aims, strict=True))
        return float(np.log(smooth(self.criterion, self.information))) + WEIGHT * late

    def _known(self, made: Array) -> Array:
        return np.asarray(self.held + (self.rows.T * made) @ self.rows)

    def _aimed(self) -> list[_Aimed]:
        found = [(1.0, self.information, np.ones(len(self.rows), dtype=np.bool_))]
        for made, over, aim in zip(*self.by_then(), self.aims, strict=True):
            if float(np.log(smooth(self.criterion, known := self._known(made)))) > aim - NEAR:
                found.append((WEIGHT, known, over))
        few = [few_of(self.criterion, known) for _, known, _ in found]
        return [_Aimed(w, f, state_of(f, known), smooth(f, known), over) for f, (w, known, over) in zip(few, found, strict=True)]

    def improve(self) -> bool:
        """→ whether an exchange was found that makes the plan better; it is made."""
        now, some = self.worth(), self.given_up()
        single = np.array(sorted({i for rows in some for i in rows}), dtype=int)
        lost = np.zeros(len(self.rows))
        for one in self._aimed():
            without = without_each(one.criterion, one.state, one.phi, self.rows[single], POWER)
            lost[single] += one.weight * one.within[single] * np.log(np.maximum(without, LEAST) / one.phi)
        kept = self.keep()
        by_rate = sorted(some, key=lambda rows: float(lost[rows].sum()) / self.saved(rows))
        best, least = kept, now - GAIN
        for rows in [[], *by_rate[:TRIED]]:
            self.back(kept)
            if rows:
                self.leave(rows)
            with suppress(np.linalg.LinAlgError):
                self._fill()
                if (reached := self.worth()) < least:
                    best, least = self.keep(), reached
        self.back(best)
        return best is not kept

    def _fill(self) -> None:
        """Takes in what tells most for its time until no time is left."""
        aimed = self._aimed()
        while True:
            price = self.price()
            open_to = np.flatnonzero(price <= self.spare + 1e-9)
            if not len(open_to):
                return
            reached = [with_each(one.criterion, one.state, one.phi, self.rows[open_to], POWER) for one in aimed]
            gain = sum(
                one.weight * one.within[open_to] * np.log(one.phi / np.maximum(phi, LEAST))
                for one, phi in zip(aimed, reached, strict=True)
            )
            best = int(np.argmax(gain / price[open_to]))
            row = int(open_to[best])
            self.take(row)
            for one, phi in zip(aimed, reached, strict=True):
                if one.within[row]:
                    one.state.change(self.rows[row], 1)
                    one.phi = float(phi[best])


def weighed(found: Chosen, again: float, aims: Mapping[float, float]) -> Chosen:
    """plan, s of one more touch in a row, parts of the time with φ of a plan of each → plan of the same visits, no worse."""

    def begin(start: Chosen, spare: float) -> Exchange:
        return Weighed(start, again, spare, aims)

    return exchanged(found, again, begin, lambda one: _worth(one, aims), ROUNDS, PLANS)


def _worth(found: Chosen, aims: Mapping[float, float]) -> float:
    """plan, parts of the time with φ of a plan of each → what is to be small, of what an estimate states."""
    parts = np.minimum(np.log(broken_off(found, list(aims))), NONE)
    return float(np.log(found.value) + WEIGHT * np.maximum(parts - np.log(np.array(list(aims.values())) * AIMED**2), 0.0).sum())
