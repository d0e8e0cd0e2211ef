"""First zero of many scalar functions at once, to the last digits that they have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Array

Gap = Callable[[NDArray[np.int64], Array], Array]  # (rows, s of those rows) → gap of those rows
FINEST = 1e-13  # mm: what rounding leaves of a gap between 300 mm numbers
ITERATIONS = 60


def first_zero(function: Gap, count: int, pieces: int) -> Array:
    """gap(rows, s), number of rows, pieces of [0, 1] to look into → (count,) first s at which the gap falls to zero, nan for none.

    A row whose gap is not positive at s = 0 gives 0.
    """
    rows = np.arange(count)
    grid = np.linspace(0.0, 1.0, pieces + 1)
    values = np.column_stack([function(rows, np.full(count, s)) for s in grid])
    closed = values <= 0
    result = np.full(count, np.nan)
    found = np.flatnonzero(closed.any(axis=1))
    first = np.argmax(closed[found], axis=1)
    result[found[first == 0]] = 0.0
    inside = found[first > 0]
    right = first[first > 0]
    low, high = grid[right - 1], grid[right]
    result[inside] = bracketed_zero(
        lambda r, s: function(inside[r], s), low, high, values[inside, right - 1], values[inside, right]
    )
    return result


def bracketed_zero(function: Gap, low: Array, high: Array, at_low: Any, at_high: Any) -> Array:
    """gap, (m,) ends, (m,) gaps > 0 and ≤ 0 there → (m,) zero by false position with the Illinois rule, bisected when slow."""
    a, b, fa, fb = low.copy(), high.copy(), np.array(at_low), np.array(at_high)
    best, size = b.copy(), np.abs(fb)
    active = np.flatnonzero(size > 0)
    for turn in range(ITERATIONS):
        if not active.size:
            break
        i = active
        s = (a[i] * fb[i] - b[i] * fa[i]) / (fb[i] - fa[i]) if turn % 5 < 4 else (a[i] + b[i]) / 2
        s = np.clip(s, a[i], b[i])
        f = function(i, s)
        better = np.abs(f) < size[i]
        best[i[better]], size[i[better]] = s[better], np.abs(f[better])
        left = f > 0
        # Illinois: an end kept twice counts half, so that the other end comes in too
        fb[i] = np.where(left, fb[i] / 2, f)
        fa[i] = np.where(left, f, fa[i] / 2)
        a[i], b[i] = np.where(left, s, a[i]), np.where(left, b[i], s)
        active = i[(size[i] > FINEST) & (b[i] - a[i] > 1e-16)]
    return best
