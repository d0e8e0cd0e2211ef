"""Between which two touches something moved: what the touches say of every moment that it may have been."""

from __future__ import annotations

import numpy as np

from ..records import Array

TELLS = 3.0  # standard deviations by which the touches have to contradict a moment; those that feel less of it decide nothing
FAINT = 1e-3  # share of what a displacement does to the touches below which other unknowns stand for it


def gains(gram: Array, pull: Array, every: Array) -> Array:
    """by moment: (m, k, k) squares of a displacement that the unknowns leave, (m, k) its products with the residuals, (m, k) its
    lengths before the unknowns took their part → (m,) squares that the displacement from that moment on takes out.

    Millimetres and radians come to one scale by these lengths.
    """
    size, turn = np.linalg.eigh(gram / (every[:, :, None] * every[:, None, :]))
    along = np.einsum("nij,ni->nj", turn, pull / every)
    enough = size > FAINT * gram.shape[1]
    return np.asarray(np.where(enough, along**2 / np.where(enough, size, 1.0), 0.0).sum(axis=1))


def between(gain: Array, variance: float) -> tuple[int, int, int]:
    """(m,) squares that a displacement takes out by its moment, variance of a touch → the best moment, the first and the last that
    the touches do not contradict.

    A moment is contradicted where it takes out less than the best one by the square of `TELLS` standard deviations (likelihood
    ratio of a change point; Hinkley 1970). A touch that feels less than that of the displacement contradicts none.
    """
    best = int(np.argmax(gain))
    alike = np.flatnonzero(gain >= gain[best] - TELLS**2 * variance)
    return best, int(alike[0]), int(alike[-1])
