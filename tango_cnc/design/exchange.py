"""A plan in the making: touches left out, taken in and swapped by rank-one and rank-two updates, visits given up for others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from .criterion import Criterion, State, swaps, value
from .relaxed import Costs, Relaxed, Rows, table_of

LOOK = 4  # touches given up at least between two looks at whole visits
BATCH = 0.02  # of the touches, and of how much too long the plan is, given up at once
AT_ONCE = 12  # swaps made between two sweeps at most
STILL = 0.7  # of its gain in the sweep that a swap must have left after those before it
SMALL = 2e-4  # of φ: an exchange that gains less is not made
SURELY = 1 - 1e-6  # of a lower bound, for what rounding adds
NEAREST = 4  # new visits that are worked out exactly
PASSES = 1
Kept = tuple[NDArray[np.bool_], Array, State, tuple[Array, Array] | None, Array]


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
        self.needed = np.zeros(len(rows), dtype=np.bool_)  # touches that are never left out
        self._table = table_of(of_pose, len(rows))
        self.renew()

    def renew(self) -> None:
        """C and G from the touches, without what rounding has gathered."""
        self.information = self.held + self.rows[self.chosen].T @ self.rows[self.chosen]
        self.state = State.of(self.criterion, self.information)
        self._exact = self.state.covariance  # C as it is until a touch changes it
        self._seen: tuple[Array, Array] | None = None

    def keep(self) -> Kept:
        """→ what `back` needs to come back to this plan."""
        state = State(self.criterion, self.state.covariance, self.state.gain)
        return self.chosen.copy(), self.information, state, self._seen, self._exact

    def back(self, kept: Kept) -> None:
        """The plan of `keep` again, without working anything out."""
        chosen, self.information, state, self._seen, self._exact = kept
        self.chosen, self.state = chosen.copy(), State(self.criterion, state.covariance, state.gain)

    @property
    def leverage(self) -> Array:
        """→ (n,) x C x of all touches."""
        return self._looked()[0]

    @property
    def gain(self) -> Array:
        """→ (n,) x G x of all touches."""
        return self._looked()[1]

    def _looked(self) -> tuple[Array, Array]:
        if self._seen is None:
            self._seen = self.state.seen(self.rows)
        return self._seen

    def _visited(self) -> NDArray[np.bool_]:
        """→ (m,) which indexations have touches."""
        found = np.zeros(len(self.of_pose), dtype=np.bool_)
        found[self.pose[self.chosen]] = True
        return found

    def offered(self) -> Rows:
        """→ touches that are not in, at the indexations that are visited."""
        return np.flatnonzero(self._visited()[self.pose] & ~self.chosen)

    @property
    def seconds(self) -> float:
        """→ s that the touches and the visits to their indexations take."""
        return float(self.costs.touch[self.chosen].sum() + self.costs.visit[self._visited()].sum())

    @property
    def value(self) -> float:
        """→ φ; of the worst of many the mean with the weights that it is chosen by."""
        if self.state.covariance is self._exact and self.criterion.spread is not None:
            return float(np.vdot(self.criterion.spread, self._exact))
        chosen = self.rows[self.chosen]
        return value(Criterion(self.criterion.name, self.criterion.spread), self.held + chosen.T @ chosen)

    def change(self, row: int, sign: int) -> None:
        """row, 1 to take it in and −1 to leave it out."""
        leverage, gain = self._looked()
        u, v, own, left = self.state.change(self.rows[row], sign)
        self.chosen[row] = sign > 0
        along, factor = self.rows @ u, -sign / left
        leverage = leverage + factor * along**2
        more = factor * along * (2 * (self.rows @ v) + own * factor * along)
        self._seen = leverage, leverage if self.criterion.determinant else gain + more

    def eliminate(self, seconds: float) -> None:
        """Leaves out what costs most for what it tells until the plan takes no longer than that: many at once first, then few."""
        while (time := self.seconds) > seconds and (self.chosen & ~self.needed).any():
            inside = np.flatnonzero(self.chosen & ~self.needed)
            rate = self.state.loss(self.leverage[inside], self.gain[inside]) / self.costs.touch[inside]
            least, lowest = self.least_visit(inside)
            if lowest < rate.min():
                self.chosen[self.of_pose[least]] = False
                self.renew()
                continue
            for touch in inside[np.argsort(rate)][: max(LOOK, int(BATCH * len(inside) * (time / seconds - 1)))].tolist():
                # What was left out just before may have made this one dear.
                now = float(
                    self.state.loss(self.leverage[touch : touch + 1], self.gain[touch : touch + 1])[0] / self.costs.touch[touch]
                )
                if now > lowest or time <= seconds:
                    break
                time -= float(self.costs.touch[touch])
                self.change(touch, -1)
            self.renew()

    def least_visit(self, inside: Rows) -> tuple[int, float]:
        """touches that may be left out → visit of the least `visit_rate`, and that rate.

        Most visits need not be worked out. With H = X C Xᵀ of the touches of a visit: −log det(I − H) is at least Σ −log(1 − hᵢᵢ)
        (Hadamard), and tr((I − H)⁻¹ X G Xᵀ) at least the trace of the last factor, as (I − H)⁻¹ ⪰ I.
        """
        each = self.gain[inside]
        if self.criterion.determinant:
            each = self.state.loss(self.leverage[inside], each)
        floor, time = np.zeros(len(self.of_pose)), self.costs.visit.copy()
        np.add.at(floor, self.pose[inside], each)
        np.add.at(time, self.pose[inside], self.costs.touch[inside])
        visited = np.unique(self.pose[inside])
        floor = floor[visited] / time[visited]
        best = int(visited[0]), np.inf
        for k in np.argsort(floor, kind="stable").tolist():
            if floor[k] * SURELY > best[1]:
                break
            if (rate := self.visit_rate(int(visited[k]))) < best[1] or (rate == best[1] and visited[k] < best[0]):
                best = int(visited[k]), rate
        return best

    def visit_rate(self, j: int) -> float:
        """indexation → how much φ grows without its touches, per s."""
        own = self.of_pose[j]
        own = own[self.chosen[own]]
        if self.needed[own].any():
            return np.inf
        return self.state.block_loss(self.rows[own]) / float(self.costs.visit[j] + self.costs.touch[own].sum())

    def leave(self, j: int) -> None:
        """indexation: leaves out all its touches."""
        self.chosen[self.of_pose[j]] = False
        self.renew()

    def swap(self, seconds: float) -> None:
        """Swaps touches at the indexations that are visited, the best swaps first, while that gains and fits into the time."""
        spare = seconds - self.seconds
        for _ in range(int(self.chosen.sum())):
            leaving, entering = np.flatnonzero(self.chosen & ~self.needed), self.offered()
            if not len(entering) or not len(leaving):
                break
            gained = swaps(self.state, self.rows[leaving], self.rows[entering])
            longer = self.costs.touch[entering][None, :] - self.costs.touch[leaving][:, None]
            gained = np.where(longer <= spare + 1e-9, gained, -np.inf)
            least = SMALL * self._size()
            some = np.argpartition(gained, -AT_ONCE, axis=None)[-AT_ONCE:] if gained.size > AT_ONCE else np.arange(gained.size)
            some = some[np.argsort(-gained.ravel()[some])]
            gone, come = set[int](), set[int]()
            for i, k in zip(*np.unravel_index(some, gained.shape), strict=True):
                out, new = int(leaving[i]), int(entering[k])
                if not gained[i, k] > least or longer[i, k] > spare + 1e-9:
                    continue
                if out in gone or new in come:
                    continue
                if gone:  # what was swapped just before changes what this swap is worth
                    now = float(swaps(self.state, self.rows[[out]], self.rows[[new]])[0, 0])
                    if not now > max(least, STILL * float(gained[i, k])):
                        continue
                spare -= float(longer[i, k])
                self.state.change(self.rows[new], 1)  # first the one that comes: without both there may be no inverse
                self.state.change(self.rows[out], -1)
                self.chosen[out], self.chosen[new] = False, True
                gone.add(out)
                come.add(new)
            if not gone:
                break
        self.renew()

    def _size(self) -> float:
        """→ what a gain is compared with: φ, or a hundredth of each unknown's share of the determinant."""
        return 1.0 if self.criterion.determinant else float(np.einsum("ij,ji->", self.criterion.spread, self.state.covariance))  # type: ignore[arg-type]

    def fill(self, seconds: float, without: frozenset[int] = frozenset()) -> None:
        """Takes in what tells most for its time, touches or whole visits, until the time is used up."""
        spare = seconds - self.seconds
        while True:
            visited = self._visited()
            at_hand = visited[self.pose] & ~self.chosen
            worth = self.state.benefit(self.leverage, self.gain)
            one = np.where(at_hand & (self.costs.touch <= spare + 1e-9), worth / self.costs.touch, -np.inf)
            touch = int(np.argmax(one))
            visited[list(without)] = True
            rate, visit = self._new_visit(spare, worth, visited, float(one[touch]))
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

    def _new_visit(self, spare: float, worth: Array, without: NDArray[np.bool_], beat: float) -> tuple[float, list[int] | None]:
        """→ gain per s of the best visit to an indexation that is not visited yet, and its touches."""
        if not self._table.size:
            return -np.inf, None
        price = np.append(self.costs.touch, np.inf)
        dearest = np.append(-worth / self.costs.touch, np.inf)[self._table]
        rows = np.take_along_axis(self._table, np.argsort(dearest, axis=1), axis=1)
        time = self.costs.visit[:, None] + np.cumsum(price[rows], axis=1)
        rate = np.where(time <= spare + 1e-9, np.cumsum(np.append(worth, 0.0)[rows], axis=1) / time, -np.inf).max(axis=1)
        rate[without] = -np.inf
        best: tuple[float, list[int] | None] = (-np.inf, None)
        for j in np.argsort(-rate)[:NEAREST].tolist():
            if rate[j] <= max(beat, best[0]):
                break
            found = self._visit(j, spare)
            if found[0] > best[0]:
                best = found
        return best

    def _visit(self, j: int, spare: float) -> tuple[float, list[int] | None]:
        """indexation, s → gain per s of its best visit, touches taken one after the other, and these."""
        own, determinant = self.of_pose[j], self.criterion.determinant
        rows, cost = self.rows[own], self.costs.touch[own]
        # C and G as these touches see them follow each touch that is taken in.
        seen = rows @ self.state.covariance @ rows.T
        told = seen if determinant else rows @ self.state.gain @ rows.T
        taken: list[int] = []
        time, gained, best = float(self.costs.visit[j]), 0.0, (-np.inf, 0)
        left = np.ones(len(own), dtype=bool)
        while left.any():
            benefit = self.state.benefit(np.diag(seen), np.diag(told))
            worth = np.where(left & (time + cost <= spare + 1e-9), benefit / cost, -np.inf)
            pick = int(np.argmax(worth))
            if not np.isfinite(worth[pick]):
                break
            gained += float(benefit[pick])
            time += float(cost[pick])
            left[pick] = False
            taken.append(int(own[pick]))
            u, v, factor = seen[:, pick], told[:, pick], -1 / (1 + seen[pick, pick])
            if not determinant:
                cross = np.outer(u, v)
                told = told + factor * (cross + cross.T) + v[pick] * factor**2 * np.outer(u, u)
            seen = seen + factor * np.outer(u, u)
            told = seen if determinant else told
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
            self._looked()  # before it is kept, or each touch that comes back is looked at anew
            kept, now = self.keep(), self.value
            self.change(row, -1)
            self.fill(seconds)
            if not self.value < now - SMALL * self._size():
                self.back(kept)

    def shake(self, seconds: float, times: int) -> None:
        """Gives up some visits at random, fills the time again, and keeps what is better: out of where no single exchange leads."""
        rng = np.random.default_rng(len(self.rows))  # the same plan every time
        best, kept = self.value, self.keep()
        for _ in range(times):
            visited = np.unique(self.pose[self.chosen])
            gone = rng.choice(visited, min(len(visited) - 1, int(rng.integers(2, 5))), replace=False)
            self.chosen[np.isin(self.pose, gone)] = False
            self.renew()
            self.fill(seconds, frozenset(gone[:1].tolist()))
            self.swap(seconds)
            if (now := self.value) < best + 1e-9 * abs(best):  # one that is as good leads on as well
                best, kept = min(now, best), self.keep()
            else:
                self.back(kept)

    def revisit(self, seconds: float) -> None:
        """Gives up each visit in turn for whatever else the time buys, and keeps what is better."""
        for _ in range(PASSES):
            before = self.value
            for j in sorted(np.unique(self.pose[self.chosen]).tolist(), key=self.visit_rate):
                kept, now = self.keep(), self.value
                self.chosen[self.of_pose[j]] = False
                self.renew()
                self.fill(seconds, frozenset({j}))
                self.swap(seconds)
                if not self.value < now - SMALL * self._size():
                    self.back(kept)
            if not self.value < before - 5 * SMALL * self._size():
                break
