"""Shapes that won against the names → what people read: covariates, size, how much touches that were not fitted gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ..texts import say
from ..touches import Touches
from ._catalogue import Chosen, columns_of
from ._changing import over
from ._closed import closed
from ._contest import Outcome, refinement
from ._explain import DECISIVE, Explanation, gain
from ._field import Picked
from ._gain import rms
from ._records import Again, Remainder
from ._rows import Rows
from ._space import orthonormal

ALIKE = 0.75  # correlation from which a shape is one that was learned: more than half of the variance is common


def remainders(
    e: Explanation,
    outcome: Outcome,
    means: Rows,
    weight: Array,
    accepted: Sequence[Chosen],
    base: Array,
    data: Array,
    schemes: Mapping[str, NDArray[np.int64]],
    keep: NDArray[np.bool_],
    learned: Mapping[str, str | None] = MappingProxyType({}),
) -> list[Remainder]:
    """explanation, outcome of the contest, days of learned shapes by name → shapes without a name, the largest first."""
    if not outcome.shapes:
        return []
    fixed = [c for c in e.chosen if c.candidate.cause == "outlier"]
    names = columns_of(e.place, [*fixed, *accepted])
    sigma = spread(e.place.y, names, outcome.picked)
    each = posterior(e.place.y, names, outcome.picked, sigma)
    basis = orthonormal(base)
    result = []
    for p, (w, covariance) in zip(outcome.picked, each, strict=True):
        if p.kernel.kind != "shape" or refinement(p, accepted):
            continue
        columns = p.kernel.columns
        whole = np.vstack([columns, np.zeros((len(base) - len(columns), columns.shape[1]))])
        left = (whole - basis @ (basis.T @ whole))[: len(columns)]
        pattern = left @ w / means.scale
        row = int(np.argmax(np.abs(pattern)))
        std = float(np.sqrt(max(left[row] @ covariance @ left[row], 0.0))) / float(means.scale[row])
        if p.kernel.form is None:
            about = str(p.kernel.setting["covariate"]), "none", "changing", float(np.abs(pattern[row]))
            share = gained(e, names, outcome.picked, p, schemes["indexations"], keep, weight)
            like = str(p.kernel.setting["like"])
            result.append(Remainder(*about, share, pattern, std, touch=int(means.first[row]), confirm=like, rivals=p.rivals))
            continue
        formula, plain = closed(
            p.kernel.form,
            means,
            left @ w,
            lambda x: x - basis[: len(x)] @ (basis[: len(x)].T @ x),
            left * p.kernel.scale,
        )
        result.append(
            Remainder(
                *(p.kernel.form.covariate, p.kernel.form.frame, p.kernel.form.factors[0].kind),
                float(np.abs(pattern[row])),
                gained(e, names, outcome.picked, p, schemes["indexations"], keep, weight),
                pattern,
                std,
                p.kernel.form,
                w / p.kernel.scale,
                int(means.first[row]),
                formula,
                confirm(p, means.seen, pattern),
                rivals=p.rivals,
                plain=plain,
            )
        )
    result.sort(key=lambda r: -float(r.pattern @ r.pattern))
    for c in e.catalogue.candidates:
        if c.learned and not any(a.candidate is c for a in accepted):
            whole = np.concatenate([c.columns[:, 0] / weight, np.zeros(len(base) - len(weight))])
            before = (whole - basis @ (basis.T @ whole))[: len(weight)] / means.scale
            name = str(c.setting["name"])
            result = recognised(result, before, name, learned.get(name))
    return result


def recognised(now: Sequence[Remainder], before: Array, name: str, day: str | None) -> list[Remainder]:
    """shapes of these touches, one that was learned before (n,) as the model leaves it → the shapes, one of them recognised.

    What was learned in another order of the touches is not known where the model took it there: it agrees in part and is no
    term that does as well, but the same thing. Two shapes of now may together be one of then.
    """
    length = float(before @ before)
    if not now or not length:
        return list(now)

    def agreement(pattern: Array) -> float:
        return float(pattern @ before) / float(np.sqrt(length * max(float(pattern @ pattern), 1e-300)))

    each = [agreement(r.pattern) for r in now]
    best = int(np.argmax(each))
    together = agreement(np.sum([r.pattern for r in now], axis=0))
    if max(each[best], together) < ALIKE:
        return list(now)
    own, pattern = (best, now[best].pattern) if each[best] >= together else (0, np.sum([r.pattern for r in now], axis=0))
    if now[own].again is not None and now[own].again.agreement > max(each[best], together):  # type: ignore[union-attr]
        return list(now)
    found = Again(name, float(pattern @ before) / length, max(each[best], together), day)
    return [replace(r, again=found) if i == own else r for i, r in enumerate(now)]


def unnamed(kind: str, amplitude: float, n: int) -> Remainder:
    """walk or seat, standard deviation at a touch in mm, number of touches → a spread of the machine that has no name."""
    covariate, shape = ("time", "random walk") if kind == "walk" else ("indexation", "seats")
    return Remainder(covariate, "machine", shape, amplitude, 0.0, np.zeros(n))


def refused(e: Explanation, names: Sequence[tuple[Chosen, float]], n: int) -> list[Remainder]:
    """explanation, names that nothing beat and that are not named all the same with their sizes, mm, number of touches → the
    surest of them: something is there.
    """
    sure = [(gain(e.place, [*e.chosen, *(() if any(c is o for o in e.chosen) else (c,))], c), c, size) for c, size in names]
    sure = [one for one in sure if one[0] > DECISIVE]
    if not sure:
        return []
    _, c, size = max(sure, key=lambda one: one[0])
    return [Remainder(over(c.candidate), "none", "unsure", size, 0.0, np.zeros(n), confirm=c.candidate.cause)]


def confirm(p: Picked, touches: Touches, pattern: Array) -> str:
    """shape, touches, what is visible of it (n,) → where it shows most, for a person."""
    row, other = int(np.argmax(pattern)), int(np.argmin(pattern))
    assert p.kernel.form is not None
    names = [f.covariate for f in p.kernel.form.factors]
    if "time" in names:
        return say("diagnosis_said.confirm_in_time")
    axes = [n for n in names if n in touches.machine.names]

    def place(i: int) -> str:
        turned = [a for a in touches.machine.names if a not in touches.machine.linear]
        at = [f"{a} {touches.axis(a)[i] if a not in turned else np.degrees(touches.axis(a)[i]):.0f}" for a in axes]
        if at:
            return say("diagnosis_said.facet_at", facet=touches.facet[i], at=" ".join(at))
        return say("diagnosis_said.facet_of_touch", facet=touches.facet[i], touch=touches.number[i])

    return say("diagnosis_said.confirm_there", one=place(row), other=place(other))


def posterior(y: Array, names: Array, picked: Sequence[Picked], sigma: float) -> list[tuple[Array, Array]]:
    """data (m,), columns of the names (m, s), shapes → (k,) weights of each and their covariance (k, k), all at once."""
    covariance = np.eye(len(y)) + sum(p.tau * p.columns @ p.columns.T for p in picked)
    lower = np.linalg.cholesky(covariance)
    inverse = np.linalg.inv(lower)
    basis = orthonormal(inverse @ names)
    white = inverse @ y
    white = white - basis @ (basis.T @ white)
    result = []
    for p in picked:
        own = inverse @ p.columns
        own = own - basis @ (basis.T @ own)
        known = p.tau * np.eye(own.shape[1]) - p.tau**2 * own.T @ own
        result.append((p.tau * own.T @ white, sigma**2 * known))
    return result


def spread(y: Array, names: Array, picked: Sequence[Picked]) -> float:
    """data (m,), names (m, s), shapes → standard deviation of the noise that is left."""
    covariance = np.eye(len(y)) + sum((p.tau * p.columns @ p.columns.T for p in picked), np.zeros((len(y), len(y))))
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    q = orthonormal(root @ names)
    white = root @ y
    white = white - q @ (q.T @ white)
    return float(np.sqrt(np.sum(white**2) / max(len(y) - names.shape[1], 1)))


def gained(
    e: Explanation,
    names: Array,
    picked: Sequence[Picked],
    one: Picked,
    groups: NDArray[np.int64],
    keep: NDArray[np.bool_],
    weight: Array,
) -> float:
    """→ part of the variance of touches whose indexation was not fitted that a shape takes beside everything else."""

    def errors(shapes: Sequence[Picked]) -> Array:
        m = len(e.place.y)
        covariance = np.eye(m) + sum((p.tau * p.columns @ p.columns.T for p in shapes), np.zeros((m, m)))
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        q = orthonormal(root @ names)
        back = e.place.basis @ (root - q @ (q.T @ root)).T
        precision = back @ back.T
        white = root @ e.place.y
        fitted = back @ (white - q @ (q.T @ white))
        result = np.zeros(len(fitted))
        for g in np.unique(groups):
            rows = np.flatnonzero(groups == g)
            result[rows] = np.linalg.pinv(precision[np.ix_(rows, rows)], rcond=0.1, hermitian=True) @ fitted[rows]
        return np.asarray(result / weight)[keep]

    without, with_it = (rms(errors(s)) for s in ([p for p in picked if p is not one], picked))
    return 1 - (with_it / without) ** 2 if without else 0.0


__all__ = ["remainders"]
