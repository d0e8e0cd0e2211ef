"""Monte Carlo of the whole nonlinear estimation: every trial disturbs the inputs and estimates again (JCGM 101, 102).

The Jacobian is frozen at the converged estimate and factorised once (chord iteration): first the linear step, one product
of matrices for a thousand trials, then exact gaps and corrections until the last one is negligible. A frozen Jacobian solves
J₀ᵀr = 0 instead of Jᵀr = 0; what that and the single precision cost is measured by `accuracy`, each time, and reported.
Trials come in chunks with a generator each, so that any number of workers gives the same result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Array, TangoError
from . import _batch
from .inputs import draw
from .study import Study, solve

CHUNK = 1024
BLOCK = 96  # trials; in single precision their temporaries just fill a second-level cache of 1 MB
ENOUGH = 1e-2  # of a standard uncertainty, bound on what is left out; really it is a tenth, `accuracy` measures it
ITERATIONS = 8

Mapper = Callable[[Callable[[int], Any], Iterable[int]], Iterable[Any]]  # map, or one that spreads over a cluster


@dataclass(frozen=True)
class Trials:
    """What the trials gave: `deviation` (T, q) of the outputs from the estimate, in standard uncertainties."""

    deviation: NDArray[np.float32]
    evaluations: int  # of all gaps of a trial
    rescued: int  # trials that needed the full iteration
    lost: int  # trials without a solution, left out

    @property
    def count(self) -> int:
        """→ T, number of trials with a solution."""
        return len(self.deviation)


@dataclass(frozen=True)
class Accuracy:
    """Chord against full Gauss–Newton on the same inputs, in standard uncertainties."""

    trials: int
    largest: float
    rms: float
    std_ratio: float  # worst |std chord / std full − 1| over the outputs


def run(study: Study, count: int, seed: int = 1, first: int = 0, mapper: Mapper = map, full: bool = False) -> Trials:
    """study, number of trials, seed, first chunk, `map` or one that spreads over a cluster → trials.

    `full`: every trial by Gauss–Newton in double precision, a few hundred times slower.
    """
    sizes = [min(CHUNK, count - i) for i in range(0, count, CHUNK)]
    work = partial(_chunk, study, seed, sizes, first, full)
    done = list(mapper(work, range(len(sizes))))
    return merge(done)


def merge(done: list[Trials]) -> Trials:
    """trials of several chunks → all of them, in order."""
    return Trials(
        np.concatenate([t.deviation for t in done]),
        sum(t.evaluations for t in done),
        sum(t.rescued for t in done),
        sum(t.lost for t in done),
    )


def _chunk(study: Study, seed: int, sizes: list[int], first: int, full: bool, number: int) -> Trials:
    rng = np.random.default_rng([seed, first + number])
    deviations = draw(rng, sizes[number], *study.sampling)
    return (
        _solved(study, deviations, deviations @ study.gain.T, np.arange(len(deviations)), 0)
        if full
        else solutions(study, deviations)
    )


def solutions(study: Study, deviations: Array) -> Trials:
    """study, (T, n + m) mm deviations of the inputs → the estimates they lead to, nonlinear."""
    ready = _batch.batch(study.model)
    scale = _scale(study)
    change = deviations @ study.gain.T
    before = np.max(np.abs(change) * scale, axis=1)
    open_ = np.arange(len(deviations))
    evaluations = 0
    for _ in range(ITERATIONS):
        left = np.empty(len(open_))
        for at in range(0, len(open_), BLOCK):
            rows = open_[at : at + BLOCK]
            step = _correction(study, ready, deviations[rows], change[rows])
            change[rows] += step
            size = np.max(np.abs(step) * scale, axis=1)
            # The last correction times its own contraction is what would still come.
            left[at : at + BLOCK] = size * size / np.maximum(before[rows], 1e-30)
            before[rows] = size
        evaluations += len(open_)
        open_ = open_[~(left <= ENOUGH)]
        if not len(open_):
            break
    return _solved(study, deviations, change, open_, evaluations)


def _solved(study: Study, deviations: Array, change: Array, rows: NDArray[np.int64], evaluations: int) -> Trials:
    """Solves `rows` in full, takes `change` for the others → trials."""
    good = np.ones(len(deviations), dtype=bool)
    for i in rows:
        try:
            change[i] = solve(study.model, study.values, study.weight, deviations[i]) - study.values
        except (TangoError, np.linalg.LinAlgError):
            good[i] = False
    result = (change[:, study.outputs] * _scale(study)[study.outputs]).astype(np.float32)
    return Trials(result[good], evaluations, int(good[rows].sum()), int((~good).sum()))


def _scale(study: Study) -> Array:
    return np.where(study.std > 0, 1 / np.where(study.std > 0, study.std, 1.0), 0.0)


def _correction(study: Study, ready: _batch.Batch, deviations: Array, change: Array) -> Array:
    """→ (b, p) next step of the chord iteration."""
    values = study.values + change
    right = np.empty_like(deviations)
    with np.errstate(all="ignore"):
        right[:, : study.count] = _batch.gaps(ready, values)
        right[:, study.count :] = _batch.known_residuals(study.model, values)
        right += deviations
        step: Array = right @ study.gain.T
    return step


def accuracy(study: Study, count: int = 64, seed: int = 1) -> Accuracy:
    """study, number of trials → how far the chord ends from the full iteration in double precision."""
    rng = np.random.default_rng([seed, 2**31])
    deviations = draw(rng, count, *study.sampling)
    chord = solutions(study, deviations)
    if chord.lost:
        return Accuracy(count, np.inf, np.inf, np.inf)
    scale = _scale(study)
    full = np.array([solve(study.model, study.values, study.weight, d) - study.values for d in deviations]) * scale
    full = full[:, study.outputs]
    off = chord.deviation - full
    spread = np.std(full, axis=0)
    ratio = np.std(chord.deviation, axis=0, dtype=float) / np.where(spread > 0, spread, 1.0)
    return Accuracy(
        count, float(np.abs(off).max()), float(np.sqrt((off**2).mean())), float(np.abs(np.where(spread > 0, ratio - 1, 0)).max())
    )
