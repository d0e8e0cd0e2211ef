"""Repeated runs → four numbers with four names: the mean, its uncertainty, that of one run, and where the next run will be.

    mean         of all runs: the best value
    of the mean  how far it is from the machine in the long run: means of days scatter; K days have K − 1 degrees of freedom
    one run      how far a single run is from the machine in the long run: days and runs within a day scatter
    prediction   how far the next run, on another day, will be from the mean; what no repetition shows acts alike in both

Days are drawn at random, and so are runs within a day. Where they fall on one day alone, what changes from day to day is not
seen. No number is smaller than runs alone make it: the variance between days cannot be below 0. Source: variance components of a
balanced nested design (ISO 5725-3; JCGM 100:2008, H.5), Satterthwaite's degrees of freedom (G.4); intervals of sums of mean
squares after Graybill and Wang (1980).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from ..records import Array, InputError

NAMES = ("mean", "one run", "prediction")


@dataclass(frozen=True)
class Spread:
    """A standard uncertainty with its degrees of freedom, and the half width of its interval; (q,) each."""

    std: Array
    dof: Array
    half: Array

    def fair(self, i: int, probability: float) -> float:
        """place, probability of the intervals → the standard uncertainty that with `dof` gives the half width."""
        return float(self.half[i] / special.stdtrit(min(self.dof[i], 1e9), 0.5 + probability / 2))


@dataclass(frozen=True)
class Repetitions:
    """The four numbers of q parameters."""

    mean: Array  # (q,)
    of_mean: Spread
    one_run: Spread
    prediction: Spread
    days: int
    runs: int  # of a day

    def of(self, name: str) -> Spread:
        """mean | one run | prediction → its spread."""
        return {"mean": self.of_mean, "one run": self.one_run, "prediction": self.prediction}[name]

    @property
    def text(self) -> str:
        """→ what the four numbers rest on."""
        if self.days > 1:
            return f"{self.days} days of {self.runs} runs"
        return f"{self.runs} runs of one day: what changes from day to day is not in these numbers"


def repetitions(values: Array, fixed: Array, probability: float = 0.95) -> Repetitions:
    """(K, J, q) estimates of J runs on each of K days, (q,) std of what no repetition shows → the four numbers.

    Raises InputError for a single run.
    """
    k, j, _ = values.shape
    if k * j < 2:
        raise InputError("repetitions: found one run; allowed: two or more")
    mean, days = values.mean(axis=(0, 1)), values.mean(axis=1)
    inside = np.sum((values - days[:, None]) ** 2, axis=(0, 1)) / max(k * (j - 1), 1)  # of a run about its day
    if k == 1:
        parts = [(inside, float(j - 1))]
        of_mean, one = np.array([1.0 / j]), np.array([1.0])
    else:
        between = np.sum((days - mean) ** 2, axis=0) / (k - 1)  # of the mean of a day
        parts = [(between, float(k - 1))] + ([(inside, float(k * (j - 1)))] if j > 1 else [])
        of_mean = np.array([1.0 / k, 0.0][: len(parts)])
        one = np.array([1.0, 1.0 - 1.0 / j][: len(parts)])
    constant = np.asarray(fixed) ** 2

    def of(weights: Array, known: Array, alone: float) -> Spread:
        spread = _spread(weights, parts, known, probability)
        if k == 1 or j == 1:
            return spread
        return _at_least(spread, _spread(np.array([alone]), parts[1:], known, probability))

    share = 1.0 / (k * j)
    one_run, later = of(one, constant, 1.0), of(one + of_mean, 0 * constant, 1.0 + share)
    return Repetitions(mean, of(of_mean, constant, share), one_run, later, k, j)


def _at_least(spread: Spread, runs: Spread) -> Spread:
    """spread by days and runs, what runs alone would leave if days differed by nothing → the wider one of each parameter.

    Two days that happen to agree say of a parameter that it varies by nothing, beside runs that show how much it does.
    """
    less = spread.half < runs.half
    pairs = ((spread.std, runs.std), (spread.dof, runs.dof), (spread.half, runs.half))
    return Spread(*(np.where(less, two, one) for one, two in pairs))


def _spread(weights: Array, parts: list[tuple[Array, float]], constant: Array, probability: float) -> Spread:
    """Weights of the mean squares, what is known without degrees of freedom → their sum by Welch and Satterthwaite."""
    terms = [w * square for w, (square, _) in zip(weights, parts, strict=True)]
    variance = np.sum(terms, axis=0) + constant
    below = np.sum([t**2 / dof for t, (_, dof) in zip(terms, parts, strict=True)], axis=0)
    dof = np.full_like(variance, np.inf)
    np.divide(variance**2, below, out=dof, where=below > 0)
    # How much wider than normal each part makes it, joined as independent: of few days one Satterthwaite factor holds too seldom.
    normal = float(special.ndtri(0.5 + probability / 2)) ** 2
    wider = [float(special.stdtrit(freedom, 0.5 + probability / 2)) ** 2 - normal for _, freedom in parts]
    more = np.sqrt(np.sum([(w * t) ** 2 for w, t in zip(wider, terms, strict=True)], axis=0))
    return Spread(np.sqrt(variance), dof, np.sqrt(normal * variance + more))
