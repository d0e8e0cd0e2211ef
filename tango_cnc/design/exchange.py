"""Whole touches: from too many to what the time allows, then exchanged until no exchange makes the plan better.

Backward elimination from what the relaxed design visits; a greedy start from nothing gets stuck (Atkinson, Donev and Tobias 2007,
chapter 12). Then swaps of touches by rank-two updates, and visits that are given up for others.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from .criterion import Criterion, State, parts, swaps, value
from .relaxed import Costs, Relaxed, Rows

LOOK = 4  # touches given up at least between two looks at whole visits
BATCH = 0.02  # of the touches, and of how much too long the plan is, given up at once
SMALL = 2e-4  # of φ: an exchange that gains less is not made
SUPPORT = 60  # indexations that elimination begins with
NEAREST = 4  # new visits that are worked out exactly
PASSES = 1
SHAKES = 40_000  # times that some visits are given up at random, for each candidate less
LEAST_SHAKES, MOST_SHAKES = 6, 200
UNSTICK = 60  # times that some is given up at random for what takes most out of what is worst
LEVELS = 12  # choices with more weight on what is worst


class Draft:
    """A plan in the making: which touches are in, C and G of these, and how long it takes."""

    def __init__(
        self,
        rows: Array,
        pose: Rows,
        of_pose: Sequence[Rows],
        held: Array,
        costs: Costs,
        relaxed: Relaxed,
        chosen: NDArray[np.bool_],
    ) -> None:
        """(n, p) touches, (n,) indexation, rows of each, what is known without touches, costs, relaxed design, (n,) mask."""
        self.rows, self.pose, self.of_pose, self.held, self.costs = rows, pose, of_pose, held, costs
        self.criterion, self.chosen = relaxed.criterion, chosen.copy()
        self.renew()

    def renew(self) -> None:
        """C and G from the touches, without what rounding has gathered."""
        self.information = self.held + self.rows[self.chosen].T @ self.rows[self.chosen]
        self.state = State.of(self.criterion, self.information)
        self.leverage, self.gain = self.state.seen(self.rows)

    @property
    def seconds(self) -> float:
        """→ s that the touches and the visits to their indexations take."""
        visited = np.unique(self.pose[self.chosen])
        return float(self.costs.touch[self.chosen].sum() + self.costs.visit[visited].sum())

    @property
    def value(self) -> float:
        """→ φ; of the worst of many the mean with the weights that it is chosen by."""
        chosen = self.rows[self.chosen]
        return value(Criterion(self.criterion.name, self.criterion.spread), self.held + chosen.T @ chosen)

    def change(self, row: int, sign: int) -> None:
        """row, 1 to take it in and −1 to leave it out."""
        x = self.rows[row]
        u, v, own, left = self.state.change(x, sign)
        self.chosen[row] = sign > 0
        along, across, factor = self.rows @ u, self.rows @ v, -sign / left
        self.leverage = self.leverage + factor * along**2
        self.gain = (
            self.leverage if self.criterion.determinant else self.gain + 2 * factor * along * across + own * factor**2 * along**2
        )

    def eliminate(self, seconds: float) -> None:
        """Leaves out what costs most for what it tells until the plan takes no longer than that: many at once first, then few."""
        while (time := self.seconds) > seconds:
            inside = np.flatnonzero(self.chosen)
            rate = self.state.loss(self.leverage[inside], self.gain[inside]) / self.costs.touch[inside]
            visited = np.unique(self.pose[inside]).tolist()
            least = min(visits := {j: self._visit_rate(j) for j in visited}, key=lambda j: visits[j])
            if visits[least] < rate.min():
                self.chosen[self.of_pose[least]] = False
                self.renew()
                continue
            for touch in inside[np.argsort(rate)][: max(LOOK, int(BATCH * len(inside) * (time / seconds - 1)))].tolist():
                # What was left out just before may have made this one dear.
                now = float(
                    self.state.loss(self.leverage[touch : touch + 1], self.gain[touch : touch + 1])[0] / self.costs.touch[touch]
                )
                if now > visits[least] or time <= seconds:
                    break
                time -= float(self.costs.touch[touch])
                self.change(touch, -1)
            self.renew()

    def _visit_rate(self, j: int) -> float:
        own = self.of_pose[j]
        own = own[self.chosen[own]]
        return self.state.block_loss(self.rows[own]) / float(self.costs.visit[j] + self.costs.touch[own].sum())

    def swap(self, seconds: float) -> None:
        """Swaps touches at the indexations that are visited, the best swap first, while that gains and fits into the time."""
        spare = seconds - self.seconds
        for _ in range(int(self.chosen.sum())):
            visited = np.isin(self.pose, np.unique(self.pose[self.chosen]))
            leaving, entering = np.flatnonzero(self.chosen), np.flatnonzero(visited & ~self.chosen)
            if not len(entering):
                break
            gained = swaps(self.state, self.rows[leaving], self.rows[entering])
            longer = self.costs.touch[entering][None, :] - self.costs.touch[leaving][:, None]
            gained = np.where(longer <= spare + 1e-9, gained, -np.inf)
            best = np.unravel_index(int(np.argmax(gained)), gained.shape)
            if not gained[best] > SMALL * self._size():
                break
            spare -= float(longer[best])
            self.change(int(leaving[best[0]]), -1)
            self.change(int(entering[best[1]]), 1)
        self.renew()

    def _size(self) -> float:
        """→ what a gain is compared with: φ, or a hundredth of each unknown's share of the determinant."""
        return 1.0 if self.criterion.determinant else float(np.einsum("ij,ji->", self.criterion.spread, self.state.covariance))  # type: ignore[arg-type]

    def fill(self, seconds: float, without: frozenset[int] = frozenset()) -> None:
        """Takes in what tells most for its time, touches or whole visits, until the time is used up."""
        spare = seconds - self.seconds
        while True:
            visited = np.unique(self.pose[self.chosen])
            at_hand = np.isin(self.pose, visited) & ~self.chosen
            worth = self.state.benefit(self.leverage, self.gain)
            one = np.where(at_hand & (self.costs.touch <= spare + 1e-9), worth / self.costs.touch, -np.inf)
            touch = int(np.argmax(one))
            rate, visit = self._new_visit(spare, worth, without | set(visited.tolist()), float(one[touch]))
            if visit is not None and rate > one[touch]:
                for row in visit:
                    self.change(row, 1)
                spare -= float(self.costs.visit[self.pose[visit[0]]] + self.costs.touch[visit].sum())
            elif np.isfinite(one[touch]):
                self.change(touch, 1)
                spare -= float(self.costs.touch[touch])
            else:
                break
        self.renew()

    def _new_visit(self, spare: float, worth: Array, without: Collection[int], beat: float) -> tuple[float, list[int] | None]:
        """→ gain per s of the best visit to an indexation that is not visited yet, and its touches."""
        guess = []
        for j, own in enumerate(self.of_pose):
            if j in without or self.costs.visit[j] >= spare:
                continue
            most = int((spare - self.costs.visit[j]) / self.costs.touch[own].min())
            order = own[np.argsort(-worth[own] / self.costs.touch[own])][:most]
            if len(order):
                rate = np.cumsum(worth[order]) / (self.costs.visit[j] + np.cumsum(self.costs.touch[order]))
                guess.append((float(rate.max()), j))
        best: tuple[float, list[int] | None] = (-np.inf, None)
        for most_rate, j in sorted(guess, reverse=True)[:NEAREST]:
            if most_rate <= max(beat, best[0]):
                break
            found = self._visit(j, spare)
            if found[0] > best[0]:
                best = found
        return best

    def _visit(self, j: int, spare: float) -> tuple[float, list[int] | None]:
        """indexation, s → gain per s of its best visit, touches taken one after the other, and these."""
        own, state = self.of_pose[j], State(self.criterion, self.state.covariance, self.state.gain)
        taken: list[int] = []
        time, gained, best = float(self.costs.visit[j]), 0.0, (-np.inf, 0)
        left = np.ones(len(own), dtype=bool)
        while left.any():
            h, g = state.seen(self.rows[own])
            worth = np.where(left & (time + self.costs.touch[own] <= spare), state.benefit(h, g) / self.costs.touch[own], -np.inf)
            pick = int(np.argmax(worth))
            if not np.isfinite(worth[pick]):
                break
            gained += float(worth[pick] * self.costs.touch[own][pick])
            time += float(self.costs.touch[own][pick])
            left[pick] = False
            taken.append(int(own[pick]))
            state.change(self.rows[own[pick]], 1)
            if gained / time > best[0]:
                best = (gained / time, len(taken))
            elif len(taken) > best[1] + 2:
                break
        return best[0], taken[: best[1]] or None

    def retouch(self, seconds: float) -> None:
        """Gives up each touch in turn for whatever else its time buys, and keeps what is better."""
        for row in np.flatnonzero(self.chosen).tolist():
            if not self.chosen[row]:
                continue
            kept, now = self.chosen.copy(), self.value
            self.chosen[row] = False
            self.renew()
            self.fill(seconds)
            if not self.value < now - SMALL * self._size():
                self.chosen = kept
                self.renew()

    def shake(self, seconds: float, times: int) -> None:
        """Gives up some visits at random, fills the time again, and keeps what is better: out of where no single exchange leads."""
        rng = np.random.default_rng(len(self.rows))  # the same plan every time
        best, kept = self.value, self.chosen.copy()
        for _ in range(times):
            visited = np.unique(self.pose[self.chosen])
            gone = rng.choice(visited, min(len(visited) - 1, int(rng.integers(2, 5))), replace=False)
            self.chosen[np.isin(self.pose, gone)] = False
            self.renew()
            self.fill(seconds, frozenset(gone[:1].tolist()))
            self.swap(seconds)
            if (now := self.value) < best - 1e-9 * abs(best):
                best, kept = now, self.chosen.copy()
            else:
                self.chosen = kept.copy()
                self.renew()

    def revisit(self, seconds: float) -> None:
        """Gives up each visit in turn for whatever else the time buys, and keeps what is better."""
        for _ in range(PASSES):
            before = self.value
            for j in sorted(np.unique(self.pose[self.chosen]).tolist(), key=self._visit_rate):
                kept, now = self.chosen.copy(), self.value
                self.chosen[self.of_pose[j]] = False
                self.renew()
                self.fill(seconds, frozenset({j}))
                self.swap(seconds)
                if not self.value < now - SMALL * self._size():
                    self.chosen = kept
                    self.renew()
            if not self.value < before - 5 * SMALL * self._size():
                break


def whole(
    rows: Array,
    pose: Rows,
    of_pose: Sequence[Rows],
    held: Array,
    costs: Costs,
    seconds: float,
    relaxed: Relaxed,
    shakes: int = SHAKES,
) -> NDArray[np.bool_]:
    """candidates, costs, s, relaxed design → (n,) mask of the touches to make; without shakes a first one, quickly."""
    many = relaxed.criterion if relaxed.criterion.worst is not None else None
    support = np.argsort(-relaxed.visits, kind="stable")[:SUPPORT]
    some = np.flatnonzero(np.isin(pose, support[relaxed.visits[support] > 0]))
    place = np.full(len(rows), -1)
    place[some] = np.arange(len(some))
    of_some = [place[own][place[own] >= 0] for own in of_pose]
    everything = np.ones(len(some), dtype=np.bool_)
    few = Draft(rows[some], pose[some], of_some, held, Costs(costs.touch[some], costs.visit), relaxed, everything)
    few.eliminate(seconds)
    chosen = np.zeros(len(rows), dtype=np.bool_)
    chosen[some] = few.chosen
    draft = Draft(rows, pose, of_pose, held, costs, relaxed, chosen)
    draft.fill(seconds)
    draft.swap(seconds)
    if shakes:
        draft.revisit(seconds)
        if len(np.unique(draft.pose[draft.chosen])) > 1:
            draft.shake(seconds, max(LEAST_SHAKES, min(MOST_SHAKES, shakes // len(rows))))
    if many is None:
        return draft.chosen
    times = min(UNSTICK * min(10.0, (150 / rows.shape[1]) ** 1.5), 5.0 * len(rows)) if shakes else 0
    return _unstuck(draft, seconds, many, _levelled(draft, seconds, many), int(times))


def _levelled(draft: Draft, seconds: float, many: Criterion) -> NDArray[np.bool_]:
    """draft, s, criterion of the worst of many → (n,) mask: exchanges again and again with more weight on what is worst."""
    best, chosen = value(many, draft.information), draft.chosen.copy()
    assert many.worst is not None
    weights = np.full(len(many.worst), 1 / len(many.worst))
    for level in range(LEVELS):
        weights = weights * parts(many, draft.information)
        weights /= weights.sum()
        draft.criterion = many.with_weights(weights)
        draft.renew()
        draft.swap(seconds)
        if level % 4 == 3:
            draft.retouch(seconds)
        if (now := value(many, draft.information)) < best:
            best, chosen = now, draft.chosen.copy()
    return chosen


def _unstuck(draft: Draft, seconds: float, many: Criterion, chosen: NDArray[np.bool_], times: int) -> NDArray[np.bool_]:
    """draft, s, criterion of the worst of many, (n,) mask → (n,) mask that is no worse.

    Gives up visits or touches at random and fills the time with what takes most out of what is worst now.
    """
    rng = np.random.default_rng(len(chosen))
    best = value(many, draft.held + draft.rows[chosen].T @ draft.rows[chosen])
    for _ in range(times):
        draft.chosen = chosen.copy()
        weights = parts(many, draft.held + draft.rows[chosen].T @ draft.rows[chosen]) ** float(rng.uniform(1, 6))
        draft.criterion = many.with_weights(weights / weights.sum())
        visited = np.unique(draft.pose[chosen])
        gone = rng.choice(visited, min(len(visited) - 1, int(rng.integers(0, 3))), replace=False)
        draft.chosen[np.isin(draft.pose, gone)] = False
        inside = np.flatnonzero(draft.chosen)
        if not len(gone):
            draft.chosen[rng.choice(inside, min(len(inside) - 1, int(rng.integers(2, 8))), replace=False)] = False
        draft.renew()
        draft.fill(seconds, frozenset(gone[:1].tolist()))
        draft.swap(seconds)
        if (now := value(many, draft.information)) < best * (1 - 1e-9):
            best, chosen = now, draft.chosen.copy()
    return chosen
