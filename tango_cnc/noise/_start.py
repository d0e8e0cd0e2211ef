"""Which touches a robust fit reaches: the start from which the noise is taken apart.

Least absolute deviations first, then bisquare with that scale (Yohai 1987). Where that leaves far more than the probe repeats by,
up to half of the touches may be wrong to one side: a latch that comes late, a wet table. Two starts are tried then. In a quantile
regression (Koenker and Bassett 1978) the good touches lie about the middle of what is not late. And two populations, the touches of
one read later than those of the other by one distance, which is k-means on a regression (Späth 1979).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ..estimate import SIGMA_FLOOR
from ..records import Array
from ._system import System, widened

LAPLACE = 0.01  # mm: mean size of a touch's residual that the start takes for granted beside what was known before
SUSPECT = 1.5  # times the stated repeatability that touches may scatter by before another start is looked for
BETTER = 0.6  # of what the first start leaves, at most, that another one may leave
QUANTILES = (0.3, 0.7)  # the middle of the good touches, where two in five are wrong to one side
SETTLED = 0.1  # of the stated repeatability: what touches move by less is for the bisquare to settle
APART = 6.0  # standard deviations between two populations, at least
ROUNDS = 40
FEWEST = 4  # touches of a population
FEWER = 0.4  # share of the touches that a start has to reach


def reachable(s: System) -> NDArray[np.bool_]:
    """system → (n,) touches that a robust fit reaches, of the start that leaves least where the first one leaves much."""
    first, scale = _bisquare(s, _quantile(s, 0.5))
    if scale <= SUSPECT * s.repeats:
        return first
    best, least = first, BETTER * scale
    others = [_bisquare(s, _quantile(s, tau)) for tau in QUANTILES]
    two = _populations(s)
    if two is not None:
        others.append(two)
    for keep, left in others:
        if left < least and keep.mean() > FEWER:
            best, least = keep, left
    return best


def solved(jacobian: Array, right: Array, weight: Array, s: System, sigma: float) -> Array:
    """weighted least squares → unknowns (scaled)."""
    normal = (jacobian.T * weight) @ jacobian + sigma**2 * s.known.T @ s.known
    normal[np.diag_indices_from(normal)] += 1e-12
    pull = jacobian.T @ (weight * right) + sigma**2 * s.known.T @ s.known_gaps
    return positive(normal, pull)


def positive(normal: Array, pull: Array) -> Array:
    """positive definite matrix, right-hand side → solution, the shortest one where a wrong cell leaves directions open."""
    try:
        return np.asarray(linalg.cho_solve(linalg.cho_factor(normal, check_finite=False), pull, check_finite=False))
    except linalg.LinAlgError:
        return np.asarray(linalg.pinvh(normal, check_finite=False) @ pull)


def _quantile(s: System, tau: float) -> Array:
    """system, share of the touches that lie below the fit → (n,) mm left of every touch, by reweighting."""
    left = s.gaps
    size = float(np.median(np.abs(left))) + SIGMA_FLOOR
    for k in range(30):
        side = 2 * np.where(left > 0, tau, 1 - tau)
        weight = side / np.maximum(np.abs(left), max(size * 0.5 ** min(k, 12), SIGMA_FLOOR)) / LAPLACE
        before, left = left, s.gaps - s.jacobian @ _weighted(s, weight)
        if k >= 12 and np.abs(left - before).max() < SETTLED * s.repeats:
            break
    return left


def _weighted(s: System, weight: Array) -> Array:
    normal = (s.jacobian.T * weight) @ s.jacobian + s.known.T @ s.known
    normal[np.diag_indices_from(normal)] += s.prior + 1e-9
    return positive(normal, s.jacobian.T @ (weight * s.gaps) + s.known.T @ s.known_gaps + s.prior * s.values)


def _bisquare(s: System, left: Array) -> tuple[NDArray[np.bool_], float]:
    """system, (n,) mm left by a start → touches that it reaches, mm that these scatter by."""
    n, p = s.jacobian.shape
    # A fit of p unknowns passes through p touches: the median is taken over what is left of the others.
    scale = max(1.4826 * float(np.median(np.sort(np.abs(left))[p // 2 :])), SIGMA_FLOOR)
    for _ in range(10):
        weight = np.clip(1 - (left / (4.685 * scale)) ** 2, 0.0, None) ** 2
        if (weight > 0).sum() <= p:
            return np.ones(n, dtype=np.bool_), np.inf
        left = s.gaps - s.jacobian @ solved(s.jacobian, s.gaps, weight, s, scale)
        inside = np.abs(left) < 4.685 * scale
        scale = max(float(np.sqrt(np.sum(weight * left**2) / max(np.sum(weight) * (1 - p / n), 1.0))) * 1.2, SIGMA_FLOOR)
    return np.asarray(inside), scale


def _populations(s: System) -> tuple[NDArray[np.bool_], float] | None:
    """system → the larger of two populations that differ by one distance, mm that both scatter by; None where they overlap."""
    n, p = s.jacobian.shape
    late = s.gaps > 0
    weight = np.full(n, 1 / LAPLACE**2)
    for _ in range(ROUNDS):
        if not FEWEST <= late.sum() <= n - FEWEST:
            return None
        both = widened(s, late[:, None].astype(np.float64))
        found = _weighted(both, weight)
        plain = s.gaps - s.jacobian @ found[:-1]
        apart = float(found[-1])
        again = np.abs(plain - apart) < np.abs(plain)
        if np.array_equal(again, late):
            break
        late = again
        left = np.where(late, plain - apart, plain)
        scatter = max(1.4826 * float(np.median(np.sort(np.abs(left))[p // 2 :])), SIGMA_FLOOR)
        # A few touches on a ball cannot tell their population: what fits neither has hardly any weight.
        weight = 1 / (1 + (left / (4.685 * scatter)) ** 2) ** 2 / LAPLACE**2
    left = np.where(late, plain - apart, plain)
    scatter = max(1.4826 * float(np.median(np.sort(np.abs(left))[p // 2 :])), SIGMA_FLOOR)
    if abs(apart) < APART * scatter:
        return None
    fits = np.abs(left) < 4.685 * scatter
    larger = ~late if late.sum() <= n / 2 else late
    return fits & larger, scatter
