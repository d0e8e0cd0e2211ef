"""How fast the unknowns wander, learned from the nights there were (EM of Shumway & Stoffer 1982, held by a first idea).

Sixty nights tell the rate of one unknown to a fifth at best. So each family of unknowns shares a factor, and each unknown
departs from it as far as its own nights say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ._root import widened
from .filter import State, predicted, taken
from .frame import Frame, Seen
from .smooth import Filtered, smoothed

FIRST = 12.0  # nights that the first idea counts for
ROUNDS = 6
LEAST, MOST = 1e-3, 300.0  # of the first idea of a variance


def learn(followed: Frame, begin: State, nights: Sequence[tuple[float, Seen]], opened: Sequence[int] = ()) -> Array:
    """frame, state before the first night, (day, what was seen) of each, places of alarms → (p,) variance a day.

    Of what was seen, single touches that fit nothing have been taken out.
    """
    rates = begin.rates.copy()
    if len(nights) - len(opened) < 3:
        return rates
    families = np.array(followed.families)
    own = followed.wander > 0
    for _ in range(ROUNDS):
        steps, days = _steps(replace(begin, rates=rates), nights, opened, own)
        for family in np.unique(families[own]):
            rows = np.flatnonzero((families == family) & own)
            first = followed.wander[rows]
            # One factor of the family, then each unknown beside it.
            shared = (FIRST + float(np.sum(steps[rows] / first))) / (FIRST + days * len(rows))
            each = (FIRST * shared * first + steps[rows]) / (FIRST + days)
            rates[rows] = np.clip(each, LEAST * first, MOST * first)
    return rates


def _steps(
    begin: State, nights: Sequence[tuple[float, Seen]], opened: Sequence[int], own: NDArray[np.bool_]
) -> tuple[Array, float]:
    """→ (p,) expected sum of squared steps over the square root of days, nights they come from."""
    state, filtered = begin, []
    for place, (day, what) in enumerate(nights):
        state = predicted(state, day)
        if place in opened:
            state = replace(state, root=widened(state.root, np.diag(300 * np.sqrt(state.rates))))
        state = taken(state, what)
        filtered.append(Filtered(state.mean, state.covariance, day))
    past = smoothed(filtered, begin.rates, opened)
    total, count = np.zeros(len(own)), 0.0
    for place in range(1, len(past)):
        span = past[place].day - past[place - 1].day
        if place in opened or span <= 0:
            continue
        step = past[place].mean - past[place - 1].mean
        variance = np.diag(past[place].covariance) + np.diag(past[place - 1].covariance) - 2 * np.diag(past[place - 1].lagged)
        total += (step**2 + variance) / span
        count += 1.0
    return total, count
