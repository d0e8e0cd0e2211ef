"""Coverage intervals and regions, numerical tolerance, and whether the linear propagation may be trusted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..records import Array, InputError
from .trials import Trials, merge

DRAWS = 100_000


def symmetric(values: NDArray[np.floating[Any]], probability: float) -> tuple[Array, Array]:
    """(T, q), p → (q,) low and (q,) high ends, as much probability left out on either side (JCGM 101:2008, 7.7.2)."""
    ordered = np.sort(values, axis=0)
    count, inside = _inside(len(values), probability)
    first = (count - inside) // 2
    return ordered[first].astype(float), ordered[min(first + inside, count - 1)].astype(float)


def shortest(values: NDArray[np.floating[Any]], probability: float) -> tuple[Array, Array]:
    """(T, q), p → (q,) low and (q,) high ends of the shortest interval (JCGM 101:2008, 7.7.4)."""
    ordered = np.sort(values, axis=0)
    count, inside = _inside(len(values), probability)
    first = np.argmin(ordered[inside:] - ordered[: count - inside], axis=0)
    column = np.arange(values.shape[1])
    return ordered[first, column].astype(float), ordered[first + inside, column].astype(float)


def _inside(count: int, probability: float) -> tuple[int, int]:
    """→ T and q = p T, rounded; raises InputError when there are too few trials to see the tails."""
    if not 0 < probability < 1:
        raise InputError(f"--probability: found {probability:g}; allowed: between 0 and 1, e.g. 0.95")
    inside = int(probability * count + 0.5)
    if inside >= count - 1:
        raise InputError(f"--trials: found {count}; allowed: at least {math.ceil(10 / (1 - probability))} for p = {probability:g}")
    return count, inside


def factor(probability: float, dof: Array | float = math.inf) -> Array:
    """p, (q,) degrees of freedom → (q,) coverage factors of single outputs (JCGM 100:2008, G.3)."""
    dof = np.asarray(dof, dtype=float)
    tail = (1 - probability) / 2
    return np.asarray(-np.where(np.isfinite(dof), special.stdtrit(np.where(np.isfinite(dof), dof, 1.0), tail), special.ndtri(tail)))


def ellipsoid_factor(outputs: int, probability: float) -> float:
    """q, p → k_p of the hyper-ellipsoid (y − η)ᵀ U⁻¹ (y − η) ≤ k_p² (JCGM 102:2011, 6.5.2 and 6.5.3)."""
    return float(math.sqrt(special.chdtri(outputs, 1 - probability)))


def independent_factor(outputs: int, probability: float) -> float:
    """q, p → k_q of the hyper-rectangle y ± k_q u when nothing is correlated; 2.6 for five outputs and p = 0.95."""
    return float(-special.ndtri((1 - probability ** (1 / outputs)) / 2))


def rectangle_factor(correlation: Array, probability: float, dof: float = math.inf, seed: int = 1) -> float:
    """(q, q) correlation, p → k_q such that all of y ± k_q u hold together with probability p; Student's t for finite dof.

    By 100 000 draws: about ±0.01. Between `factor` (all outputs move as one) and `independent_factor`.
    """
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.clip(values, 0, None))
    largest = np.empty(DRAWS)
    for at in range(0, DRAWS, 10_000):
        drawn = rng.standard_normal((10_000, len(correlation))) @ root.T
        if math.isfinite(dof):
            drawn *= np.sqrt(dof / rng.chisquare(dof, (10_000, 1)))
        largest[at : at + 10_000] = np.abs(drawn).max(axis=1)
    return float(np.quantile(largest, probability))


def rectangle_of(values: NDArray[np.floating[Any]], probability: float) -> float:
    """(T, q) deviations in standard uncertainties, p → k_q of the trials themselves (JCGM 102:2011, 7.7.3)."""
    return float(np.quantile(np.abs(values).max(axis=1), probability))


def ellipsoid_of(values: NDArray[np.floating[Any]], probability: float) -> float | None:
    """(T, q), p → k_p of the trials' own hyper-ellipsoid (JCGM 102:2011, 7.7.2); None when the outputs are not independent."""
    centred = values.astype(float) - values.mean(axis=0, dtype=float)
    covariance = centred.T @ centred / (len(values) - 1)
    scale = np.sqrt(np.diag(covariance))
    if np.any(scale == 0):
        return None
    size, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    if size[0] < 1e-10 * size[-1]:
        return None
    white = (centred / scale) @ (vectors / np.sqrt(size))
    return float(np.sqrt(np.quantile(np.sum(white**2, axis=1), probability)))


def tolerance(uncertainty: Array | float, digits: int) -> Array:
    """standard uncertainties, significant digits (1 or 2) → δ = ½·10^l when u is written c·10^l (JCGM 101:2008, 7.9.2)."""
    u = np.asarray(uncertainty, dtype=float)
    safe = np.where(u > 0, u, 1.0)
    power = np.floor(np.log10(safe))
    rounded = np.round(safe / 10.0 ** (power - digits + 1))
    power = np.where(rounded >= 10.0**digits, power + 1, power)
    return np.asarray(np.where(u > 0, 0.5 * 10.0 ** (power - digits + 1), 0.0))


@dataclass(frozen=True)
class Validation:
    """The comparison of JCGM 101:2008 clause 8 for each output; lengths in the outputs' own units."""

    tolerance: Array  # (q,) δ
    low: Array  # (q,) |difference of the low ends|
    high: Array  # (q,)
    std_ratio: Array  # (q,) standard deviation of the trials over the propagated standard uncertainty

    @property
    def agrees(self) -> np.ndarray:
        """→ (q,) whether both ends agree within δ."""
        return np.asarray((self.low <= self.tolerance) & (self.high <= self.tolerance))


def validate(
    std: Array, deviation: NDArray[np.floating[Any]], probability: float, digits: int, dof: Array | float = math.inf
) -> Validation:
    """(q,) propagated u, (T, q) trials in units of u, p, digits, dof → validation: y ± k u against the trials' interval."""
    low, high = symmetric(deviation, probability)
    k = factor(probability, dof)
    free = np.asarray(dof, dtype=float)
    # Student's t of ν degrees of freedom is wider than its standard uncertainty by this much, without any nonlinearity.
    expected = np.sqrt(1 / (1 - 2 / np.maximum(free, 2.5)))
    ratio = np.std(deviation, axis=0, dtype=float) / expected
    return Validation(tolerance(std, digits), np.abs(low + k) * std, np.abs(high - k) * std, ratio)


@dataclass(frozen=True)
class Adaptive:
    """How the adaptive procedure ended."""

    trials: Trials
    blocks: int
    stable: bool


def adaptive(
    more: Callable[[int], Trials], std: Array, probability: float, digits: int, largest: int, joint: list[int] | None = None
) -> Adaptive:
    """block number → its trials, u (q,), p, digits, most blocks → trials until the results are stable to the numerical tolerance.

    A block has max(10⁴, 100/(1 − p)) trials. Stable: twice the standard deviation of the mean over the blocks is below δ, for
    y, u and both ends of every output (JCGM 101:2008, 7.9.4), and for the largest eigenvalue of the correlation matrix and
    k_q of the outputs `joint` (all when None) (JCGM 102:2011, 7.8.3).
    """
    blocks: list[Trials] = []
    results = []
    deltas = np.concatenate([np.tile(tolerance(std, digits) / np.where(std > 0, std, 1.0), 4), [0.0, 0.0]])
    while len(blocks) < largest:
        blocks.append(more(len(blocks)))
        values = blocks[-1].deviation
        own = values if joint is None else values[:, joint]
        low, high = symmetric(values, probability)
        biggest = float(np.linalg.eigvalsh(np.corrcoef(own.T.astype(float)).reshape(own.shape[1], -1))[-1])
        joined = rectangle_of(own, probability)
        row = [values.mean(axis=0, dtype=float), values.std(axis=0, dtype=float), low, high, [biggest, joined]]
        results.append(np.concatenate(row))
        deltas[-2:] = tolerance(np.array([biggest, joined]), digits)
        if len(blocks) > 1:
            spread = np.std(results, axis=0, ddof=1) / math.sqrt(len(results))
            if np.all(2 * spread <= deltas + (deltas == 0)):
                return Adaptive(merge(blocks), len(blocks), True)
    return Adaptive(merge(blocks), len(blocks), False)


def block_size(probability: float) -> int:
    """p → trials in one block of the adaptive procedure (JCGM 101:2008, 7.9.4 b)."""
    return max(10_000, math.ceil(100 / (1 - probability)))
