"""Triangles: what a covariance is carried by."""

from __future__ import annotations

import numpy as np

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
