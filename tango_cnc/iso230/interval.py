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
STEEPEST = 9.0  # power by which draws count, of a volume: three scales, three squarenesses, and the turns of three axes
STEEPEST_TURNED = 5.0  # the same of a rotary axis
PART = 0.4, 0.75  # of what the learned directions add that counts as noise of what was read: to a range, to the longest vector
HALF = 0.5
ABOVE = 0.2  # of that power, for the ends above a volume: of simple motions noise is less of a range, and nobody knows the order
NEAR = 0.25  # of a deviation: so near to what was read, scatter moves a range evenly, and bends it by a little
NARROW = 1e-3  # of the largest: what is smaller counts as much


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
    return _from_nothing(Spread(best, low, high, least, most), float(np.ptp(read)), nothing, tail)


def of_volume(curves: Array, free: Array, coverage: float = 0.95) -> Spread:
    """curves that are possible (m, d), or vectors (m, 3, d); by how much each differs from their mean in what the touches alone
    decide, alike → largest minus smallest, or the longest, of them.

    Noise in k directions makes a range larger, once in what is read and once more in what is drawn around it. Draws count by
    range^(1 − k): then noise takes a range to neither side. k is found from how much noise enlarges the range that was read: all
    of the free directions, and a part of those whose size was learned, as three axes say little of each other's size. A vector has
    the noise of three components. Where a range is many times its uncertainty, k is large and few draws would count: beyond the
    largest power the ends are moved instead, by as much as the rest of the power moves a normal distribution. One or two bad
    guides are such a machine. How much of that is noise depends on the order of the motions: where all are polynomials to degree
    3, the whole power takes ranges below what is true. So the ends above have a part of it, and are not moved.
    Source: Stein, Annals of Mathematical Statistics 30, 1959; Tibshirani, Biometrika 76, 1989.
    """
    sizes, mean = _sizes(curves), curves.mean(axis=-1, keepdims=True)
    part = PART[0 if curves.ndim == 2 else 1]
    grown = (1 - part) * _grown(mean, free) + part * _grown(mean, curves - mean)
    return _counted(curves, sizes, grown, float(np.var(sizes)), STEEPEST, coverage, ABOVE, True)


def of_turned(curves: Array, coverage: float = 0.95) -> Spread:
    """curves of a rotary axis that are possible (m, d) → largest minus smallest of them, which noise makes too large as a volume.

    Half of the power counts: the harmonics that no touch shows are drawn with the others, and are no noise of what was read.
    """
    sizes, mean = _sizes(curves), curves.mean(axis=-1, keepdims=True)
    up, down = (_sizes(mean + s * NEAR * (curves - mean)) for s in (1, -1))
    grown = HALF * _grown(mean, NEAR * (curves - mean)) / NEAR**2
    return _counted(curves, sizes, grown, float(np.var(up - down)) / (2 * NEAR) ** 2, HALF * STEEPEST_TURNED, coverage)


def _grown(mean: Array, noise: Array) -> float:
    """curve as read (m, 1) or (m, 3, 1), what may be added to it (… d) → by how much that makes it larger, on average."""
    return float(sum(_sizes(mean + s * noise).mean() for s in (1, -1)) / 2 - _sizes(mean)[0])


def _counted(
    curves: Array,
    sizes: Array,
    grown: float,
    scatter: float,
    steepest: float,
    coverage: float,
    above: float = 1.0,
    moves: bool = False,
) -> Spread:
    """curves, sizes (d,), growth by noise, variance of the size, power at most, part of it for the ends above, whether what is
    beyond that power moves the ends → the spread of draws that count by a power.
    """
    tail, mean = (1 - coverage) / 2, curves.mean(axis=-1, keepdims=True)
    read = float(_sizes(mean)[0])
    if scatter <= 0.0:
        return Spread(*[read] * 5)
    whole = max(2 * read * grown / scatter, 0.0)
    by = min(whole, steepest)
    less = (whole - by) * scatter / read if moves and whole > by else 0.0
    low, least, best = (max(q - less, 0.0) for q in _quantiles(sizes, by, [tail, 2 * tail, 0.5]))
    most, high = _quantiles(sizes, above * by, [1 - 2 * tail, 1 - tail])
    return _from_nothing(Spread(best, low, high, least, most), read, _sizes(curves - mean), tail)


def _quantiles(sizes: Array, by: float, shares: list[float]) -> list[float]:
    """(d,) sizes of draws, power, shares → the sizes below which such shares of them are, when they count by size^−power."""
    order = np.argsort(sizes)
    worth = np.maximum(sizes[order] / sizes.max(), NARROW) ** -by
    at = (np.cumsum(worth) - worth / 2) / worth.sum()
    return [float(v) for v in np.interp(shares, at, sizes[order])]


def _from_nothing(found: Spread, read: float, nothing: Array, tail: float) -> Spread:
    """range, size as read, sizes of noise alone (d,), share in one tail → the same; from 0 where noise may be read as it.

    The limit of one side begins at 0 with the interval: a figure that may be nothing is not rejected.
    """
    return found._replace(low=0.0, least=0.0) if read <= float(np.quantile(nothing, 1 - tail)) else found


def _sizes(curves: Array) -> Array:
    """(m, d) → (d,) largest minus smallest; (m, 3, d) → the longest."""
    return np.asarray(np.ptp(curves, axis=0) if curves.ndim == 2 else np.linalg.norm(curves, axis=1).max(axis=0))


def of_range(mean: Array, root: Array, coverage: float = 0.95) -> tuple[float, float, float]:
    """curve (m,), root (m, k) of its covariance → median of the range, ends of its interval, in the unit of the curve."""
    rng = np.random.default_rng(230)
    found = of_drawn(mean[:, None] + root @ rng.normal(size=(root.shape[1], DRAWS)), mean, root, coverage)
    return found.best, found.low, found.high
