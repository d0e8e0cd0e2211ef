"""Residuals, Jacobian and candidates, plain arrays → what is in the residuals. Machines and tables from elsewhere share it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from ..records import Array
from ._alike import alike
from ._candidates import VISIBLE, Candidate
from ._catalogue import (
    Catalogue,
    Chosen,
    Compatible,
    Limits,
    Plausible,
    Rebuild,
    calibrate,
    catalogue,
    columns_of,
    kind,
    p_value,
    refined,
    total,
)
from ._search import CLOSE, FEW, UNDECIDED, best_addition, ranked, rival, select
from ._space import Space, below, best_noise, fine_noise, level, orthonormal, space

SHARE = 0.25  # of what a nameless shape explains: named companions that explain less only mop up behind it
DECISIVE = 10.0  # difference of scores above which the better of two names stands alone (Kass & Raftery 1995: very strong)
SUSPECT = 0.05  # probability by chance below which a group of rows gets less weight
ROUGH = 0.001  # and below which it is called rough: what a named pattern leaves of its own is not
LIGHTEST = 0.1  # weight of a row
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
    expected: Mapping[str, tuple[str, ...]] | None = None,
    plainer: Mapping[str, tuple[str, ...]] | None = None,
    twins: Mapping[str, tuple[str, ...]] | None = None,
    seed: int = 0,
) -> Explanation:
    """residuals (n + known,), Jacobian (n + known, p), candidates, noise kernels (n, n) → explanation.

    The rows are weighted so that white noise is equal on all of them; the first n are touches, on which candidates act.
    """
    place = space(residual, jacobian, n, kernels)
    cat, seen = catalogue(place, candidates, refine, rebuild, VISIBLE, plausible, compatible, steady, expected, plainer, twins)
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
    return p_value(
        e.limits,
        float(e.usual[e.catalogue.causes.index(cause)]),
        cause,
        gain(e.place, e.chosen, one),
        cause in e.catalogue.expected,
    )


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
    listed = {one.candidate.cause, *(o.candidate.cause for o, _ in result)}
    for cause in dict.fromkeys(e.catalogue.expected.get(one.candidate.cause, ())):
        # What was named because it is expected may stand where a rival does as well without being significant itself.
        if cause in e.catalogue.causes and cause not in listed:
            other = rival(e.place, e.catalogue, cause, selected, settings[-1])[1]
            behind = best - total(e.place, [*others, other])
            if behind < UNDECIDED:
                result.append((other, behind))
    for cause in _family(e.catalogue, one.candidate.cause):
        if cause in [o.candidate.cause for o, _ in result]:
            continue
        other = rival(e.place, e.catalogue, cause, selected, settings[-1])[1]
        behind = best - total(e.place, [*others, other])
        if behind < DECISIVE:
            result.append((other, behind))
    every = alike(e.place, e.catalogue, one, others, best, result)
    return sorted((pair for pair in every if pair[1] < DECISIVE), key=lambda pair: pair[1])


def _family(cat: Catalogue, cause: str) -> list[str]:
    """catalogue, a cause → its twins; of a twin the cause in whose place it stands, and the other twins of that."""
    families = [(first, *twins) for first, twins in cat.twins.items() if cause in (first, *twins)]
    return [c for c in dict.fromkeys(name for one in families for name in one) if c != cause and c in cat.causes]


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
    # All columns of one length: a time constant moves a touch by millionths of a mm a second, and is no null space for that.
    length = np.linalg.norm(design, axis=0)
    length = np.where(length > 0, length, 1.0)
    design = design / length
    inverse = np.linalg.pinv(design.T @ design, rcond=1e-12) / length / length[:, None]
    return solution, np.asarray(e.sigma**2 * inverse, dtype=float)


def sizes(e: Explanation) -> list[tuple[Chosen, Array]]:
    """explanation → its chosen causes, each with its values beside all the others; no outliers, no shapes."""
    if not e.chosen:
        return []
    solution, _ = values(e, {})
    ends = np.cumsum([c.columns.shape[1] for c in e.chosen])[:-1]
    return [(c, v) for c, v in zip(e.chosen, np.split(solution, ends), strict=True) if c.candidate.named]


@dataclass(frozen=True)
class Rough:
    """Rows that scatter more than the others: their key, standard deviation that is added, the probability of it by chance, and
    the weight that makes them as white as the others.
    """

    key: str
    extra: float
    p_value: float
    weight: float


def rough(e: Explanation, keys: Sequence[str], weight: Array, shapes: Array | None = None) -> list[Rough]:
    """explanation, group (n,) and weight (n,) of every row, `rest`'s shapes → groups that may scatter more (χ², 5 % over all).

    A few outliers of a group, or a chip, may have followed its scatter: likelihoods with their prices decide which it is.
    """
    label = np.array(keys)
    groups = dict.fromkeys(keys)
    left, own = rest(e, e.chosen, weight, shapes)
    free_rows = own > 0.2  # a row that nothing else checks has no residual, and would make the usual scatter look small
    middle = float(np.median(left[free_rows] ** 2 / own[free_rows])) / 0.455 if free_rows.any() else np.inf
    scale = min(middle, e.sigma**2)
    plain, free = rest(e, [c for c in e.chosen if not narrow(c)], weight, shapes)
    price = float(np.log(e.place.m) + 2 * np.log(len(groups)))
    for k in groups:
        on = label == k
        patterns = sum(c.price for c in e.chosen if narrow(c) and np.abs(c.candidate.columns[on]).sum() > 0)
        if not patterns:
            continue
        squares = float(np.sum(left[on] ** 2)) / scale, float(np.sum(plain[on] ** 2)) / scale
        scatter = [_scattered(r, float(d[on].sum())) - price for r, d in zip(squares, (own, free), strict=True)]
        if scatter[1] > squares[1] - squares[0] - patterns + max(scatter[0], 0.0):
            left[on], own[on] = plain[on], free[on]
    found = []
    for k in groups:
        dof = float(own[label == k].sum())
        if dof < 2.5:
            continue
        ratio = float(np.sum(left[label == k] ** 2)) / dof / scale
        p = float(special.chdtrc(dof, dof * ratio)) * len(groups)
        if p < SUSPECT and ratio > 1.8:
            found.append(Rough(k, float(np.sqrt(scale * (ratio - 1))), p, float(max(1 / np.sqrt(ratio), LIGHTEST))))
    return found


def _scattered(rest: float, dof: float) -> float:
    """sum of squares over the usual variance, degrees of freedom → twice the log likelihood that a variance of its own adds."""
    ratio = rest / max(dof, 1e-9)
    return dof * (ratio - 1 - float(np.log(ratio))) if ratio > 1 else 0.0


def narrow(c: Chosen) -> bool:
    """candidate → whether it touches so few rows that single wild ones could be it."""
    return bool(c.candidate.cause) and int(np.any(c.candidate.columns != 0, axis=1).sum()) <= FEW


def rest(e: Explanation, chosen: Sequence[Chosen], weight: Array, shapes: Array | None = None) -> tuple[Array, Array]:
    """explanation, patterns, weights → what is left of every row, its weight undone, and how much of its own noise is in it.

    `shapes` (m, m) is a covariance beside the white noise, of variance 1, instead of that of the kernels.
    """
    root = e.place.setting(e.ratios).root
    if shapes is not None:
        root = linalg.solve_triangular(np.linalg.cholesky(np.eye(e.place.m) + shapes), np.eye(e.place.m), lower=True)
    white = root @ e.place.y
    basis = orthonormal(root @ columns_of(e.place, chosen))
    white = white - basis @ (basis.T @ white)
    back = e.place.basis @ root.T
    own = np.sum(back**2, axis=1) - np.sum((back @ basis) ** 2, axis=1)
    return np.asarray(back @ white) / weight, np.asarray(own)


__all__ = [
    "Explanation",
    "Rough",
    "alternatives",
    "best_addition",
    "explain",
    "gain",
    "honest",
    "kind",
    "narrow",
    "rest",
    "rough",
    "significance",
    "sizes",
    "values",
]
