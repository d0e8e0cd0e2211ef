"""Batched 4×4 homogeneous transforms; every function returns (n, 4, 4), or (1, 4, 4) which broadcasts."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Array, Vector


def translation(vectors: Array) -> Array:
    """(n, 3) mm → (n, 4, 4) translation."""
    result = _identities(len(vectors))
    result[:, :3, 3] = vectors
    return result


def _identities(count: int) -> Array:
    result = np.zeros((count, 4, 4))
    result.reshape(count, 16)[:, ::5] = 1.0  # a slice is some three times as quick as indices, and every joint of every place asks
    return result


def shift(axis: int, lengths: Array) -> Array:
    """0 1 2 for x y z, (n,) mm → (n, 4, 4) translation along that base vector."""
    result = _identities(len(lengths))
    result[:, axis, 3] = lengths
    return result


def rotation(axis: int, angles: Array) -> Array:
    """0 1 2 for x y z, (n,) rad → (n, 4, 4) right-handed rotation about that base vector."""
    result = _identities(len(angles))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = np.cos(angles), np.sin(angles)
    result[:, i, i] = result[:, j, j] = cosine
    result[:, j, i] = sine
    result[:, i, j] = -sine
    return result


def error(components: Array) -> Array:
    """(n, 6) mm, rad: X Y Z A B C → (n, 4, 4): translation, then R_z(C) R_y(B) R_x(A) (model.md, Frames and chain)."""
    moved = translation(components[:, :3])
    seen = np.any(components, axis=0)
    for axis in (2, 1, 0):
        moved = moved @ rotation(axis, components[:, 3 + axis]) if seen[3 + axis] else moved
    return moved


def inverse(transforms: Array) -> Array:
    """(n, 4, 4) rigid → (n, 4, 4) inverse, by transposing the rotation."""
    turned = np.swapaxes(transforms[:, :3, :3], 1, 2)
    result = _identities(len(transforms))
    result[:, :3, :3] = turned
    result[:, :3, 3] = -np.einsum("nij,nj->ni", turned, transforms[:, :3, 3])
    return result


def axis_frame(base: int, direction: Vector) -> tuple[Array, int]:
    """base vector 0 1 2, unit direction → (3, 3) frame axes as columns in machine coordinates, sense ±1 (model.md, Axis frame)."""
    along, unit = np.eye(3)[base], np.array(direction)
    if np.linalg.norm(unit + along) < 1e-12:
        return np.eye(3), -1
    cross, cosine = np.cross(along, unit), float(along @ unit)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    both = along + unit  # of nearly opposite ones 1 + cosine would keep few digits
    more = 1 + cosine if cosine > 0 else float(both @ both) / 2
    return np.eye(3) + skew + skew @ skew / more, 1


def frame(axes: Array, point: Vector) -> Array:
    """(3, 3) columns, point mm → (1, 4, 4) from that frame to the machine frame."""
    result = np.eye(4)[None].copy()
    result[0, :3, :3] = axes
    result[0, :3, 3] = point
    return result
