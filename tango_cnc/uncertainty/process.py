"""Is a difference one? Estimates of several sets of touches against each other, given their uncertainty (thesis chapter 8).

Sets may be strategies, the state before and after a remount, subsets of the indexations of one run, cycles of a day, days.
Two questions are kept apart. Repeated cycles answer by their own scatter (analysis of variance, F). Single sets answer by
the stated budget (χ² of the differences), in which what acts on both alike, the bar or the probe's lobing, cancels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..records import Array, InputError
from .inputs import Part
from .study import Study

LEVEL = 0.05  # of the whole family of statements
SPOT_MM, SPOT_RAD = 0.5, 0.002  # touches nearer than this meet the same spot of a facet


@dataclass(frozen=True)
class Group:
    """One set of touches: its estimate and what each line of the budget does to it."""

    label: str
    values: Array  # (q,)
    moved: Mapping[str, Array]  # line → (q, k): change of the outputs per ξ
    parts: Mapping[str, Part]
    run: str  # groups of one run share every ξ
    facets: tuple[str, ...] = ()  # n touched
    position: Array | None = None  # (n, k) where, in units of what still is the same spot of a facet


@dataclass(frozen=True)
class Comparison:
    """One row a parameter, in the order of `names`."""

    names: tuple[str, ...]
    labels: tuple[str, ...]
    values: Array  # (S, q)
    u_difference: Array | None  # (q,) largest standard uncertainty of a difference of two sets
    statistic: Array  # (q,)
    p_value: Array  # (q,)
    joint_p: float | None
    method: str
    differs: NDArray[np.bool_] = field(default_factory=lambda: np.array([], dtype=bool))

    @property
    def mean(self) -> Array:
        """→ (q,) over the sets."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def range(self) -> Array:
        """→ (q,) largest minus smallest."""
        return np.asarray(np.ptp(self.values, axis=0))

    @property
    def std(self) -> Array:
        """→ (q,) standard deviation over the sets."""
        return np.asarray(self.values.std(axis=0, ddof=1))


def holm(p: Array, level: float = LEVEL) -> NDArray[np.bool_]:
    """(q,) p-values → (q,) which are significant when all statements together may err with `level` (Holm 1979)."""
    order = np.argsort(p)
    limits = level / (len(p) - np.arange(len(p)))
    good = np.logical_and.accumulate(p[order] <= limits)
    result = np.zeros(len(p), dtype=bool)
    result[order] = good
    return result


def group(label: str, study: Study, outputs: NDArray[np.int64], run: str) -> Group:
    """study of one set, places of the parameters to compare, name of its run → group."""
    touches = study.model.touches
    linear = np.array([name in touches.machine.linear for name in touches.machine.names])
    position = touches.position / np.where(linear, SPOT_MM, SPOT_RAD)
    gain = study.gain[outputs]
    moved = {part.label: gain @ part.factor for part in study.parts}
    return Group(label, study.values[outputs], moved, {part.label: part for part in study.parts}, run, touches.facet, position)


def compare(names: Sequence[str], groups: Sequence[Group]) -> Comparison:
    """names (q), two or more sets → whether each parameter differs by more than the budget explains (χ², S − 1 degrees).

    Raises InputError for a single set.
    """
    if len(groups) < 2:
        raise InputError(f"compare: found {len(groups)} set of touches; allowed: two or more")
    values = np.array([g.values for g in groups])
    sets, q = values.shape
    covariance = np.zeros((sets, q, sets, q))
    for a, first in enumerate(groups):
        for b, second in enumerate(groups):
            covariance[a, :, b, :] = _between(first, second)
    contrast = np.vstack([np.eye(sets)[1:] - np.eye(sets)[0]])
    u_difference = np.zeros(q)
    statistic, p = np.zeros(q), np.ones(q)
    for j in range(q):
        own = covariance[:, j, :, j]
        variances = np.diag(own)[:, None] + np.diag(own)[None, :] - own - own.T
        u_difference[j] = np.sqrt(max(float(variances.max()), 0.0))
        statistic[j], p[j] = _chi_square(contrast @ values[:, j], contrast @ own @ contrast.T)
    everything = np.kron(contrast, np.eye(q))
    _, joint = _chi_square(everything @ values.ravel(), everything @ covariance.reshape(sets * q, -1) @ everything.T)
    method = "χ² of the differences against the budget"
    return Comparison(tuple(names), tuple(g.label for g in groups), values, u_difference, statistic, p, joint, method, holm(p))


def _between(first: Group, second: Group) -> Array:
    """→ (q, q) covariance of two estimates."""
    total = np.zeros((len(first.values), len(second.values)))
    for label, moved in first.moved.items():
        part, other = first.parts[label], second.moved.get(label)
        same = first is second or first.run == second.run or part.shared or (not part.repeats and _same_plan(first, second))
        if same and other is not None and other.shape[1] == moved.shape[1]:
            total += moved @ other.T
    return total


def _same_plan(first: Group, second: Group) -> bool:
    if first.position is None or second.position is None or first.facets != second.facets:
        return False
    return bool(np.all(np.abs(first.position - second.position) < 1))


def _chi_square(difference: Array, covariance: Array) -> tuple[float, float]:
    """difference, its covariance → statistic and p-value; directions that cannot differ are left out."""
    scale = np.sqrt(np.diag(covariance))
    if not np.any(scale > 0):
        return 0.0, 1.0
    keep = scale > 0
    size, vectors = np.linalg.eigh(covariance[np.ix_(keep, keep)] / np.outer(scale[keep], scale[keep]))
    # Fainter directions than a thousandth are decided by what the linearisation leaves, not by the budget.
    real = size > 1e-6 * size[-1]
    along = (vectors.T @ (difference[keep] / scale[keep]))[real]
    value = float(np.sum(along**2 / size[real]))
    return value, float(special.chdtrc(int(real.sum()), value))


@dataclass(frozen=True)
class DayAndCycle:
    """Thesis Table 5-3: change between days and through the day, from K days of J cycles."""

    names: tuple[str, ...]
    mean: Array  # (q,)
    day_means: Array  # (K, q)
    cycle_means: Array  # (J, q)
    std_within: Array  # (q,) of one cycle, what neither day nor time of day explains
    p_days: Array | None  # (q,); None when there is but one day
    p_cycles: Array | None
    days_differ: NDArray[np.bool_]
    cycles_differ: NDArray[np.bool_]


def day_and_cycle(names: Sequence[str], values: Array) -> DayAndCycle:
    """names (q), estimates (K, J, q) → two-way analysis of variance without interaction (thesis section 5.5).

    With one day (or one cycle a day) nothing is left to judge by and no statement is made.
    Raises InputError when nothing was repeated.
    """
    days, cycles, q = values.shape
    if days * cycles < 2:
        raise InputError("uncertainty: found one cycle on one day; allowed: repeated cycles or days for their comparison")
    mean = values.mean(axis=(0, 1))
    day_means, cycle_means = values.mean(axis=1), values.mean(axis=0)
    rest = values - day_means[:, None] - cycle_means[None] + mean
    dof = (days - 1) * (cycles - 1)
    none = np.zeros(q, dtype=bool)
    if dof < 1:
        spread = values.reshape(-1, q).std(axis=0, ddof=1)
        return DayAndCycle(tuple(names), mean, day_means, cycle_means, spread, None, None, none, none)
    within = np.sum(rest**2, axis=(0, 1)) / dof
    safe = np.where(within > 0, within, np.inf)
    f_days = cycles * np.var(day_means, axis=0, ddof=1) / safe
    f_cycles = days * np.var(cycle_means, axis=0, ddof=1) / safe
    p_days, p_cycles = special.fdtrc(days - 1, dof, f_days), special.fdtrc(cycles - 1, dof, f_cycles)
    return DayAndCycle(tuple(names), mean, day_means, cycle_means, np.sqrt(within), p_days, p_cycles, holm(p_days), holm(p_cycles))


def one_way(names: Sequence[str], labels: Sequence[str], sets: Sequence[Array]) -> Comparison:
    """names (q), sets of repeated estimates (r_s, q) → whether the set means differ by more than repetitions do (F).

    Raises InputError when no set was repeated.
    """
    means = np.array([s.mean(axis=0) for s in sets])
    counts = np.array([len(s) for s in sets])
    dof = int(counts.sum() - len(sets))
    if len(sets) < 2 or dof < 1:
        raise InputError("compare: found no repeated cycles; allowed: two or more sets with at least one repetition among them")
    within = sum(np.sum((s - s.mean(axis=0)) ** 2, axis=0) for s in sets) / dof
    overall = np.average(means, axis=0, weights=counts)
    between = np.sum(counts[:, None] * (means - overall) ** 2, axis=0) / (len(sets) - 1)
    statistic = between / np.where(within > 0, within, np.inf)
    p = special.fdtrc(len(sets) - 1, dof, statistic)
    pair = np.sort(1 / counts)[-2:].sum()
    method = f"F of the set means against repeated cycles ({dof} degrees of freedom)"
    return Comparison(tuple(names), tuple(labels), means, np.sqrt(within * pair), statistic, p, None, method, holm(p))


def subsets(choices: Mapping[str, Sequence[int]], touches_of: Mapping[int, NDArray[np.int64]]) -> dict[str, NDArray[np.int64]]:
    """label → indexation numbers (1, 2, 3 …), rows of every indexation → label → rows of its touches.

    Raises InputError for an indexation that was not measured.
    """
    result = {}
    for label, numbers in choices.items():
        for number in numbers:
            if number not in touches_of:
                raise InputError(f"--subset {label}: found indexation {number}; allowed: 1 to {max(touches_of)}")
        result[label] = np.sort(np.concatenate([touches_of[number] for number in numbers]))
    return result
