"""Decompositions that come to an end for every finite matrix.

Divide and conquer, which numpy has for both, does not converge for a few matrices of sound touches. The QR iteration does, and is
slower. Source: LAPACK Users' Guide, 3rd ed., 2.4.4 and 2.4.6 (xSTEDC and xBDSDC against xSTEQR and xBDSQR).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ..records import Array


def eigen(matrix: Array) -> tuple[Array, Array]:
    """(k, k) symmetric → (k,) eigenvalues, ascending, (k, k) eigenvectors in columns.

    Raises LinAlgError where the matrix is not finite.
    """
    try:
        value, turn = np.linalg.eigh(matrix)
    except np.linalg.LinAlgError:
        value, turn = linalg.eigh(matrix, driver="ev")
    return np.asarray(value), np.asarray(turn)


def singular(matrix: Array) -> tuple[Array, Array]:
    """(n, p) → (n, r) left singular vectors, (r,) singular values, descending; r is the smaller of n and p.

    Raises LinAlgError where the matrix is not finite.
    """
    try:
        basis, size, _ = np.linalg.svd(matrix, full_matrices=False)
    except np.linalg.LinAlgError:
        basis, size, _ = linalg.svd(matrix, full_matrices=False, lapack_driver="gesvd")
    return np.asarray(basis), np.asarray(size)
