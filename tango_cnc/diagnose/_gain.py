"""What a cause is worth: on the touches that were fitted, on touches that were not, and against a placebo.

Held-out errors come from one factorisation: the errors of touches B of a fit without B are (I − H_BB)⁻¹ e_B with the hat
matrix H (Cook & Weisberg 1982, 2.2). What the other touches cannot know, such as the offset of a facet that is held out
whole, is left out of the comparison by the pseudo-inverse.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ._space import UNSEEN

PLACEBOS = 40
HELD = 0.1  # eigenvalue of a group's part of I − H below which the other touches do not know that direction


@dataclass(frozen=True)
class Gain:
    """Root mean square of the residuals with and without one cause, in the unit of the residuals."""

    before: float
    after: float
    heldout_before: float
    heldout_after: float
    scheme: str  # how the touches were held out
    schemes: Mapping[str, tuple[float, float]]  # every way of holding out: before, after
    placebo: float  # largest held-out gain but one in forty of the same regressor with its rows shuffled
    real: bool  # the held-out gain is larger than that
    inside: bool = False  # the setting was chosen without the touches that were held out


def residual_maker(design: Array) -> Array:
    """(n, p) → (n, n) I − H of a least-squares fit."""
    norm = np.linalg.norm(design, axis=0)
    u, s, _ = np.linalg.svd(design / np.where(norm > 0, norm, 1.0), full_matrices=False)
    u = u[:, s > 1e-9]
    return np.asarray(np.eye(len(design)) - u @ u.T)


def add(maker: Array, columns: Array) -> Array:
    """(n, n) I − H, columns (n, k) → I − H of the fit with them."""
    left = maker @ columns
    norm = np.linalg.norm(left, axis=0)
    keep = norm > UNSEEN * np.linalg.norm(columns, axis=0)
    if not keep.any():
        return maker
    q = np.linalg.qr(left[:, keep] / norm[keep])[0]
    return np.asarray(maker - q @ q.T)


def held_out(maker: Array, residual: Array, groups: NDArray[np.int64], n: int) -> Array:
    """I − H, data (n + known,), group (n,) of every touch → (n,) errors of each touch predicted without its group."""
    fitted = maker @ residual
    result = np.zeros(n)
    for g in np.unique(groups):
        rows = np.flatnonzero(groups == g)
        result[rows] = np.linalg.pinv(maker[np.ix_(rows, rows)], rcond=HELD, hermitian=True) @ fitted[rows]
    return result


def _beside(maker: Array, residual: Array, groups: NDArray[np.int64], n: int, more: Sequence[Array]) -> Iterator[Array]:
    """I − H, data, group (n,) of every touch, sets of columns (n + known, k) → `held_out` with each of them.

    Each group is inverted once; a set of columns changes that inverse by its own rank (Woodbury). Where hardly any other
    touch knows a column, that rank-k change has no inverse: such a group is inverted anew.
    """
    fitted = maker @ residual
    parts = [np.flatnonzero(groups == g) for g in np.unique(groups)]
    inverse = [np.linalg.pinv(maker[np.ix_(rows, rows)], rcond=HELD, hermitian=True) for rows in parts]
    for columns in more:
        left = maker @ columns
        norm = np.linalg.norm(left, axis=0)
        some = norm > UNSEEN * np.linalg.norm(columns, axis=0)
        q = np.linalg.qr(left[:, some] / norm[some])[0] if some.any() else left[:, :0]
        rest = fitted - q @ (q.T @ fitted)
        result = np.zeros(n)
        for rows, inside in zip(parts, inverse, strict=True):
            here = q[rows]
            turned = inside @ here
            known = np.eye(q.shape[1]) - here.T @ turned
            if q.shape[1] and np.linalg.eigvalsh(known)[0] < HELD:
                anew = maker[np.ix_(rows, rows)] - here @ here.T
                result[rows] = np.linalg.pinv(anew, rcond=HELD, hermitian=True) @ rest[rows]
            else:
                value = inside @ rest[rows]
                result[rows] = value + turned @ np.linalg.solve(known, here.T @ value)
        yield result


def rms(x: Array) -> float:
    """(n,) → root mean square."""
    return float(np.sqrt(np.mean(x**2))) if len(x) else 0.0


def measure(
    design: Array,
    residual: Array,
    columns: Array,
    schemes: Mapping[str, NDArray[np.int64]],
    keep: NDArray[np.bool_],
    rng: np.random.Generator,
) -> Gain:
    """design without the cause (n + known, p), data, its columns (n, k), groups (n,) by scheme, rows that count → gain.

    The first scheme is the one that is reported, unless the pattern lives in one group of it: then the last one is.
    """
    n = len(keep)
    padded = np.vstack([columns, np.zeros((len(design) - n, columns.shape[1]))])
    without = residual_maker(design)
    within = add(without, padded)
    table = {}
    for name, groups in schemes.items():
        pair = [held_out(m, residual, groups, n)[keep] for m in (without, within)]
        table[name] = (rms(pair[0]), rms(pair[1]))
    names = list(schemes)
    seen = np.sum((without @ padded)[:n] ** 2, axis=1)
    share = max(float(seen[schemes[names[0]] == g].sum()) for g in np.unique(schemes[names[0]])) / max(float(seen.sum()), 1e-30)
    scheme = names[-1] if share > 0.4 else names[0]
    shuffled = [np.vstack([columns[rng.permutation(n)], padded[n:]]) for _ in range(PLACEBOS)]
    gains = [table[names[-1]][0] - rms(after[keep]) for after in _beside(without, residual, schemes[names[-1]], n, shuffled)]
    placebo = float(np.sort(gains)[-2])
    real = table[names[-1]][0] - table[names[-1]][1] > max(placebo, 0.0)
    fitted = rms((without @ residual)[:n][keep]), rms((within @ residual)[:n][keep])
    return Gain(*fitted, *table[scheme], scheme, table, placebo, real)


def nested(g: Gain, schemes: Mapping[str, tuple[float, float]]) -> Gain:
    """gain, errors by scheme with settings chosen inside the folds → gain that reports these."""
    scheme = g.scheme if g.scheme in schemes else next(iter(schemes), g.scheme)
    told = schemes.get(scheme, (g.heldout_before, g.heldout_after))
    return replace(
        g, heldout_before=told[0], heldout_after=told[1], scheme=scheme, schemes={**g.schemes, **schemes}, inside=bool(schemes)
    )


def scattered(n: int, folds: int = 10) -> NDArray[np.int64]:
    """n, folds → (n,) group of every row: each tenth row, so that every fold is all over the test."""
    return np.arange(n) % folds


def blocks(n: int, count: int = 8) -> NDArray[np.int64]:
    """n, count → (n,) group of every row: consecutive blocks."""
    return np.arange(n) * count // max(n, 1)


def groups_of(keys: Sequence[object]) -> NDArray[np.int64]:
    """(n,) keys → (n,) number of each row's key."""
    order = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return np.array([order[key] for key in keys])
