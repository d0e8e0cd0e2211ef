"""A series that wanders: a random walk under white noise, and what a known state adds to it (dry and wet, a thermometer)."""

from __future__ import annotations

import math

import numpy as np

from ..records import Array


def random_walk(t: Array, values: Array, known: Array | None = None) -> tuple[float, float, float, float]:
    """(m,) s, (m,) mm, (m − 1,) steps of a state → random walk after one hour, white noise, effect of the state and its std, mm.

    By restricted maximum likelihood (Harville 1977). The steps of the series do not know its mean; their covariance has three
    diagonals.
    """
    steps, hours = np.diff(values), np.maximum(np.diff(t), 1e-9) / 3600
    size = float(np.mean(steps**2))
    if size == 0:
        return 0.0, 0.0, 0.0, 0.0

    from scipy import linalg, optimize

    def fitted(x: Array) -> tuple[float, float, float]:
        walk, white = size * np.exp(x)
        bands = np.vstack([walk * hours / hours.mean() + 2 * white, np.full(len(steps), -white)])
        factor = linalg.cholesky_banded(bands, lower=True)
        level = 2 * float(np.sum(np.log(factor[0])))
        if known is None:
            return level + float(steps @ linalg.cho_solve_banded((factor, True), steps)), 0.0, 0.0
        along = linalg.cho_solve_banded((factor, True), known)
        weight = float(known @ along)
        effect = float(steps @ along) / weight
        rest = steps - effect * known
        level += math.log(weight) + float(rest @ linalg.cho_solve_banded((factor, True), rest))
        return level, effect, weight**-0.5

    starts = [np.array([a, b]) for a, b in ((-1.0, -1.5), (-6.0, -0.7), (-0.1, -6.0))]
    options = {"xatol": 1e-4, "fatol": 1e-8}
    bounds = [(-18.0, 2.0)] * 2
    found = [optimize.minimize(lambda x: fitted(x)[0], x, method="Nelder-Mead", bounds=bounds, options=options) for x in starts]
    best = min(found, key=lambda f: float(f.fun)).x
    walk, white = size * np.exp(best)
    return math.sqrt(walk / hours.mean()), math.sqrt(white), *fitted(best)[1:]
