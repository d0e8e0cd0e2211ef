"""What a plan is judged by, as a number that is to be small: a weighted trace of the covariance, or its determinant.

With the information A = H + Σ x xᵀ of a plan (touches x, H what is known without them) and C = A⁻¹:

    trace        φ = tr(Q C)        I- or V-optimal (Q: mean of levers over a volume), A-optimal (Q: unit), single parameters
    determinant  φ = −log det A     D-optimal

"The worst of many" (of poses, of parameters by their limits) is a trace whose Q is a mean with weights that are raised where it is
worst: for every choice of weights that mean is at most the worst, which is what makes the bound of `relaxed.py` a bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ..records import Array


@dataclass(frozen=True)
class Criterion:
    """`spread` (p, p) is Q. `worst` (k, p): directions of which the largest variance counts. Neither: the determinant."""

    name: str
    spread: Array | None = None
    worst: Array | None = None

    @property
    def determinant(self) -> bool:
        """→ whether it is the determinant that counts."""
        return self.spread is None and self.worst is None

    def with_weights(self, weights: Array) -> Criterion:
        """(k,) weights of the directions, sum 1 → the trace that stands for the worst."""
        assert self.worst is not None
        return Criterion(self.name, (self.worst.T * weights) @ self.worst, self.worst)


def value(criterion: Criterion, information: Array) -> float:
    """criterion, A (p, p) → φ; of the worst of many, the worst."""
    root = np.linalg.cholesky(information)
    if criterion.worst is not None:
        return float(_squares(root, criterion.worst).max())
    if criterion.spread is None:
        return -2 * float(np.log(np.diag(root)).sum())
    return float(np.vdot(criterion.spread, _inverse(root)))


def parts(criterion: Criterion, information: Array) -> Array:
    """criterion of the worst of many, A → (k,) variance of each direction."""
    assert criterion.worst is not None
    return _squares(np.linalg.cholesky(information), criterion.worst)


# What follows is called a hundred thousand times for a plan; LAPACK itself, as the functions around it take longer than it does.


def _squares(root: NDArray[Any], rows: Array) -> Array:
    """(p, p) lower Cholesky factor of A, (k, p) → (k,) x A⁻¹ x of each row."""
    solved = linalg.lapack.dtrtrs(root, rows.T, lower=1)[0]
    return np.asarray(np.einsum("pk,pk->k", solved, solved))


def _inverse(root: NDArray[Any]) -> Array:
    """(p, p) lower Cholesky factor of A → A⁻¹."""
    half = linalg.lapack.dpotri(root, lower=1)[0]  # above its diagonal are the zeros of the factor
    full = half + half.T
    full.flat[:: len(full) + 1] /= 2
    return np.asarray(full)


@dataclass
class State:
    """C, and G = C Q C, of the touches that are in; both follow every change of one touch by rank-one updates."""

    criterion: Criterion
    covariance: Array  # C (p, p)
    gain: Array  # G (p, p); C where the determinant counts

    @classmethod
    def of(cls, criterion: Criterion, information: Array) -> State:
        """criterion, A → state."""
        root = np.linalg.cholesky(information)
        covariance = _inverse(root)
        gain = covariance if criterion.spread is None else covariance @ criterion.spread @ covariance
        return cls(criterion, covariance, gain)

    def variances(self, aims: Array) -> Array:
        """(k, p) directions → (k,) variance of each."""
        return np.asarray(np.einsum("kp,kp->k", aims @ self.covariance, aims))

    def seen(self, rows: Array) -> tuple[Array, Array]:
        """(n, p) touches → (n,) leverage x C x, (n,) x G x."""
        leverage = np.einsum("ij,ij->i", rows @ self.covariance, rows)
        return leverage, leverage if self.gain is self.covariance else np.einsum("ij,ij->i", rows @ self.gain, rows)

    def slope(self, rows: Array) -> Array:
        """(n, p) touches → (n,) x G x: what φ falls by for a very small part of each."""
        return np.asarray(np.einsum("ij,ij->i", rows @ self.gain, rows))

    def loss(self, leverage: Array, gain: Array) -> Array:
        """(n,), (n,) of touches that are in → how much φ grows without each."""
        left = np.maximum(1 - leverage, 1e-12)
        return np.asarray(-np.log(left) if self.criterion.determinant else gain / left)

    def benefit(self, leverage: Array, gain: Array) -> Array:
        """(n,), (n,) of touches that are not in → how much φ falls with each."""
        return np.asarray(np.log1p(leverage) if self.criterion.determinant else gain / (1 + leverage))

    def block_loss(self, rows: Array) -> float:
        """(m, p) touches that are in → how much φ grows without all of them."""
        left = np.eye(len(rows)) - rows @ self.covariance @ rows.T
        if self.criterion.determinant:
            root, fault = linalg.lapack.dpotrf(left, lower=1)
            return np.inf if fault else -2 * float(np.log(np.diag(root)).sum())
        _, solved, fault = linalg.lapack.dposv(left, rows @ self.gain @ rows.T)
        return np.inf if fault else float(np.trace(solved))

    def block_benefit(self, rows: Array) -> float:
        """(m, p) touches that are not in → how much φ falls with all of them."""
        root = np.linalg.cholesky(np.eye(len(rows)) + rows @ self.covariance @ rows.T)
        if self.criterion.determinant:
            return 2 * float(np.log(np.diag(root)).sum())
        return float(np.trace(linalg.cho_solve((root, True), rows @ self.gain @ rows.T)))

    def change(self, row: Array, sign: int) -> tuple[Array, Array, float, float]:
        """(p,) touch, 1 into the plan or −1 out of it → C x, G x, x G x and 1 ± x C x from before; C and G follow."""
        u, v = self.covariance @ row, self.gain @ row
        left, own = 1 + sign * float(row @ u), float(row @ v)
        factor = -sign / left
        same = self.gain is self.covariance
        self.covariance = self.covariance + u[:, None] * (factor * u)
        if same:
            self.gain = self.covariance
        else:
            cross = u[:, None] * (factor * v + own * factor**2 / 2 * u)
            self.gain = self.gain + cross + cross.T
        return u, v, own, left


def swaps(state: State, leaving: Array, entering: Array) -> Array:
    """state, (a, p) touches that are in, (b, p) that are not → (a, b) how much φ falls by each swap (Fedorov 1972, rank two)."""
    seen_in, seen_out = leaving @ state.covariance, entering @ state.covariance
    h, k = np.einsum("ij,ij->i", seen_in, leaving), np.einsum("ij,ij->i", seen_out, entering)
    cross = seen_in @ entering.T
    below = np.outer(1 - h, 1 + k) + cross**2
    if state.criterion.determinant:
        return np.asarray(np.log(np.maximum(below, 1e-300)))
    gained_in = leaving @ state.gain
    g, e = np.einsum("ij,ij->i", gained_in, leaving), np.einsum("ij,ij->i", entering @ state.gain, entering)
    mixed = gained_in @ entering.T
    return np.asarray((np.outer(1 - h, e) + 2 * cross * mixed - np.outer(g, 1 + k)) / np.maximum(below, 1e-12))
