"""Interval of a range: largest minus smallest of a curve that is known with an uncertainty.

Noise makes every range larger. A range of nothing is never read as nothing, and an interval about what was read would miss the
truth. So the interval is found by asking: of which true ranges would what was read be no surprise? (Neyman's construction, by
Monte Carlo, along the shape that was estimated.)
"""

from __future__ import annotations

import numpy as np

from ..records import Array

DRAWS = 400
SCALES = 48
HIDDEN = 0.7  # quantile of the ranges of curves about the one that was read; set on random machines, tested on others


def of_range(mean: Array, root: Array, coverage: float = 0.95) -> tuple[float, float, float]:
    """curve (m,), root (m, k) of its covariance → range, median unbiased, and the ends of its interval; unit of the curve."""
    read = float(np.ptp(mean))
    noise = root @ np.random.default_rng(230).normal(size=(root.shape[1], DRAWS))
    spread = float(np.max(np.sqrt(np.sum(root**2, axis=1))))
    if spread <= 1e-9 * max(read, 1e-30) or read == 0.0:
        return read, read, read
    scale = np.linspace(0.0, 1.0 + 6.0 * spread / read, SCALES)
    tail = (1 - coverage) / 2
    ends = np.empty((3, SCALES))
    for i, s in enumerate(scale):
        ranges = np.ptp(s * mean[:, None] + noise, axis=0)
        ends[:, i] = np.quantile(ranges, [0.5, 1 - tail, tail])
    best, low, high = (read * _where(scale, np.maximum.accumulate(row), read) for row in ends)
    # The shape is uncertain too: a motion of another shape may be hidden below the noise. The upper end allows for it.
    return best, low, max(high, read, float(np.quantile(np.ptp(mean[:, None] + noise, axis=0), HIDDEN)))


def _where(scale: Array, level: Array, read: float) -> float:
    """→ the scale at which a rising level reaches what was read; 0 where it starts above it."""
    return 0.0 if level[0] >= read else float(np.interp(read, level, scale))
