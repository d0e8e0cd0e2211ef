"""Interval of a range: largest minus smallest of a curve that is known with an uncertainty.

Noise makes every range larger, and the shape of a curve is as uncertain as its size. So curves are drawn that the touches leave
possible, under the sizes that error motions of this machine have (`sizes`), and the interval is that of their ranges. Curves so
drawn never have a range of 0. Where noise alone would be read as this curve, the interval begins at 0.
"""

from __future__ import annotations

import numpy as np

from ..records import Array

DRAWS = 1000


def of_range(
    mean: Array, root: Array, read: Array | None = None, noise: Array | None = None, coverage: float = 0.95
) -> tuple[float, float, float]:
    """curve (m,), root (m, k) of its covariance; as read without learned sizes (default: alike), root → median of the range, ends.

    All in the unit of the curve.
    """
    rng = np.random.default_rng(230)
    read, noise = (mean if read is None else read), (root if noise is None else noise)
    tail = (1 - coverage) / 2
    drawn = np.ptp(mean[:, None] + root @ rng.normal(size=(root.shape[1], DRAWS)), axis=0)
    low, best, high = (float(v) for v in np.quantile(drawn, [tail, 0.5, 1 - tail]))
    nothing = np.ptp(noise @ rng.normal(size=(noise.shape[1], DRAWS)), axis=0)
    return best, 0.0 if float(np.ptp(read)) <= float(np.quantile(nothing, 1 - tail)) else low, high
