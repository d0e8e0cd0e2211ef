"""Residuals, Jacobian and candidates, plain arrays → what is in the residuals. Machines and tables from elsewhere share it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, stats

from ..records import Array
from ._candidates import VISIBLE, Candidate
from ._search import (
    CLOSE,
    Catalogue,
    Chosen,
    Compatible,
    Limits,
    Plausible,
    Rebuild,
    best_addition,
    calibrate,
    catalogue,
    columns_of,
    kind,
    p_value,
    ranked,
    refined,
    select,
    total,
)
from ._space import Space, below, best_noise, fine_noise, level, space

SHARE = 0.25  # of what a nameless shape explains: named companions that explain less only mop up behind it
DECISIVE = 10.0  # difference of scores above which the better of two names stands alone (Kass & Raftery 1995: very strong)
RANDOM = 10.0  # twice the log likelihood ratio above which wandering or seating is more than white noise (p < 0.001)


@dataclass(frozen=True)
class Explanation:
    """What was chosen, and everything that later questions need."""

    place: Space
    catalogue: Catalogue
    limits: Limits
    usual: Array
    chosen: tuple[Chosen, ...]
    named: tuple[Chosen, ...]  # those of them that may be called by their names
    ratios: tuple[float, ...]  # of the noise kernels that are left
    sigma: float  # white noise that is left, in the unit of the residuals
    random: tuple[float, ...]  # twice the log likelihood ratio of each kernel
    visibility: Mapping[str, float]


def explain(
    residual: Array,
    jacobian: Array,
    n: int,
    candidates: Sequence[Candidate],
    kernels: Sequence[Array],
    refine: Mapping[str, Mapping[str, str]],
    rebuild: Rebuild,
    plausible: Plausible = lambda candidate, values: True,
    compatible: Compatible = lambda candidate, others: True,
    steady: bool = False,
    seed: int = 0,
) -> Explanation:
    """residuals (n + known,), Jacobian (n + known, p), candidates, noise kernels (n, n) → explanation.

    The rows are weighted so that white noise is equal on all of them; the first n are touches, on which candidates act.
    """
    place = space(residual, jacobian, n, kernels)
    cat, seen = catalogue(place, candidates, refine, rebuild, VISIBLE, plausible, compatible, steady)
    visibility: dict[str, float] = {}
    for c, value in zip(candidates, seen, strict=True):
        if c.named:
            visibility[c.cause] = max(visibility.get(c.cause, 0.0), float(value))
    limits, usual = calibrate(place, cat, seed)
    chosen = select(place, cat, limits, usual)
    named = honest(place, chosen)
    selected = columns_of(place, chosen)
    ratios, sigma = fine_noise(place, selected)
    return Explanation(place, cat, limits, usual, tuple(chosen), tuple(named), ratios, sigma, _random(place, selected), visibility)


def gain(place: Space, chosen: Sequence[Chosen], one: Chosen) -> float:
    """chosen, one of them → what it adds to the score."""
    return total(place, chosen) - total(place, [c for c in chosen if c is not one])


def honest(place: Space, chosen: Sequence[Chosen]) -> list[Chosen]:
    """chosen → those that may be named: beside a large shape without a name small names only mop up what it leaves."""
    shapes = [gain(place, chosen, c) for c in chosen if c.candidate.cause == ""]
    least = SHARE * max(shapes, default=0.0)
    return [c for c in chosen if c.candidate.named and (not shapes or gain(place, chosen, c) > least)]


def _random(place: Space, selected: Array) -> tuple[float, ...]:
    _, best = best_noise(place, selected)
    result = []
    for i in range(len(place.kernels)):
        without = [float(level(place, r, place.y, selected)[2][0]) for r in place.grid() if r[i] == 0]
        result.append(2 * (best - max(without)))
    return tuple(result)


def significance(e: Explanation, one: Chosen) -> float:
    """explanation, one of the chosen → probability that noise alone does as much anywhere in the catalogue."""
    cause = one.candidate.cause
    return p_value(e.limits, float(e.usual[e.catalogue.causes.index(cause)]), cause, gain(e.place, e.chosen, one))


def alternatives(e: Explanation, one: Chosen) -> list[tuple[Chosen, float]]:
    """explanation, a named one → other causes that would explain nearly as much in its place, and how much less."""
    others = [c for c in e.chosen if c is not one]
    selected = columns_of(e.place, others)
    found, _ = ranked(e.place, e.catalogue, others, e.limits, e.usual)
    settings = below(best_noise(e.place, selected)[0])
    best = total(e.place, e.chosen)
    result = []
    reach = max(3 * CLOSE, 0.2 * abs(found[0][0])) if found else 0.0
    for score, block in found[:10]:
        c = e.catalogue.candidates[block]
        if not c.named or c.cause == one.candidate.cause or score < found[0][0] - reach:
            continue
        other = refined(e.place, e.catalogue, c, selected, settings)
        behind = best - total(e.place, [*others, other])
        if behind < DECISIVE:
            result.append((other, behind))
    return sorted(result, key=lambda pair: pair[1])


def values(e: Explanation, tangents: Mapping[int, Array]) -> tuple[Array, Array]:
    """explanation, extra columns (m, t) for the shape parameters → values and covariance of all chosen columns, extra ones last.

    The extra columns are the change of a chosen pattern with its shape parameter: their values are near zero, and leaving
    them free makes the uncertainty of a size honest about a time constant that is not known.
    """
    selected = columns_of(e.place, e.chosen)
    every = np.hstack([selected, *tangents.values()]) if tangents else selected
    root = e.place.setting(e.ratios).root
    design = root @ every
    solution = np.asarray(linalg.lstsq(root @ selected, root @ e.place.y)[0])
    covariance = np.asarray(e.sigma**2 * np.linalg.pinv(design.T @ design, rcond=1e-12), dtype=float)
    return solution, covariance


@dataclass(frozen=True)
class Rough:
    """Rows that scatter more than the others: their key, standard deviation that is added, and the probability of it by chance."""

    key: str
    extra: float
    p_value: float


def rough(e: Explanation, keys: Sequence[str]) -> list[Rough]:
    """explanation, group (n,) of every row → groups that scatter more than the rest (chi-squared, 1 % over all groups)."""
    root = e.place.setting(e.ratios).root
    white = root @ e.place.y
    basis = np.linalg.qr(root @ columns_of(e.place, e.chosen))[0] if e.chosen else np.empty((e.place.m, 0))
    white = white - basis @ (basis.T @ white)
    # What is left of every row, and how much of its own noise is in it.
    back = e.place.basis @ root.T
    left = back @ white
    own = np.sum(back**2, axis=1) - np.sum((back @ basis) ** 2, axis=1)
    label = np.array(keys)
    middle = float(np.median(left**2 / np.maximum(own, 1e-3))) / 0.455
    scale = min(middle, e.sigma**2) or e.sigma**2
    groups = [k for k in dict.fromkeys(keys) if own[label == k].sum() > 2.5]
    found = []
    for k in groups:
        dof = float(own[label == k].sum())
        ratio = float(np.sum(left[label == k] ** 2)) / dof / scale
        p = float(stats.chi2.sf(dof * ratio, dof)) * len(groups)
        if p < 0.01 and ratio > 1.8:
            found.append(Rough(k, float(np.sqrt(scale * (ratio - 1))), p))
    return found


__all__ = [
    "Explanation",
    "Rough",
    "alternatives",
    "best_addition",
    "explain",
    "gain",
    "honest",
    "kind",
    "rough",
    "significance",
    "values",
]
