"""Whether two convex bodies keep a distance while one of them is shifted past the other: for many poses at once, and proven.

Theory. A − B, all differences of points of the two, is convex; its distance from the origin is that of the bodies. A shift along a
line (or within a box) only adds corners to it. Any direction u gives a lower bound on the distance, the least of u over all of
A − B: where one bound exceeds what is asked for, the bodies are apart, whatever led to the direction. Directions come from walking
towards the nearest point (Frank & Wolfe 1956; Gilbert 1966), and where that is slow, from the nearest point itself (Lawson & Hanson
1974, non-negative least squares over the corners).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array

STEPS = 24  # of the walk; what is not decided by then is worked out
CHUNK = 2048  # poses at once, so that memory does not grow with their number
SURE = 1e-9  # mm

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Round:
    """Everything within `radius` mm of the convex hull of `corner`."""

    corner: Array  # (v, 3) mm
    radius: float = 0.0


@dataclass(frozen=True)
class Placed:
    """n poses of a body: x goes to turn @ x + shift; with several shifts, to all that is between them."""

    turn: Array  # (n, 3, 3)
    shift: Array  # (n, s, 3) mm


def apart(one: Round, at: Placed, other: Round, there: Placed, need: Array) -> Mask:
    """two bodies, n poses of each (as many shifts), (n,) mm → (n,) whether they are proven to keep more than that between them."""
    found = np.zeros(len(need), dtype=bool)
    for begin in range(0, len(need), CHUNK):
        rows = slice(begin, begin + CHUNK)
        a, b = (np.einsum("nij,vj->nvi", p.turn[rows], body.corner) for p, body in ((at, one), (there, other)))
        shift = at.shift[rows] - there.shift[rows]
        found[rows] = _apart(a, b, shift, need[rows] + one.radius + other.radius)
    return found


def _apart(a: Array, b: Array, shift: Array, need: Array) -> Mask:
    """(n, v, 3), (n, w, 3), (n, s, 3), (n,) → (n,) whether a + shift is farther than `need` from b."""
    proven, rows = np.zeros(len(need), dtype=bool), np.arange(len(need))
    nearest = a.mean(axis=1) + shift.mean(axis=1) - b.mean(axis=1)
    for _ in range(STEPS):
        size = np.linalg.norm(nearest, axis=1)
        least, corner = _support(a[rows], b[rows], shift[rows], nearest)
        far = least > (need[rows] + SURE) * size
        proven[rows[far]] = True
        left = ~far & (size > need[rows])  # a point of the difference that is too near decides, too
        rows, nearest, corner = rows[left], nearest[left], corner[left]
        if not len(rows):
            return proven
        way = corner - nearest
        part = -np.einsum("ni,ni->n", nearest, way) / np.maximum(np.einsum("ni,ni->n", way, way), 1e-30)
        nearest = nearest + np.clip(part, 0.0, 1.0)[:, None] * way
    for row in rows.tolist():
        proven[row] = _nearest(a[row], b[row], shift[row], float(need[row]))
    return proven


def _support(a: Array, b: Array, shift: Array, way: Array) -> tuple[Array, Array]:
    """→ (n,) the least of `way` over the difference, (n, 3) where it is taken."""
    row = np.arange(len(way))
    far = [np.einsum("nvi,ni->nv", points, way) for points in (a, shift, -b)]
    which = [value.argmin(axis=1) for value in far]
    least = sum(value[row, at] for value, at in zip(far, which, strict=True))
    return np.asarray(least), a[row, which[0]] + shift[row, which[1]] - b[row, which[2]]


def _nearest(a: Array, b: Array, shift: Array, need: float) -> bool:
    """One pose → the same, by the point of the difference that is nearest to the origin."""
    from scipy.optimize import nnls  # slow to load, and most poses are proven without it

    corner = (a[:, None, None] + shift[None, :, None] - b[None, None, :]).reshape(-1, 3)
    size = float(np.linalg.norm(corner, axis=1).max()) or 1.0
    try:
        weight, _ = nnls(np.vstack([corner.T / size, np.full(len(corner), 100.0)]), np.array([0.0, 0.0, 0.0, 100.0]))
    except RuntimeError:  # no answer is no proof
        return False
    way = weight @ corner
    length = float(np.linalg.norm(way))
    return length > SURE and float((corner @ way).min()) > (need + SURE) * length
