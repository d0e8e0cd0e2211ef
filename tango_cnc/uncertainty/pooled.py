"""Repeated cycles over days → pooled covariances of the readings (thesis sections 5.6 and 8.4.4).

The input quantities are the gaps of a cycle's touches, all at the same reference estimate. Cycles at the same time of
different days differ by the measurement process alone: pooling them by cycles leaves out what the machine does through a
day. Cycles of one day differ by that as well: pooling by days keeps both, and leaves out what changes from day to day.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..model import Model, residual
from ..records import Array, Artefact, InputError, Machine, Readings
from ..touches import from_readings
from .inputs import Part
from .study import solve, system

Pool = Literal["cycles", "days"]


@dataclass(frozen=True)
class Repeated:
    """The same touches again and again: rows of every cycle that all cycles have in common."""

    days: tuple[int, ...]
    cycles: tuple[int, ...]
    models: tuple[tuple[Model, ...], ...]  # [day][cycle]
    values: Array  # (K, J, p) an estimate for every cycle
    touches: int  # n common to all
    left_out: int  # touches of the plan that some cycle lacks

    @property
    def mean(self) -> Array:
        """→ (p,) mean of all cycles."""
        return np.asarray(self.values.mean(axis=(0, 1)))


def split(readings: Readings) -> tuple[list[Readings], list[int], list[int], int]:
    """readings → those of every (day, cycle) in day-major order with the touches common to all, days, cycles, number left out.

    Raises InputError when a day lacks cycles that another has.
    """
    ok = readings.rows(readings.ok)
    days, cycles = sorted(set(ok.day.tolist())), sorted(set(ok.cycle.tolist()))
    groups = [ok.rows((ok.day == d) & (ok.cycle == c)) for d in days for c in cycles]
    for group, (d, c) in zip(groups, [(d, c) for d in days for c in cycles], strict=True):
        if not len(group):
            raise InputError(
                f"readings: found no cycle {c} on day {d}; allowed: the same cycles on every day. "
                "Delete the incomplete cycle's rows of all days, or give one day only"
            )
    common = set.intersection(*(set(group.touch.tolist()) for group in groups))
    every = set.union(*(set(group.touch.tolist()) for group in groups))
    kept = [group.rows(np.isin(group.touch, list(common))) for group in groups]
    return kept, days, cycles, len(every) - len(common)


def repeated(machine: Machine, artefact: Artefact, readings: Readings, like: Model, start: Array, sigma: float) -> Repeated:
    """readings of several cycles, model and estimate (p,) to start from, sigma mm of a touch → an estimate for every cycle.

    Raises InputError when the days are incomplete or a cycle's touches do not determine the model.
    """
    groups, days, cycles, left_out = split(readings)
    models = [replace(like, touches=from_readings(machine, artefact, group)) for group in groups]
    for model in models:
        if model.names != like.names:
            raise InputError("readings: the touches that all cycles have in common miss a facet or ball; repeat that cycle")
    _, _, weight = system(models[0], start, sigma=sigma)
    values = np.array([solve(model, start, weight) for model in models])
    shape = (len(days), len(cycles))
    grid = tuple(tuple(models[i * shape[1] : (i + 1) * shape[1]]) for i in range(shape[0]))
    return Repeated(tuple(days), tuple(cycles), grid, values.reshape(*shape, -1), len(groups[0]), left_out)


def gaps_of(of: Repeated) -> Array:
    """repeated cycles → (K, J, n) mm, gaps of every cycle at the mean estimate."""
    mean = of.mean
    return np.array([[residual(model, mean) for model in day] for day in of.models])


def deviations(gaps: Array, pool: Pool) -> tuple[Array, int]:
    """(K, J, n) mm → (K·J, n) deviations from the means of their groups, degrees of freedom. Raises InputError for too few.

    by cycles: each cycle number over the days, J (K − 1); by days: each day over its cycles, K (J − 1).
    """
    days, cycles, n = gaps.shape
    axis, dof = (0, cycles * (days - 1)) if pool == "cycles" else (1, days * (cycles - 1))
    if dof < 1:
        needed = "two days" if pool == "cycles" else "two cycles a day"
        raise InputError(f"--pool {pool}: found {days} day(s) of {cycles} cycle(s); allowed: at least {needed}")
    return (gaps - gaps.mean(axis=axis, keepdims=True)).reshape(-1, n), dof


def pooled_part(of: Repeated, pool: Pool, known: int) -> Part:
    """repeated cycles, by what, number m of known distances → what one cycle's readings scatter by, as a line of the budget."""
    rows, dof = deviations(gaps_of(of), pool)
    factor = np.vstack([rows.T / np.sqrt(dof), np.zeros((known, len(rows)))])
    return Part(f"pooled by {pool}", factor, "student", float(dof))
