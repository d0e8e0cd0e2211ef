"""Data, names and shapes in the space that they span: how likely each shape is beside what was picked, and the best few of them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ._catalogue import Chosen
from ._rows import Rows
from ._smooth import Kernel, groups, scaled, window
from ._space import orthonormal

ROUND = 1e-7  # of the largest: smaller ones are rounding
TAUS = tuple(np.geomspace(0.01, 1000.0, 11))  # variance of a shape at a touch over that of the noise
MOST = 6  # shapes that are added
FOLLOW = 250  # shapes that are compared after the first one was chosen
CHANGES = 20.0  # evidence that a name's own size changes: it is the name itself, and more, so less of it proves nothing


class Field:
    """Shapes as one matrix, (m, F) single precision, as the model leaves them."""

    def __init__(
        self, kernels: Sequence[Kernel], basis: Array, weight: Array, means: Rows, rows: NDArray[np.int64] | None = None
    ) -> None:
        own = sum("like" in k.setting for k in kernels)
        self.among = {False: len(kernels) - own, True: own}  # shapes that were compared to find these; names whose size changes
        self.rows = slice(None) if rows is None else rows  # of the rows
        self.basis, self.weight, self.means, self.touches = basis, weight, means, means.seen
        stacked = np.hstack([k.columns for k in kernels])
        stacked *= weight[:, None]
        self._set(kernels, (stacked.T @ basis).astype(np.float32).T)  # one feature after the other: they are read one by one
        self.asked: dict[tuple[object, ...], Asked] = {}  # contests come back to the same names again and again

    def _set(self, kernels: Sequence[Kernel], columns: NDArray[np.float32]) -> None:
        sizes = [k.columns.shape[1] for k in kernels]
        self.kernels, self.columns = list(kernels), columns
        self.start = np.concatenate([[0], np.cumsum(sizes)])
        self.by_size = {k: np.array(own) for k, own in groups(sizes).items()}

    def only(self, few: NDArray[np.int64], s: State) -> tuple[Field, State]:
        """numbers of shapes, state → both with these shapes only."""
        at = np.concatenate([np.arange(self.start[i], self.start[i + 1]) for i in few])
        found = copy(self)
        found._set([self.kernels[i] for i in few], self.columns.T[at].T)
        return found, replace(s, columns=s.columns.T[at].T)

    def plain(self) -> Field:
        """→ the field without names whose size changes: where a name was refused, its own pattern is no rival of it."""
        few = [i for i, k in enumerate(self.kernels) if "like" not in k.setting]
        at = np.concatenate([np.arange(self.start[i], self.start[i + 1]) for i in few])
        found = copy(self)
        found._set([self.kernels[i] for i in few], self.columns.T[at].T)
        found.asked = {}
        return found

    def more(self, kernels: Sequence[Kernel]) -> Field:
        """shapes → the field with these as well."""
        found = copy(self)
        more = [self.project(k).astype(np.float32) for k in kernels]
        found._set([*self.kernels, *kernels], np.hstack([self.columns, *more]).T.copy().T)
        found.asked = {}
        return found

    def __len__(self) -> int:
        return len(self.kernels)

    def project(self, kernel: Kernel) -> Array:
        """shape → (m, k) as the model leaves it."""
        return np.asarray(self.basis.T @ (kernel.columns[self.rows] * self.weight[:, None]))

    def of(self, i: int, columns: NDArray[np.float32]) -> Array:
        """number of a shape, features → its own (m, k)."""
        return columns[:, self.start[i] : self.start[i + 1]].astype(float)


@dataclass(frozen=True)
class Picked:
    """A shape that was chosen."""

    kernel: Kernel
    columns: Array  # (m, k) as the model leaves them
    tau: float
    score: float  # evidence that it added
    rivals: tuple[str, ...] = ()  # covariates that it may follow instead


@dataclass(frozen=True)
class State:
    """Data and shapes as the chosen ones leave them."""

    y: Array  # (m,) or (m, B)
    columns: NDArray[np.float32]
    logdet: float
    picked: tuple[Picked, ...] = ()
    turns: tuple[tuple[Array, Array | float], ...] = ()  # (m, r) bases and how much was taken away along them, in this order

    def seen(self, columns: Array) -> Array:
        """(m, k) as the model leaves them → as the chosen ones do."""
        for basis, amount in self.turns:
            part = np.asarray(amount)
            columns = columns - basis @ ((basis.T @ columns) * (part[:, None] if part.ndim else part))
        return columns


def begin(field: Field, y: Array, names: Array) -> State:
    """field, data (m,) or (m, B), columns of the names (m, s) → both outside the names."""
    basis = orthonormal(names)
    return State(y - basis @ (basis.T @ y), _without(field.columns, basis, 1.0), 0.0, (), ((basis, 1.0),))


def _without(columns: NDArray[np.float32], basis: Array, part: Array | float) -> NDArray[np.float32]:
    if not basis.shape[1]:
        return columns
    single, rows = basis.astype(np.float32), columns.T
    amount = np.asarray(part, dtype=np.float32)
    return np.asarray(rows - ((rows @ single) * amount) @ single.T, dtype=np.float32).T


def scores(field: Field, s: State) -> tuple[Array, Array]:
    """field, state → twice the log likelihood ratio (b, B) of every shape at its best τ, and that τ (b, B)."""
    y = s.y if s.y.ndim == 2 else s.y[:, None]
    m, width = y.shape
    whole = np.sum(y**2, axis=0)
    along = (s.columns.T @ y.astype(np.float32)).astype(float)
    best = np.full((len(field), width), -np.inf)
    at = np.zeros((len(field), width))
    for k, own in field.by_size.items():
        place = field.start[own][:, None] + np.arange(k)
        part = s.columns.T[place]  # (b, k, m)
        value, vector = np.linalg.eigh((part @ part.transpose(0, 2, 1)).astype(float))
        value = np.maximum(value, 0.0)
        turned = np.matmul(vector.transpose(0, 2, 1), along[place]) ** 2
        for tau in TAUS:
            shrink = tau / (1 + tau * value)
            left = whole - np.matmul(shrink[:, None, :], turned)[:, 0]
            score = -np.log1p(tau * value).sum(axis=1)[:, None] - m * np.log(np.maximum(left, 1e-9 * whole) / whole)
            better = score > best[own]
            best[own] = np.where(better, score, best[own])
            at[own] = np.where(better, tau, at[own])
    return best, at


def whiten(s: State, kernel: Kernel, columns: Array, own: Array, tau: float, score: float) -> State:
    """state, a shape with its features as the model and as the state leaves them, τ → state with it in the covariance."""
    u, d, _ = np.linalg.svd(own, full_matrices=False)
    keep = d > ROUND * max(float(d[0]), 1e-300)
    u, d = u[:, keep], d[keep]
    amount = 1 - 1 / np.sqrt(1 + tau * d**2)
    y = s.y - u @ ((amount if s.y.ndim == 1 else amount[:, None]) * (u.T @ s.y))
    more = float(np.log1p(tau * d**2).sum())
    picked = (*s.picked, Picked(kernel, columns, tau, score))
    return State(y, _without(s.columns, u, amount), s.logdet + more, picked, (*s.turns, (u, amount)))


def price(field: Field, m: int, kernel: Kernel) -> float:
    """→ what a shape costs: its variance, and that it was picked among all; a name whose size changes: among those, and more."""
    itself = "like" in kernel.setting
    return float(np.log(m) + 2 * np.log(max(field.among[itself], 1))) + (CHANGES if itself else 0.0)


@dataclass(frozen=True)
class Asked:
    """What shapes do beside some names, which are kept here so that no id comes twice."""

    kept: tuple[object, ...]
    first: list[tuple[Array, Array]]  # `scores` beside the names alone, once somebody asked
    grown: dict[tuple[object, ...], tuple[float, tuple[Picked, ...]]]  # of noises only, without these: evidence, what was chosen


def asked(field: Field, y: Array, fixed: Sequence[Chosen], names: Sequence[Chosen]) -> Asked:
    """field, data (m,), single touches that are set aside, names → what is known of shapes beside them."""
    key = (id(y), len(fixed), *map(id, (*fixed, *names)))
    return field.asked.setdefault(key, Asked((y, *fixed, *names), [], {}))


def first(field: Field, y: Array, fixed: Sequence[Chosen], names: Sequence[Chosen]) -> tuple[State, tuple[Array, Array]]:
    """field, data (m,), single touches that are set aside, names → state beside them, `scores` there."""
    s, known = begin(field, y, columns_of(len(y), [*fixed, *names])), asked(field, y, fixed, names).first
    if not known:
        known.append(scores(field, s))
    return s, known[0]


def grown(
    field: Field,
    y: Array,
    fixed: Sequence[Chosen],
    names: Sequence[Chosen],
    noises: bool = False,
    away: Sequence[Chosen] = (),
) -> State:
    """what is asked, whether of noises only, names that are left out of it → state with shapes added one by one, the best first,
    while one is worth its price.

    A name that is left out does not come in by the back door, as itself with a size that changes by nothing.
    """
    s, (best, at) = first(field, y, fixed, names)
    gone = [c.candidate for c in away]
    if noises or gone:
        stays = [(k.noise or not noises) and not any(k.setting.get("name") is c for c in gone) for k in field.kernels]
        best = np.where(np.array(stays)[:, None], best, -np.inf)
    for turn in range(MOST):
        if turn:
            best, at = scores(field, s)
        worth = best[:, 0] - [price(field, len(s.y), k) for k in field.kernels]
        i = int(np.argmax(worth))
        gain = float(worth[i])
        if gain < 0:
            break
        if turn == 0:  # the others follow the first one too far behind
            few = np.sort(np.argsort(-worth)[:FOLLOW])
            few = few[np.isfinite(worth[few])]
            field, s = field.only(few, s)
            at, i = at[few], int(np.searchsorted(few, i))
        kernel, own, tau = field.kernels[i], field.of(i, s.columns), float(at[i, 0])
        columns = field.of(i, field.columns)
        if kernel.kind == "window":
            kernel, columns, own, tau, better = edges(field, s, kernel)
            gain = better - price(field, len(s.y), kernel)
        s = whiten(s, kernel, columns, own, tau, gain)
    return s


def score(y: Array, own: Array) -> tuple[float, float]:
    """data and one shape as a state sees them → twice the log likelihood ratio at its best τ, and that τ."""
    value, vector = np.linalg.eigh(own.T @ own)
    value = np.maximum(value, 0.0)[:, None]
    turned = (vector.T @ (own.T @ y)) ** 2
    grown = 1 + np.multiply(TAUS, value)
    left = np.maximum(1 - turned @ (TAUS / grown) / float(y @ y), 1e-9)
    each = -np.log(grown).sum(axis=0) - len(y) * np.log(left)
    i = int(np.argmax(each))
    return float(each[i]), TAUS[i]


def edges(field: Field, s: State, kernel: Kernel) -> tuple[Kernel, Array, Array, float, float]:
    """a window → the same with its edges where the data put them: kernel, columns before and in the state, τ, score."""

    def tried(a: int, b: int) -> tuple[Kernel, Array, Array, float, float]:
        k = scaled(window(field.touches, a, b))
        columns = field.project(k)
        own = s.seen(columns)
        best, tau = score(s.y, own)
        return k, columns, own, tau, best

    first, last, step = kernel.setting["first"], kernel.setting["last"], 16
    best = tried(first, last)
    while step:
        moves = [(first + a, last + b) for a, b in ((step, 0), (-step, 0), (0, step), (0, -step))]
        options = [(tried(a, b), a, b) for a, b in moves if 0 < a < b - 2 and b < len(field.touches)]
        top = max(options, key=lambda o: o[0][4], default=None)
        if top is not None and top[0][4] > best[4] + 1e-9:
            best, first, last = top
        else:
            step //= 2
    return best


def columns_of(m: int, chosen: Sequence[Chosen]) -> Array:
    """number of rows, names → (m, k) the columns of all of them; of none (m, 0)."""
    return np.hstack([c.columns for c in chosen]) if chosen else np.empty((m, 0))
