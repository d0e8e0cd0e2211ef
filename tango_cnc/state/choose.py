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
from .volume import Aim

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
    aim: Aim,
    seconds: float,
    touch: float,
    turn: float,
    first: Sequence[int] = (),
) -> Choice:
    """predicted state, (n, p) rows of all touches, (n,) their indexations, what the volume takes from the unknowns, s → choice.

    `touch` and `turn` are the seconds of one touch and of one more indexation; `first`: rows that are taken whatever they tell.
    """
    sigma = sigma_of(state)
    before = float(np.sum(aim.matrix * state.covariance))
    reach = rows @ state.root
    moving = reach @ (state.root.T @ aim.root)  # (n, q) covariance of the touches with what the volume is made of
    told = np.empty((len(rows), len(rows)))  # a column a chosen touch: its covariance with all touches, by its standard deviation
    variance = np.einsum("ij,ij->i", reach, reach) + sigma**2
    groups = _padded(indexation)
    gain = np.zeros(len(rows) + 1)
    left = np.ones(len(rows), dtype=bool)
    opened = np.zeros(len(groups), dtype=bool)
    chosen: list[int] = []
    spent, after = 0.0, before
    wanted = list(first)
    while left.any():
        gain[:-1] = np.einsum("ij,ij->i", moving, moving) / variance * left
        if opened.all():  # every touch costs the same
            row = int(gain.argmax())
            row = row if gain[row] > 0 else -1
        else:
            sizes = np.sort(gain[groups], axis=1)
            rate = np.where(opened, sizes[:, -1] / touch, sizes[:, -TOGETHER:].sum(axis=1) / (turn + touch * TOGETHER))
            best = int(rate.argmax())
            row = int(groups[best, gain[groups[best]].argmax()]) if rate[best] > 0 else -1
        if wanted:
            row = wanted.pop(0)
        cost = touch + (0.0 if row >= 0 and opened[indexation[row]] else turn)
        if row < 0 or (spent + cost > seconds and row not in first):
            break
        spent += cost
        after -= float(gain[row])
        opened[indexation[row]] = True
        left[row] = False
        known = told[:, : len(chosen)]
        shared = reach @ reach[row] - known @ known[row]
        told[:, len(chosen)] = shared / np.sqrt(variance[row])
        along = shared / variance[row]
        moving -= along[:, None] * moving[row]
        variance -= along * shared
        chosen.append(row)
    return Choice(np.array(sorted(chosen), dtype=np.int64), spent, before, after)


def _padded(indexation: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) indexations of touches → (indexations, most) the touches of each, filled up with n."""
    groups = [np.flatnonzero(indexation == i) for i in range(int(indexation.max(initial=-1)) + 1)]
    padded: NDArray[np.int64] = np.full((len(groups), max((len(g) for g in groups), default=1)), len(indexation), dtype=np.int64)
    for own, members in zip(padded, groups, strict=True):
        own[: len(members)] = members
    return padded
