"""Triangles: what a covariance is carried by."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ..records import Array


def triangle(matrix: Array) -> Array:
    """(n, p) → (min(n, p), p) upper triangle R of its QR decomposition."""
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def widened(root: Array, columns: Array) -> Array:
    """(p, p) lower root S, (p, m) columns C → (p, p) lower root of S Sᵀ + C Cᵀ."""
    return triangle(np.hstack([root, columns]).T).T


def rooted(covariance: Array) -> Array:
    """(p, p) covariance → its lower root, by unit variances, so that mm and rad do not meet."""
    scale = np.sqrt(np.diag(covariance))
    return np.asarray(scale[:, None] * np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-13 * np.eye(len(scale))))


def solved(root: Array, right: Array) -> Array:
    """(n, n) lower triangle L, (n, m) right sides B, overwritten → (n, m) of L X = B. Both are trusted to be finite.

    Without the checks of scipy.linalg.solve_triangular, which take longer than the arithmetic where thousands are small.
    """
    found, wrong = lapack.dtrtrs(root.T, right, lower=0, trans=1, overwrite_b=1)
    if wrong:
        raise np.linalg.LinAlgError(f"a triangle that has no inverse, at {wrong}")
    return np.asarray(found)
