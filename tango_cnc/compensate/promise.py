"""What an estimate leaves undecided of an error → draws of what is truly left, their rms and quantiles with intervals.

What is taken was estimated, so its scatter stays. What is left was estimated, too, and its scatter makes it look larger than it is:
in directions in which an estimate is hardly more than its scatter, what is left is drawn towards zero. How far, the estimate itself
cannot say, so the width of the prior is drawn, too, from a half-Cauchy distribution (the horseshoe of Carvalho, Polson and Scott
2010, Biometrika 97, 465). No single width of that keeps its promise for errors of every size. A narrow one is right about how
little may be left, so the lower ends are its. How much may be left, no prior is right about: where the control leaves a single
direction open, whose error is some times its scatter, even a wide one draws it too near to zero. So the upper ends have none. The
value itself is the middle of the narrow and the wide one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..records import Array

DRAWS = 1000
PROBABILITY = 0.95
NARROW, WIDE = 1.0, 3.0  # scale of the width that the prior of a direction may have, in units of its scatter
WIDTHS = np.geomspace(1e-4, 1e8, 481)  # their squares
LEAST = 0.1  # of a direction's effect: where less is left, nothing but its scatter counts


@dataclass(frozen=True)
class Figure:
    """A number of µm with the interval that holds it with `PROBABILITY`."""

    value: float
    low: float
    high: float


def likely(
    values: Array, covariance: Array, levers: Array, left: Array, rest: Array | None = None, freedom: float | None = None
) -> Array:
    """(p,) (p, p) estimate, (3n, p) tip error of every coefficient, the part that stays → (k, m, n) mm, draws of what is left.

    `rest`: (3n,) mm that stays in every draw; `freedom`: degrees of it by which the scatter was estimated (default: it is known),
    so that draws have Student's distribution (JCGM 101:2008, 6.4.9). Each draw is at n poses drawn anew: a volume is known by some
    of its poses. k: by a narrow prior, by a wide one, by none; a single one where nothing is left that a prior could tell about.
    """
    root = _root(covariance)
    felt = left @ root
    size, turn = np.linalg.eigh(felt.T @ felt)  # by how much each is felt: independent of each other
    way = root @ turn
    open_ = size > LEAST**2 * np.sum((levers @ way) ** 2, axis=0)
    std = np.sqrt(np.diag(covariance))  # so that mm and rad weigh alike
    seen = np.linalg.lstsq(way / std[:, None], values / std, rcond=1e-12)[0]
    rng = np.random.default_rng(1)
    share, normal = _even(rng, len(seen)), special.ndtri(_even(rng, len(seen)))
    if freedom is not None:
        normal *= np.sqrt(freedom / 2 / special.gammaincinv(freedom / 2, _even(rng, 1)))  # one scatter for all directions of a draw
    # left @ drawn + (levers - left) @ (drawn - seen): what is gone leaves its scatter.
    stays = (levers - left) @ (way @ seen) - (0.0 if rest is None else rest)
    found = []
    for scale in (NARROW, WIDE, None) if open_.any() else (None,):
        kept = np.ones_like(normal)
        if scale is not None:
            wide = _widths(seen[open_], share[open_], scale)
            kept[open_] = wide / (1 + wide)
        drawn = kept * seen[:, None] + np.sqrt(kept) * normal
        found.append(sizes((way @ drawn).T, levers, stays))
    return np.array(found)


def there(values: Array, covariance: Array, levers: Array, gone: Array | None = None, freedom: float | None = None) -> Array:
    """(p,) (p, p) estimate, (3n, p) tip error of every coefficient → (k, m, n) mm, draws of the error as it is now.

    `gone`: (3n,) mm that the control takes away and the readings do not contain. What is left of it is drawn towards zero, not all
    of it. A sum of estimate and scatter would contain the scatter twice: the estimate has it already.
    """
    if gone is None or not gone.any():
        return likely(values, covariance, levers, levers, freedom=freedom)
    known = np.linalg.lstsq(levers, gone, rcond=1e-9)[0]
    return likely(values - known, covariance, levers, levers, levers @ known - gone, freedom)


def _even(rng: np.random.Generator, rows: int) -> Array:
    """generator, k → (k, m) probabilities in random order, one in each m-th of 0 … 1: tails are drawn as often as they are likely.

    By plain draws 2.1 to 3.0 % were beyond ends that 2.5 % should be beyond (Latin hypercube: McKay, Beckman and Conover
    1979, Technometrics 21, 239).
    """
    order = np.argsort(rng.random((rows, DRAWS)), axis=1)
    return np.asarray((order + rng.random((rows, DRAWS))) / DRAWS)


def sizes(drawn: Array, levers: Array, less: Array) -> Array:
    """(m, p) draws, (3n, p), (3n,) mm taken off → (m, n) mm, lengths of the vectors, each draw at poses drawn anew."""
    square = np.zeros((len(drawn), len(levers) // 3))
    part = np.empty_like(square)
    for c in range(3):
        np.matmul(drawn, levers[c::3].T, out=part)
        part -= less[c::3]
        part *= part
        square += part
    np.take(square, _again(*square.shape), out=part, mode="clip")  # any other mode makes a copy first
    return np.sqrt(part, out=part)


@lru_cache(maxsize=2)
def _again(draws: int, poses: int) -> NDArray[np.intp]:
    at = np.random.default_rng(2).integers(0, poses, size=(draws, poses))
    return np.asarray(at + np.arange(draws)[:, None] * poses)


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))


def _widths(seen: Array, shares: Array, scale: float) -> Array:
    """(p,) estimates and (p, m) shares 0 … 1, scale → (p, m) variances of their priors, drawn at these shares; scatter 1.

    Logarithms of the variances are evenly spaced, so that each weighs its density times itself.
    """
    weight = np.log(np.sqrt(WIDTHS) / (scale**2 + WIDTHS)) - 0.5 * (np.log(1 + WIDTHS) + (seen**2)[:, None] / (1 + WIDTHS))
    most = np.cumsum(np.exp(weight - weight.max(axis=1, keepdims=True)), axis=1)
    at = [np.searchsorted(own, share * own[-1]) for own, share in zip(most, shares, strict=True)]
    return np.asarray(WIDTHS[np.minimum(np.array(at, dtype=np.intp).reshape(shares.shape), len(WIDTHS) - 1)])


def mean(lengths: Array) -> Figure:
    """(k, m, n) mm, draws of lengths → their rms with interval, µm."""
    return interval(np.sqrt(np.mean(lengths**2, axis=-1)) * 1e3)


def most(lengths: Array) -> Figure:
    """(k, m, n) mm, draws of lengths → what 95 % of the poses are below, with interval, µm."""
    return interval(np.quantile(lengths, 0.95, axis=-1) * 1e3)


def with_programs(lengths: Array, increment: float) -> Figure:
    """(k, m, n) mm, draws of what programs leave, mm that words are rounded to → rms with interval, µm."""
    rounded = 3 * (increment / np.sqrt(12)) ** 2  # three words of a block, each rounded
    return interval(np.sqrt(np.mean(lengths**2, axis=-1) + rounded) * 1e3)


def interval(draws: Array) -> Figure:
    """(k, m) → the middle of the first two; the lower end of the first ones, the upper end of the last ones."""
    low, high = (1 - PROBABILITY) / 2, (1 + PROBABILITY) / 2
    return Figure(float(np.median(draws[:2])), float(np.quantile(draws[0], low)), float(np.quantile(draws[-1], high)))
