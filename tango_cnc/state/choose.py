"""Which touches tell most tonight, for the time there is: those that take most out of the uncertainty of the volume.

Greedy: the next touch is the one that takes most variance of the tool tip out per second, where an indexation that is not
yet visited is paid for as well and judged by its best few touches together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from .filter import State, sigma_of

TOGETHER = 5  # touches by which a new indexation is judged


@dataclass(frozen=True)
class Choice:
    """Touches for one night: rows of what was offered, what they take, and what is left."""

    rows: NDArray[np.int64]
    seconds: float
    variance_before: float  # mm², of the weighted volume
    variance_after: float


def choose(
    state: State,
    rows: Array,
    indexation: NDArray[np.int64],
    weight: Array,
    seconds: float,
    touch: float,
    turn: float,
    first: Sequence[int] = (),
) -> Choice:
    """predicted state, (n, p) rows of all touches, (n,) their indexations, (m, p) tool tip of the volume by unknowns, s → choice.

    `touch` and `turn` are the seconds of one touch and of one more indexation; `first`: rows that are taken whatever they tell.
    """
    sigma = sigma_of(state)
    spread = state.covariance
    aim = weight.T @ weight / max(len(weight), 1)
    own = np.flatnonzero(np.diag(aim) > 0)  # the unknowns that the volume depends on
    aim = aim[np.ix_(own, own)]
    before = float(np.sum(aim * spread[np.ix_(own, own)]))
    left = np.ones(len(rows), dtype=bool)
    opened: set[int] = set()
    chosen: list[int] = []
    spent = 0.0
    groups = [np.flatnonzero(indexation == i) for i in range(int(indexation.max(initial=-1)) + 1)]
    wanted = list(first)
    while left.any():
        seen = rows @ spread
        variance = np.sum(seen * rows, axis=1) + sigma**2
        gain = np.sum((seen[:, own] @ aim) * seen[:, own], axis=1) / variance
        gain[~left] = -1.0
        best, row = 0.0, -1
        for i, members in enumerate(groups):
            free = members[left[members]]
            if not len(free):
                continue
            order = free[np.argsort(-gain[free])]
            rate = gain[order[0]] / touch if i in opened else float(np.sum(gain[order[:TOGETHER]])) / (turn + touch * TOGETHER)
            if rate > best:
                best, row = rate, int(order[0])
        if wanted:
            row = wanted.pop(0)
        cost = touch + (0.0 if row >= 0 and int(indexation[row]) in opened else turn)
        if row < 0 or (spent + cost > seconds and row not in first):
            break
        spent += cost
        opened.add(int(indexation[row]))
        left[row] = False
        chosen.append(row)
        spread = spread - np.outer(seen[row], seen[row]) / variance[row]
    return Choice(np.array(sorted(chosen), dtype=np.int64), spent, before, float(np.sum(aim * spread[np.ix_(own, own)])))
