"""Touches without weight that are nearly all before one moment, after it, or along one axis: the run contradicts itself.

A robust fit agrees with the part that tells most of a parameter and drops what contradicts it in the other one. The touches that
are left agree, and the parameters are those of one part: nobody knows which of them the machine is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..texts import say
from .data import Remark, listed
from .groups import tail

CHANCE = 1e-3  # that touches dropped at random lie so much on one side
FEWEST = 4
OTHERS = 2  # touches beside those of one facet and beside those of one indexation: a chip, and one angle, move nothing else
WITHIN = 0.6  # of the run, at most, in which they lie
ALONG = 0.7  # cosine between the normal of a touch and the axis that it is along


def halves(result: Estimate) -> Iterator[Remark]:
    """estimate by the noise of its residuals → a remark where touches that do not fit are those of one part, or along one axis."""
    touches = result.model.touches
    if result.rejected is None or (result.noise is not None and result.noise.step is not None):
        return
    out = [int(i) for i in np.flatnonzero(result.rejected)]
    n, k = len(result.rejected), len(out)
    if k < FEWEST:
        return
    for group in (np.where(touches.ball_index < 0, touches.facet_index, -1 - touches.ball_index), touches.indexation):
        if k - np.unique(group[out], return_counts=True)[1].max() < OTHERS:
            return
    best = 1.0, "", 0, 0
    for own, row in enumerate(out):
        # Every moment was chosen after the fact, and the side too.
        after = tail(n, k, n - row, k - own) * 2 * k, "after", k - own, row
        before = tail(n, k, row + 1, own + 1) * 2 * k, "before", own + 1, row
        sides = [(after, n - row), (before, row + 1)]
        best = min([best, *(side for side, size in sides if size <= WITHIN * n)])
    chance, side, count, last = best
    if not chance < CHANCE:
        yield from _along(result, out)
        return
    numbers = tuple(int(i) for i in touches.number[out])
    text = say(f"plausible.halves.{side}", count=k, own=count, row=int(touches.number[last]), numbers=listed(numbers))
    everything = tuple(c.name for c in result.model.coefficients)
    yield Remark("doubtful", text, numbers, moves=everything)


def _along(result: Estimate, out: list[int]) -> Iterator[Remark]:
    """An axis that sticks or slips stops elsewhere from touch to touch; on every facet the majority wins, right or wrong."""
    touches, n, k = result.model.touches, len(result.residuals), len(out)
    along = np.abs(touches.machine_normal) > ALONG
    found = [(tail(n, k, int(group.sum()), int(group[out].sum())) * 3, i) for i, group in enumerate(along.T)]
    chance, i = min(found)
    if not chance < CHANCE:
        return
    numbers = tuple(int(j) for j in touches.number[out])
    text = say("plausible.halves.along", count=k, own=int(along[out, i].sum()), axis="XYZ"[i], numbers=listed(numbers))
    yield Remark("doubtful", text, numbers, moves=tuple(c.name for c in result.model.coefficients))
