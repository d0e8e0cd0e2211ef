"""The space that the present model does not reach, and the noise in it.

Everything is judged there: residuals and patterns are multiplied by an orthonormal basis of the left null space of the
Jacobian (Harville 1974: maximum likelihood there is REML). The noise is white plus kernels with unknown ratios; a fixed grid
of ratios is factorised once, so that every candidate can be compared at the noise that suits it best. A candidate that
explains a drift is not tested against a noise that has already swallowed the drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize

from ..records import Array

RATIOS = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 40.0)  # variance of a kernel over that of the white noise
COARSE = (0.0, 0.1, 3.0)  # of them, where the search begins
FAINT = 1e-5  # part of a column that is left of a free scale at the real positions, 0.1 mm beside the nominal ones
LEVER = 30.0  # mm: no machine is so small
UNSEEN = 1e-3  # part of a column outside the model that is as good as none
REPEATED = 1e-9  # of a whitened pattern's own length: no more than rounding is left of it beside the selected ones
RIDGE = 1e-5  # of a pattern's own length: less than this is left of it when it repeats what is selected


@dataclass(frozen=True)
class Setting:
    """One kind of noise: ratios of the kernels, inverse root (m, m) of its covariance, log determinant."""

    ratios: tuple[float, ...]
    root: Array
    logdet: float


class _White(NamedTuple):
    """A library as one kind of noise sees it; single precision is enough to compare candidates."""

    columns: NDArray[np.float32]  # (m, N)
    whole: Array  # (N,) squared lengths
    grams: dict[int, Array]  # size of blocks → (b, k, k)


@dataclass
class Space:
    """(m,) residuals, (n, m) basis, (m, m) kernels of mean variance 1."""

    basis: Array
    y: Array
    kernels: tuple[Array, ...]
    scales: tuple[float, ...] = ()  # mean variance of each kernel before it was divided by it
    _settings: dict[tuple[float, ...], Setting] = field(default_factory=dict)
    _white: dict[tuple[float, ...], _White] = field(default_factory=dict)
    white: bool = False  # leave the kernels out
    _best: dict[bytes, tuple[tuple[float, ...], float]] = field(default_factory=dict)

    @property
    def m(self) -> int:
        """→ degrees of freedom that the model leaves."""
        return len(self.y)

    def project(self, columns: Array) -> Array:
        """(n, k) patterns → (m, k), what the model cannot absorb of them; 0 where that is next to nothing.

        A thousandth that is left of a pattern would have to be a thousand times as large as what it explains.
        """
        left: Array = self.basis.T @ columns
        return left * (np.linalg.norm(left, axis=0) > UNSEEN * np.linalg.norm(columns, axis=0))

    def setting(self, ratios: tuple[float, ...]) -> Setting:
        """ratios → factorised noise."""
        if ratios not in self._settings:
            covariance = np.eye(self.m)
            for ratio, kernel in zip(ratios, self.kernels, strict=True):
                if ratio:
                    covariance += ratio * kernel
            lower = np.linalg.cholesky(covariance)
            root = linalg.solve_triangular(lower, np.eye(self.m), lower=True, check_finite=False)
            self._settings[ratios] = Setting(ratios, root, 2 * float(np.log(np.diag(lower)).sum()))
        return self._settings[ratios]

    def grid(self) -> list[tuple[float, ...]]:
        """→ ratios of every setting that is compared."""
        if self.white:
            return [(0.0,) * len(self.kernels)]
        axes = np.meshgrid(*[RATIOS] * len(self.kernels), indexing="ij")
        return [tuple(float(v) for v in row) for row in np.array([a.ravel() for a in axes]).T] if self.kernels else [()]


def space(residual: Array, jacobian: Array, n: int, kernels: Sequence[Array], faint: float = 1e-9) -> Space:
    """residuals (n + known,) and Jacobian (n + known, p), weighted; kernels (n, n) → space. The first n rows are touches.

    A column of unit length of which less than `faint` is left beside the others is no column of its own.
    """
    rank = jacobian
    norm = np.linalg.norm(rank, axis=0)
    q, r = linalg.qr(rank / np.where(norm > 0, norm, 1.0), pivoting=True, check_finite=False)[:2]
    diagonal = np.abs(np.diag(r))
    used = int((diagonal > faint).sum())
    full = q[:, used:]
    basis = full[:n]
    projected, scales = [], []
    for kernel in kernels:
        inside = basis.T @ kernel @ basis
        mean = float(np.trace(inside)) / len(inside)
        projected.append(inside / mean if mean > 0 else inside)
        scales.append(mean)
    return Space(basis, full.T @ residual, tuple(projected), tuple(scales))


def faint(data: Array) -> float:
    """residuals of a part of the touches, mm → part of a column that is no column of its own there.

    Without the scale bar the scale is free: all lengths that are fitted, times one number. What is left of that column are the
    residuals themselves over the size of the machine, and whoever keeps it has no residuals any more.
    """
    return max(FAINT, float(np.sqrt(np.mean(data**2))) / LEVER)


@dataclass(frozen=True)
class Library:
    """Candidates as one matrix: block b has the columns `start[b] … start[b] + size[b]` of (m, N) `columns`, unit length."""

    columns: Array
    start: NDArray[np.int64]
    size: NDArray[np.int64]

    def of(self, block: int) -> Array:
        """block → (m, k)."""
        return self.columns[:, self.start[block] : self.start[block] + self.size[block]]


def library(blocks: Sequence[Array]) -> Library:
    """projected blocks, (m, k) each → library of unit columns."""
    size = np.array([b.shape[1] for b in blocks], dtype=np.int64)
    columns = np.hstack(blocks)
    norm = np.linalg.norm(columns, axis=0)
    return Library(columns / np.where(norm > 0, norm, 1.0), np.concatenate([[0], np.cumsum(size)[:-1]]), size)


def whitened(place: Space, lib: Library, ratios: tuple[float, ...]) -> _White:
    """space, library, ratios → the library as that noise sees it, remembered."""
    if ratios not in place._white:
        rows = lib.columns.T.astype(np.float32)  # one column after the other: they are read one by one
        columns = (rows if not any(ratios) else rows @ place.setting(ratios).root.astype(np.float32).T).T
        grams = {}
        for k in np.unique(lib.size):
            own = columns.T[lib.start[lib.size == k][:, None] + np.arange(k)]
            grams[int(k)] = (own @ own.transpose(0, 2, 1)).astype(float)
        place._white[ratios] = _White(columns, np.sum(columns**2, axis=0).astype(float), grams)
    return place._white[ratios]


def orthonormal(columns: Array) -> Array:
    """(m, s) → (m, r) basis of the columns that are not zero."""
    some = columns[:, np.any(columns != 0, axis=0)]
    return np.linalg.qr(some)[0] if some.shape[1] else some


def level(place: Space, ratios: tuple[float, ...], y: Array, selected: Array) -> tuple[Array, Array, Array]:
    """ratios, data (m,) or (m, B), selected (m, s) → whitened data outside the selected, their basis, log likelihoods (B,)."""
    setting = place.setting(ratios)
    white = setting.root @ (y if y.ndim == 2 else y[:, None])
    basis = orthonormal(setting.root @ selected)
    white = white - basis @ (basis.T @ white)
    return white, basis, -0.5 * setting.logdet - 0.5 * place.m * np.log(np.sum(white**2, axis=0))


class Beside:
    """What a few more columns add to the likelihood beside the selected ones, which are whitened once."""

    def __init__(self, place: Space, selected: Array, settings: Sequence[tuple[float, ...]]) -> None:
        self.place = place
        self.at = [(place.setting(ratios), *level(place, ratios, place.y, selected)[:2]) for ratios in settings]

    def likelihood(self, columns: Array) -> float:
        """(m, k) projected → log likelihood with them at the best of the settings."""
        best = -np.inf
        for setting, white, basis in self.at:
            more = setting.root @ columns
            length = np.linalg.norm(more, axis=0)
            for _ in range(2):  # twice is enough (Kahan, in Parlett 1980): what is nearly selected already keeps its digits
                more = more - basis @ (basis.T @ more)
            more = orthonormal(more * (np.linalg.norm(more, axis=0) > REPEATED * length))
            rest = float(np.sum(white**2)) - float(np.sum((more.T @ white) ** 2))
            best = max(best, -0.5 * setting.logdet - 0.5 * self.place.m * float(np.log(max(rest, 1e-300))))
        return best


def best_noise(place: Space, selected: Array, y: Array | None = None) -> tuple[tuple[float, ...], float]:
    """space, selected (m, s) → ratios of highest likelihood on the grid, its log likelihood."""
    data = place.y if y is None else y
    key = np.ascontiguousarray(selected).tobytes()  # a search comes back to the same patterns again and again
    if y is None and key in place._best:
        return place._best[key]
    scored: dict[tuple[float, ...], float] = {}

    def at(ratios: tuple[float, ...]) -> float:
        if ratios not in scored:
            scored[ratios] = float(level(place, ratios, data, selected)[2][0])
        return scored[ratios]

    # The likelihood has one top over the ratios: uphill from the best of a few places, not over the whole grid.
    ratios = max((r for r in place.grid() if place.white or set(r) <= set(COARSE)), key=at)
    while not place.white:
        higher = max(around(ratios), key=at)
        if at(higher) <= at(ratios):
            break
        ratios = higher
    value = at(ratios)
    if y is None:
        place._best[key] = ratios, value
    return ratios, value


def around(ratios: tuple[float, ...]) -> list[tuple[float, ...]]:
    """ratios of the grid → themselves and their neighbours on it."""
    near = [RATIOS[max(i - 1, 0) : i + 2] for i in map(RATIOS.index, ratios)]
    return [tuple(r) for r in product(*near)]


def fine_noise(place: Space, selected: Array) -> tuple[tuple[float, ...], float]:
    """space, selected → ratios of highest likelihood between the grid's, and the standard deviation of the white noise."""
    ratios, _ = best_noise(place, selected)
    free = [i for i, ratio in enumerate(ratios) if ratio]

    def at(logs: Array) -> tuple[float, ...]:
        values = list(ratios)
        for i, value in zip(free, logs, strict=True):
            values[i] = float(np.exp(value))
        return tuple(values)

    def cost(logs: Array) -> float:
        return -float(level(Space(place.basis, place.y, place.kernels), at(logs), place.y, selected)[2][0])

    if free:
        start = np.log([ratios[i] for i in free])
        ratios = at(optimize.minimize(cost, start, method="Nelder-Mead", options={"maxfev": 30, "xatol": 0.05, "fatol": 0.02}).x)
    white = level(place, ratios, place.y, selected)[0]
    left = place.m - selected.shape[1]
    return ratios, float(np.sqrt(np.sum(white**2) / max(left, 1)))


def gains(place: Space, lib: Library, ratios: tuple[float, ...], data: Array, selected: Array) -> tuple[Array, Array]:
    """ratios, data (m, B), selected → log likelihood of every block (blocks, B) with it and (B,) without any."""
    white, basis, without = level(place, ratios, data, selected)
    columns, whole, grams = whitened(place, lib, ratios)
    along = (columns.T @ white.astype(np.float32)).astype(float)  # (N, B)
    inside = (basis.T.astype(np.float32) @ columns).astype(float)
    explained = np.zeros((len(lib.size), white.shape[1]))
    for k, gram in grams.items():
        blocks = np.flatnonzero(lib.size == k)
        at = lib.start[blocks][:, None] + np.arange(k)
        part = inside.T[at]  # (b, k, s)
        left = gram - part @ part.transpose(0, 2, 1)
        left[:, np.arange(k), np.arange(k)] += RIDGE * whole[at] + 1e-12
        if k == 1:
            explained[blocks] = along[at[:, 0]] ** 2 / left[:, 0]
            continue
        right = along[at]  # (b, k, B)
        explained[blocks] = np.sum(right * np.linalg.solve(left, right), axis=1)
    rss = np.sum(white**2, axis=0)
    remain = np.maximum(rss - explained, 1e-6 * rss)
    return without + 0.5 * place.m * np.log(rss / remain), without


def scan(
    place: Space, lib: Library, selected: Array, settings: Sequence[tuple[float, ...]], data: Array | None = None
) -> tuple[Array, Array]:
    """settings, selected (m, s), data (m, B) → (blocks, B) log likelihood ratios, noise anew for each, and (B,) base."""
    y = place.y[:, None] if data is None else data
    with_it, without = None, None
    for ratios in settings:
        one, base = gains(place, lib, ratios, y, selected)
        with_it = one if with_it is None else np.maximum(with_it, one)
        without = base if without is None else np.maximum(without, base)
    assert with_it is not None and without is not None
    return with_it - without, without


def below(ratios: tuple[float, ...]) -> list[tuple[float, ...]]:
    """ratios → themselves and a few of what remains of them when a pattern takes its share."""
    steps = []
    for ratio in ratios:
        i = RATIOS.index(ratio)
        steps.append(sorted({RATIOS[j] for j in (0, max(i - 2, 0), i)}))
    axes = np.meshgrid(*steps, indexing="ij")
    return [tuple(float(v) for v in row) for row in np.array([a.ravel() for a in axes]).T] if ratios else [()]
