"""Variances of groups of touches, by restricted maximum likelihood: what the model leaves of a touch holds the noise of others.

A model with many parameters mixes the noise of its touches: residuals of a quiet facet hold that of a rough one. So variances are
compared in the space that the model leaves (Patterson & Thompson 1971), with shapes that were found as a covariance of their own.
Logarithms of the variances are normal around a common one, and are integrated out by Laplace's method (Tierney & Kadane 1986).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ..records import Array
from ._field import Picked
from ._space import orthonormal

SPREADS = (0.3, 0.6, 1.0, 1.5, 2.2)  # standard deviation of the logarithms of the variances
STEPS = 25
NEAR = 1e-2  # of a logarithm
FURTHEST = 1.0  # of a logarithm in one step


@dataclass(frozen=True)
class Left:
    """What the model, names and shapes leave of the touches."""

    basis: Array  # (n, m) of the space outside the model and the names
    y: Array  # (m,) data in it
    other: Array  # (m, m) covariance of shapes there
    residual: Array  # (n,) of every touch
    own: Array  # (n,) part of its own noise that is in it

    def without(self, more: Array) -> Left:
        """(n,) by which touches are too far away → the same without that."""
        return Left(self.basis, self.y - self.basis.T @ more, self.other, self.residual, self.own)


def left(basis: Array, y: Array, weight: Array, names: Array, picked: Sequence[Picked]) -> Left:
    """basis (n, m), data (m,), weight (n,) of the rows, columns of the names (m, s), shapes → what they leave, weights undone."""
    q = orthonormal(names)
    full = linalg.qr(q)[0][:, q.shape[1] :] if q.shape[1] else np.eye(len(y))
    outside, data = basis @ full, full.T @ y
    shapes = sum((p.tau * (part := full.T @ p.columns) @ part.T for p in picked), np.zeros((len(data), len(data))))
    root = linalg.solve_triangular(np.linalg.cholesky(np.eye(len(data)) + shapes), np.eye(len(data)), lower=True)
    white = root @ data
    back = outside @ root.T
    size = float(white @ white) / max(len(white), 1)
    return Left(outside * weight[:, None], data, size * shapes, (back @ white) / weight, np.sum(back**2, axis=1))


def evidence(left: Left, member: NDArray[np.int64]) -> float:
    """what is left, member (n,) of every touch → twice the log likelihood ratio of variances that differ between members."""
    number = np.unique(member, return_inverse=True)[1]
    count = int(number.max()) + 1
    on = np.zeros((len(number), count))
    on[np.arange(len(number)), number] = 1.0

    def at(logs: Array) -> tuple[float, Array, Array]:
        """(g,) logarithms of the variances → log likelihood, its gradient, and the information (g, g)."""
        v = np.exp(logs)
        lower = np.linalg.cholesky((left.basis * v[number][:, None]).T @ left.basis + left.other)
        white = linalg.solve_triangular(lower, left.y, lower=True, check_finite=False)
        half = linalg.solve_triangular(lower, left.basis.T, lower=True, check_finite=False)
        inverse = half.T @ half
        back = half.T @ white
        value = -float(np.log(np.diag(lower)).sum()) - 0.5 * float(white @ white)
        gradient = -0.5 * v * (on.T @ (np.diag(inverse) - back**2))
        return value, gradient, 0.5 * np.outer(v, v) * (on.T @ inverse**2 @ on)

    common = float(np.log(np.mean(left.y**2)))
    alike = 0.0
    for _ in range(STEPS):
        alike, gradient, information = at(np.full(count, common))
        step = float(np.clip(gradient.sum() / information.sum(), -FURTHEST, FURTHEST))
        common += step
        if abs(step) < NEAR:
            break
    best, logs = 0.0, np.full(count, common)
    for spread in SPREADS:
        around = (np.eye(count) - 1 / count) / spread**2
        for _ in range(STEPS):
            value, gradient, information = at(logs)
            step_of_each = np.linalg.solve(information + around, gradient - around @ logs)
            logs = logs + np.clip(step_of_each, -FURTHEST, FURTHEST)
            if float(np.abs(step_of_each).max()) < NEAR:
                break
        value, _, information = at(logs)
        sharp = float(np.linalg.slogdet(information * spread**2 + np.eye(count))[1])
        found = 2 * (value - alike) - float(logs @ around @ logs) - sharp
        if found < best:
            break
        best = found
    return best


__all__ = ["Left", "evidence", "left"]
