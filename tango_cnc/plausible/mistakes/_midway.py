"""Something that is otherwise from one touch on, or in one part of the run: every part is looked at, by sums, all at once.

Two looks. A gross change puts the tip far from its nominal contact, in three directions: each way in which that may come about is
counted for every touch by itself, and a part of the run is where it helps (maximal sum of a part). A small one is within what the
unknowns of the cell may do, so that these are projected out first, each within its prior (generalized least squares): then the χ²
that a constant takes out of a part is a quotient of two differences of sums, for all parts of a run at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ... import kinematics
from ...records import Array, Machine, Readings
from ...touches import Touches, from_readings
from ..fit import BESIDE, Start, linear
from ._case import Case, with_positions

FEWEST = 3  # touches of a part, and outside it
LATER = 12.0  # χ² by which a part with an end has to explain more than all from one touch on
EVERY = 2000  # touches that a part may begin or end with in the first look
CHOICES = 41  # sizes of a gross change that are looked at
GROSS = 1.0  # mm or, times 100 mm, rad: what is beyond it is seen without any fit
HELPS = 12.0  # sum of a part from which on a gross change is one
SEEN = 25.0  # χ² of a small one
TINY = 1e-12
UNFELT = 1e-3  # share of its χ² that touches which do not feel a change add to a part, at most


@dataclass(frozen=True)
class Part:
    """Rows `first` to before `end` of a run, and how much of the cost is gone when they are put right."""

    first: int
    end: int
    gain: float
    unfelt: int = 0  # rows before the first that do not show it, so that it may have begun with any of them

    def rows(self, count: int) -> NDArray[np.bool_]:
        """n → (n,) mask."""
        place = np.arange(count)
        return (place >= self.first) & (place < self.end)


@dataclass(frozen=True)
class Changed:
    """Axes that count from another zero in a part of the run."""

    part: Part
    size: Array  # (a,) mm or rad that their readings are too large by
    readings: Readings  # put right


def best_part(helps: Array) -> tuple[int, Part] | None:
    """(n, c) how much less every touch costs with each of c changes → the change and the part of the run of the largest sum.

    None where that is the whole run, or where less than a few touches are in it. What ends shortly before the end does not end.
    """
    n = len(helps)
    sums = np.vstack([np.zeros(helps.shape[1]), np.cumsum(helps, axis=0)])
    least = np.minimum.accumulate(sums, axis=0)
    until = sums - least
    choice = int(np.argmax(until.max(axis=0)))
    end = int(np.argmax(until[:, choice]))
    first = int(np.argmin(sums[: end + 1, choice]))
    if n - end < FEWEST:
        end = n
    gain = float(until[:, choice].max())
    if gain < HELPS or end - first < FEWEST or end - first > n - FEWEST:
        return None
    return choice, Part(first, end, gain)


@dataclass(frozen=True, eq=False)
class Left:
    """What the unknowns of a cell leave of its touches, each unknown within its prior."""

    touches: Touches

    @cached_property
    def _known(self) -> tuple[Array, Array, float]:
        """→ (n, p) basis and mm of a touch, so that the weight matrix without the unknowns is (1 − basis basisᵀ) / mm²; (n,) that
        matrix times the gaps. The matrix itself, (n, n), would be 16 GB for 200 days of 226 touches.
        """
        gaps, columns, scale = linear(Start(self.touches))
        scaled = columns / scale
        inner = scaled.T @ scaled
        inner[np.diag_indices_from(inner)] += 1.0
        basis = linalg.solve_triangular(np.linalg.cholesky(inner), scaled.T, lower=True).T
        return basis, (gaps - basis @ (basis.T @ gaps)) / scale**2, scale

    def square(self, levers: Array) -> Array:
        """(n, a) gap a unit → (a, a) what they weigh without the unknowns."""
        basis, _, scale = self._known
        shared = basis.T @ levers
        return np.asarray((levers.T @ levers - shared.T @ shared) / scale**2)

    def pull(self, levers: Array) -> Array:
        """(n, a) gap a unit → (a,) how the gaps pull at them."""
        return np.asarray(levers.T @ self._known[1])

    def parts(self, lever: Array) -> tuple[Part, float] | None:
        """(n,) gap a unit → the part in which a constant of it explains most, and the constant; None where nothing is explained.

        Of more than `EVERY` touches the parts that begin and end with some of them come first, then all near the best.
        """
        n = len(lever)
        basis, right, scale = self._known
        if n < 2 * FEWEST + 1:
            return None
        sums = np.r_[0.0, np.cumsum(lever * right)]
        own = np.r_[0.0, np.cumsum(lever**2)]
        shared = np.vstack([np.zeros(basis.shape[1]), np.cumsum(basis * lever[:, None], axis=0)])

        def gains(first: NDArray[np.int64], end: NDArray[np.int64]) -> tuple[Array, Array, Array]:
            """(k,), (m,) → (k, m) χ² that goes with a constant from the one to before the other, what pulls at it, its weight."""
            apart = (
                np.sum(shared[first] ** 2, axis=1)[:, None] + np.sum(shared[end] ** 2, axis=1) - 2 * shared[first] @ shared[end].T
            )
            size = (own[end] - own[first][:, None] - apart) / scale**2
            found = sums[end] - sums[first][:, None]
            long = end - first[:, None]
            allowed = (long >= FEWEST) & (long <= n - FEWEST) & (first >= FEWEST)[:, None] & (size > TINY)
            return np.where(allowed, found**2 / np.where(allowed, size, 1.0), 0.0), found, size

        def best(firsts: NDArray[np.int64], ends: NDArray[np.int64]) -> tuple[int, int, float]:
            gain = gains(firsts, ends)[0]
            at, until = divmod(int(np.argmax(gain)), len(ends))
            return int(firsts[at]), int(ends[until]), float(gain[at, until])

        def near(place: int) -> NDArray[np.int64]:
            return np.arange(max(place - step, 0), min(place + step, n) + 1)

        every, last = np.arange(n + 1), np.array([n])
        step = -(-n // EVERY)
        some = np.append(every[:n:step], n)
        on, _, later = best(every, last)
        first, end, gain = best(some, some)
        if step > 1:
            first, end, gain = best(near(first), near(end))
        if gain < later + LATER:
            first, end, gain = on, n, later
        if gain < SEEN:
            return None
        # Of touches that do not feel it, nobody knows whether they are in the part: it begins and ends with one that does.
        same = gain * (1 - UNFELT)
        begun = gains(every[: end + 1], np.array([end]))[0][:, 0]
        unfelt = int(np.argmin(np.append(begun[first - 1 :: -1] >= same, False))) if first else 0
        more = int(np.argmin(np.append(begun[first:end] >= same, False))) - 1
        first, unfelt = first + more, unfelt + more
        if end < n:
            ended = gains(np.array([first]), every)[0][0]
            end -= int(np.argmin(np.append(ended[end:first:-1] >= same, False))) - 1
        gain_at, found, size = (float(a[0, 0]) for a in gains(np.array([first]), np.array([end])))
        return Part(first, end, gain_at, unfelt), found / size

    def since(self, levers: Array) -> tuple[Part, Array] | None:
        """(n, a) gap a unit of several axes → from which touch on they are elsewhere, and by how much (a,)."""
        n, a = levers.shape
        basis, right, scale = self._known
        if n < 2 * FEWEST + 1:
            return None
        after = _from_the_end(levers * right[:, None])
        shared = [_from_the_end(basis * levers[:, i, None]) for i in range(a)]
        square = np.empty((n, a, a))
        for i in range(a):
            for j in range(a):
                own = _from_the_end(levers[:, i] * levers[:, j])
                square[:, i, j] = (own - np.einsum("np,np->n", shared[i], shared[j])) / scale**2
        square = square + (TINY + 1e-9 * np.trace(square, axis1=1, axis2=2))[:, None, None] * np.eye(a)
        size = np.linalg.solve(square, after[:, :, None])[:, :, 0]
        gain = np.einsum("ni,ni->n", size, after)
        gain[:FEWEST] = gain[n - FEWEST + 1 :] = 0.0
        first = int(np.argmax(gain))
        return None if gain[first] < SEEN else (Part(first, n, float(gain[first])), size[first])

    def size(self, lever: Array) -> tuple[float, float]:
        """(n,) gap a unit → the constant that explains most, and its χ²."""
        own = max(float(self.square(lever[:, None])[0, 0]), TINY)
        found = float(self.pull(lever[:, None])[0])
        return found / own, found**2 / own

    def without(self, lever: Array) -> Array:
        """(n,) gap a unit → (n,) gaps that the unknowns leave when it is put right by a constant."""
        gaps, columns, scale = linear(Start(self.touches))
        own = gaps - self.size(lever)[0] * lever
        scaled = columns / scale
        inner = scaled.T @ scaled
        inner[np.diag_indices_from(inner)] += 1.0
        return np.asarray(own - scaled @ np.linalg.solve(inner, scaled.T @ own))


def _from_the_end(terms: Array) -> Array:
    """(n, …) → (n, …) the sum of each and all after it."""
    return np.asarray(np.cumsum(terms[::-1], axis=0)[::-1])


def away(case: Case, position: Array) -> Array:
    """case, (..., n, k) mm rad → (..., n, 3) mm from the nominal contact to the tip, table frame."""
    touches = from_readings(case.machine, case.artefact, case.readings)
    return np.asarray(kinematics.tip(touches.chain, position) - touches.point - touches.radius[:, None] * touches.normal)


def cost(far: Array) -> Array:
    """(..., n, 3) mm → (..., n) what it costs that touches were made there."""
    return np.asarray(np.log1p(np.sum(far**2, axis=-1) / BESIDE**2))


def zero_changed(case: Case, names: tuple[str, ...]) -> Changed | None:
    """case, axes → the part of the run in which they count from another zero, by how much, and the readings put right."""
    machine, readings = case.machine, case.readings
    columns = [machine.column(name) for name in names]
    gross = _gross(case, columns)
    total = np.zeros(len(names))
    part: Part | None = None
    if gross is not None:
        part, total = gross
        readings = _moved(readings, columns, part, -total)
    for _ in range(3):  # far from its place the way round a ball is long
        touches = from_readings(machine, case.artefact, readings)
        levers = np.stack([touches.lever(name) for name in names], axis=1)
        left = Left(touches)
        if part is not None and gross is not None:
            step = np.array(_within(left, levers, part))
        elif len(names) == 1:
            one = left.parts(levers[:, 0])
            if one is None:
                break
            part, step = one[0], np.array([one[1]])
        else:
            several = left.since(levers)
            if several is None:
                break
            part, step = several
        total = total + step
        readings = _moved(case.readings, columns, part, -total)
        gross = gross or (part, total)
    return None if part is None else Changed(part, total, readings)


def _within(left: Left, levers: Array, part: Part) -> Array:
    """→ (a,) what is left in a part that is known."""
    mask = part.rows(len(levers))
    own = levers * mask[:, None]
    square = left.square(own)
    square[np.diag_indices_from(square)] += TINY + 1e-9 * np.trace(square)
    return np.asarray(np.linalg.solve(square, left.pull(own)))


def _gross(case: Case, columns: list[int]) -> tuple[Part, Array] | None:
    """case, columns of axes → the part in which another zero of them takes tips from afar to their nominal contact; (a,)."""
    position = case.readings.position
    before = away(case, position)
    size = _needed(case, position, columns, before)
    large = np.flatnonzero((np.abs(size) * _reach(case.machine, columns) > GROSS).any(axis=1) & np.isfinite(size).all(axis=1))
    if len(large) < FEWEST:
        return None
    order = large[np.argsort(size[large, 0], kind="stable")]
    chosen = size[order[np.linspace(0, len(order) - 1, CHOICES).astype(int)]]
    tried = np.repeat(position[None], len(chosen), axis=0)
    tried[:, :, columns] -= chosen[:, None, :]
    found = best_part((cost(before) - cost(away(case, tried))).T)
    if found is None:
        return None
    choice, part = found
    rows, total = slice(part.first, part.end), chosen[choice]
    for _ in range(2):  # a turn is no straight line
        moved = np.array(position)
        moved[rows, columns] -= total
        total = total + np.median(_needed(case, moved, columns, away(case, moved))[rows], axis=0)
    return part, total


def _reach(machine: Machine, columns: list[int]) -> Array:
    """→ (a,) mm of a unit: a radian is that of a table of usual size."""
    rotary = {machine.column(name) for name in (*machine.rotary, "S")}
    return np.array([100.0 if c in rotary else 1.0 for c in columns])


def _needed(case: Case, position: Array, columns: list[int], far: Array) -> Array:
    """→ (n, a) by how much the axes would have to be elsewhere for each touch to be at its place, least squares."""
    step = 1e-5
    ways = []
    for column in columns:
        other = np.array(position)
        other[:, column] += step
        ways.append((away(case, other) - far) / step)
    way = np.stack(ways, axis=1)  # (n, a, 3)
    square = way @ np.swapaxes(way, 1, 2) + 1e-6 * np.eye(len(columns))
    return np.asarray(np.linalg.solve(square, (way @ far[:, :, None]))[:, :, 0])


def _moved(readings: Readings, columns: list[int], part: Part, by: Array) -> Readings:
    position = np.array(readings.position)
    for column, value in zip(columns, by, strict=True):
        position[part.first : part.end, column] += value
    return with_positions(readings, position)


def along(case: Case, touches: Touches, by: Array) -> Readings:
    """case, its touches, (n,) mm outward along the normals → its readings with the tips there."""
    names = case.machine.linear
    levers = np.stack([touches.lever(name) for name in names], axis=1)
    share = levers / np.sum(levers**2, axis=1)[:, None]
    position = np.array(case.readings.position)
    position[:, [case.machine.column(name) for name in names]] += share * by[:, None]
    return replace(case.readings, position=position)
