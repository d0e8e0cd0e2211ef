"""How fast the unknowns wander, learned from the nights there were: the most likely rates, held by a first idea.

Sixty nights tell the rate of one unknown to a fifth at best, and that of one that is hardly seen in a night not at all. So each
family of unknowns shares a factor, families share that of the machine, and each unknown departs from them as far as its own
nights say. What the likelihood gains with every rate is exact (Koopman & Shephard 1992, from the smoother of Koopman 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import linalg

from ..records import Array
from ._root import solved, triangle
from .filter import State, sigma_of
from .frame import CLOSED, Frame, Seen

# Standard deviations of the logarithm of a variance.
MACHINE = 2 * np.log(2.5)  # the first idea is right to a factor of two and a half in all unknowns together
FAMILY = 2 * np.log(2)  # by which a family departs from the machine
OWN = 2 * np.log(1.5)  # by which an unknown departs from its family
ROUNDS = 6
SETTLED = 0.25  # standard deviations of what is learned: a smaller step is the last
LONGEST = 2.0  # step of the logarithm of a variance
LEAST, MOST = 1e-3, 300.0  # of the first idea of a variance


class _Night(NamedTuple):
    """Touches of a night in as few equations as they have: (k, p) rows, (k,) values, in standard deviations of a touch."""

    rows: Array
    value: Array
    days: float  # since the night before
    opened: bool
    rest: float  # sum of squares that no unknown can take away


class _Gain(NamedTuple):
    """What the likelihood says of (p,) rates, and what its slopes are made of."""

    likelihood: float
    squares: Array  # (n,) of the innovations of each night
    kept: Sequence[tuple[Array, Array, Array]]  # of each night: innovations, rows and rows by covariance, all made independent


class Learned(NamedTuple):
    """How fast the unknowns wander, and how far the nights that say so lie from what these rates predict of them."""

    rates: Array  # (p,) variance a day
    squares: Array  # (n,) of the innovations of each night, in standard deviations of a touch; NaN: an alarm, a night after one
    fitted: float = 0.0  # rates that the nights decide and not the first idea

    def agreement(self, touches: Sequence[int], noise: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
        """(n,) touches of each night, (n,) squares and degrees of freedom of what no unknown took away → statistics of quiet
        nights had they been predicted with these rates, their degrees of freedom; None where nothing was learned.

        Nights that rates were fitted to lie nearer to them than the next ones will, by two squares a rate (Akaike 1974).
        """
        quiet = np.isfinite(self.squares)
        if not quiet.any():
            return None
        rest = np.asarray(noise)[quiet]
        statistic = float(np.sum(self.squares[quiet] - rest[:, 0])) + 2 * self.fitted
        return max(statistic, 0.0), max(float(np.sum(np.asarray(touches)[quiet] - rest[:, 1])), 0.0)


def learn(followed: Frame, begin: State, nights: Sequence[tuple[float, Seen]], opened: Sequence[int] = ()) -> Learned:
    """frame, state before the first night, (day, what was seen) of each, places of alarms → (p,) variance a day, (n,) squares.

    Of what was seen, single touches that fit nothing have been taken out. The search begins at the rates of the state.
    """
    if len(nights) - len(opened) < 3:
        return Learned(begin.rates.copy(), np.full(len(nights), np.nan))
    alive = (followed.wander > 0) | (begin.std > 10 * CLOSED)  # the others are not followed yet
    names = tuple(n for n, lives in zip(begin.names, alive, strict=True) if lives)
    learned, whole = begin.rates.copy(), begin
    begin = replace(whole, names=names, mean=whole.mean[alive], root=whole.root[alive], rates=whole.rates[alive])
    nights = [(day, replace(what, rows=what.rows[:, alive])) for day, what in nights]
    own = np.flatnonzero(followed.wander[alive] > 0)
    first = followed.wander[alive][own]
    families = np.array(followed.families)[alive][own]
    shared = (families[:, None] == np.unique(families)[None, :]).astype(float)  # (p, f)
    weight = np.repeat([MACHINE**-2, FAMILY**-2, OWN**-2], [1, shared.shape[1], len(own)])
    spread = np.hstack([np.ones((len(own), 1)), shared, np.eye(len(own))])  # logarithms of rates by their factors
    factors = _factors(np.log(begin.rates[own] / first), spread, weight)
    told = _nights(begin, nights, opened)
    best, best_value, step = factors, -np.inf, np.zeros(len(factors))
    slope, curve, squares = np.zeros(len(own)), np.ones(len(own)), np.full(len(nights), np.nan)
    for _ in range(ROUNDS):
        rates = begin.rates.copy()
        rates[own] = first * np.exp(np.clip(spread @ factors, np.log(LEAST), np.log(MOST)))
        gain = _gain(begin, told, rates)
        value = gain.likelihood - 0.5 * float(weight @ factors**2)
        if value < best_value:  # too long a step
            step = step / 4
        else:
            best, best_value, squares = factors, value, gain.squares
            slope, curve = (of_all[own] for of_all in _slopes(told, rates, gain))
            bend = spread.T @ (curve[:, None] * spread) + np.diag(weight)
            step = linalg.solve(bend, spread.T @ slope - weight * factors, assume_a="pos")
            step = step * min(1.0, LONGEST / max(float(np.max(np.abs(spread @ step))), 1e-9))
        factors = best + step
        moved = spread @ step
        if float(np.max(moved**2 * (curve + OWN**-2))) < SETTLED**2:
            break
    learned[np.flatnonzero(alive)[own]] = first * np.exp(np.clip(spread @ best, np.log(LEAST), np.log(MOST)))
    bend = spread.T @ (curve[:, None] * spread)
    fitted = float(np.trace(linalg.solve(bend + np.diag(weight), bend, assume_a="pos")))
    squares[[place + 1 for place in opened if place + 1 < len(nights)]] = np.nan  # what an alarm had opened is first seen then
    return Learned(learned, squares, fitted)


def _factors(logs: Array, spread: Array, weight: Array) -> Array:
    """(p,) logarithms of rates beside the first idea → the likeliest factors that make them."""
    inverse = spread / weight
    return np.asarray(inverse.T @ linalg.solve(spread @ inverse.T, logs, assume_a="pos"))


def _nights(begin: State, nights: Sequence[tuple[float, Seen]], opened: Sequence[int]) -> list[_Night]:
    sigma, day, told = sigma_of(begin), begin.day, []
    for place, (when, what) in enumerate(nights):
        rows, value = what.rows / sigma, what.value / sigma
        rest = 0.0
        if len(rows) > rows.shape[1]:
            both = triangle(np.column_stack([rows, value]))
            rows, value, rest = both[:-1, :-1], both[:-1, -1], float(both[-1, -1] ** 2)
        told.append(_Night(rows, value, max(when - day, 0.0), place in opened, rest))
        day = max(when, day)
    return told


def _gain(begin: State, nights: Sequence[_Night], rates: Array) -> _Gain:
    """state before the first night, touches of the nights, (p,) rates → what the likelihood says of them."""
    mean, spread = begin.mean, np.asfortranarray(begin.covariance)
    p = len(mean)
    likelihood, kept, squares = 0.0, [], []
    for night in nights:
        spread = spread.copy(order="K")
        # What changed at once is let in, and says nothing of wandering.
        spread.ravel("K")[:: p + 1] += rates * (night.days + (300.0**2 if night.opened else 0.0))
        both = np.empty((len(night.rows), 2 * p + 1), order="F")
        both[:, 0] = night.value - night.rows @ mean
        both[:, 1 : p + 1] = night.rows
        both[:, p + 1 :] = night.rows @ spread
        size = both[:, p + 1 :] @ night.rows.T
        size.ravel()[:: len(size) + 1] += 1.0
        root = np.linalg.cholesky(size)
        white = solved(np.asarray(root, dtype=float), both)
        ahead, rows, seen = white[:, 0], white[:, 1 : p + 1], white[:, p + 1 :]
        squares.append(np.nan if night.opened else float(ahead @ ahead) + night.rest)
        likelihood -= 0.5 * float(ahead @ ahead) + float(np.sum(np.log(np.diag(root))))
        mean = mean + seen.T @ ahead
        spread = spread - seen.T @ seen
        kept.append((ahead, rows, seen))
    return _Gain(likelihood, np.array(squares), kept)


def _slopes(nights: Sequence[_Night], rates: Array, gain: _Gain) -> tuple[Array, Array]:
    """touches of the nights, (p,) rates, what the likelihood says of them → (p,) its slope by the logarithm of each, and (p,) how
    curved it is. As much work as the likelihood itself, and not needed for rates that are less likely than the last ones.
    """
    p = len(rates)
    slope, curve = np.zeros(p), np.zeros(p)
    back, sure = np.zeros(p), np.zeros((p, p))
    for night, (ahead, rows, seen) in zip(reversed(nights), reversed(gain.kept), strict=True):
        # Through the update, L = 1 − seenᵀ rows, and what this night adds.
        back = back + rows.T @ (ahead - seen @ back)
        both = seen @ sure
        half = both - 0.5 * ((both @ seen.T) @ rows + rows)
        taken = rows.T @ half
        sure = sure - taken - taken.T
        if night.opened:
            continue
        share, own = rates * night.days, np.diag(sure)
        slope += 0.5 * share * (back**2 - own)
        curve += 0.5 * share * own  # between what all steps would say if they were seen, and what single ones say
    return slope, np.maximum(curve, 0.0)
