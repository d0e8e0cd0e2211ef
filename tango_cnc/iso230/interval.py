"""Interval of a range: largest minus smallest of a curve that is known with an uncertainty.

Noise makes every range larger, and the shape of a curve is as uncertain as its size. So curves are drawn that the touches leave
possible (`sizes`), and the interval is that of their ranges. Curves so drawn never have a range of 0. Where noise alone would be
read as this curve, the interval begins at 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..records import Array

DRAWS = 1000


class Spread(NamedTuple):
    """A range, in the unit of its curve: median, 95 % interval, and the limits below and above which it is with 5 % each."""

    best: float
    low: float
    high: float
    least: float
    most: float


def of_drawn(curves: Array, read: Array, noise: Array, coverage: float = 0.95) -> Spread:
    """curves that are possible (m, d), the curve as read (m,), root (m, k) of the covariance of its noise → their range."""
    tail, rng = (1 - coverage) / 2, np.random.default_rng(230)
    low, least, best, most, high = (
        float(v) for v in np.quantile(np.ptp(curves, axis=0), [tail, 2 * tail, 0.5, 1 - 2 * tail, 1 - tail])
    )
    nothing = np.ptp(noise @ rng.normal(size=(noise.shape[1], DRAWS)), axis=0)
    of_noise, often = (float(v) for v in np.quantile(nothing, [1 - tail, 1 - 2 * tail]))
    size = float(np.ptp(read))
    return Spread(best, 0.0 if size <= of_noise else low, high, 0.0 if size <= often else least, most)


def of_range(mean: Array, root: Array, coverage: float = 0.95) -> tuple[float, float, float]:
    """curve (m,), root (m, k) of its covariance → median of the range, ends of its interval, in the unit of the curve."""
    rng = np.random.default_rng(230)
    found = of_drawn(mean[:, None] + root @ rng.normal(size=(root.shape[1], DRAWS)), mean, root, coverage)
    return found.best, found.low, found.high
