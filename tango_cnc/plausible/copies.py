"""Cycles and days that repeat an earlier one digit for digit: pasted, not measured.

Honest cycles scatter by the repeatability of the probe, and a pasted copy by nothing: the uncertainty that repetitions show would
come out as 0.00. A copy that was shifted as a whole is one too.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import special

from ..records import Array, Machine, Readings

ALIKE = 0.02  # of the stated repeatability: of honest touches one in a hundred comes so near to the one before
QUIET = 0.2  # of the stated repeatability: cycles that agree better were copied, or it is stated far too large
SHARE = 0.9  # of the touches of two cycles that have to be alike
FEWEST = 10  # touches that both have
FINEST = 1e-5  # mm: differences below this are rounding
BETTER = 0.5  # of the stated repeatability: so much better than stated many a probe repeats
DIGITS = (1.0, 0.1, 0.01, 0.001, 1e-4)  # mm: last digits of positions
Pass = tuple[int, int]  # day and cycle


def copied(machine: Machine, readings: Readings) -> Iterator[tuple[tuple[int, int], tuple[int, int], bool]]:
    """machine, readings → (day, cycle) of each that repeats an earlier one, (day, cycle) of that, whether it was shifted.

    Positions whose last digit is coarser than the repeatability say nothing: two honest touches often read the same there.
    """
    known = set()
    for later, before, apart in _pairs(machine, readings):
        shift = np.median(apart, axis=1, keepdims=True)
        alike = np.all(np.abs(apart - shift) < max(ALIKE * machine.probe.repeatability, FINEST), axis=2).mean(axis=1)
        for i in np.flatnonzero(alike > SHARE)[: later not in known]:
            known.add(later)
            yield later, before[i], bool(np.any(np.abs(shift[i]) > FINEST))


def too_alike(machine: Machine, readings: Readings) -> Iterator[tuple[tuple[int, int], tuple[int, int], float]]:
    """machine, readings → (day, cycle), (day, cycle) before it, mm that a touch scatters by, where that is too little.

    Half of the touches decide, so that single bad ones do not hide it; the axis that moves farthest from touch to touch counts.
    """
    for later, before, apart in _pairs(machine, readings):
        away = np.abs(apart - np.median(apart, axis=1, keepdims=True)).max(axis=2)
        scatter = np.median(away, axis=1) / 0.6745 / np.sqrt(2)  # of normal noise, half lies within 0.6745 standard deviations
        for i in np.flatnonzero(scatter < QUIET * machine.probe.repeatability):
            yield later, before[i], float(scatter[i])


def _pairs(machine: Machine, readings: Readings) -> Iterator[tuple[Pass, list[Pass], Array]]:
    """→ (day, cycle), e of those before it, (e, n, k) mm between their positions; none where the digits cannot tell.

    Where all have the same touches, a pass is compared with all before it at once: there may be hundreds.
    """
    used = readings.rows(readings.ok)
    columns = [used.axes.index(name) for name in used.axes if name in machine.linear]
    passes = list(dict.fromkeys(zip(used.day.tolist(), used.cycle.tolist(), strict=True)))
    repeats = machine.probe.repeatability
    if len(passes) < 2 or repeats <= 0 or last_digit(used.position[:, columns]) > repeats:
        return
    own = {p: np.flatnonzero((used.day == p[0]) & (used.cycle == p[1])) for p in passes}
    ordered = [rows[np.argsort(used.touch[rows], kind="stable")] for rows in own.values()]
    numbers = used.touch[ordered[0]]
    if len(numbers) >= FEWEST and np.all(np.diff(numbers) > 0) and all(np.array_equal(used.touch[r], numbers) for r in ordered):
        at = used.position[np.stack(ordered)][:, :, columns]
        for i, later in enumerate(passes[1:], 1):
            yield later, passes[:i], at[i] - at[:i]
        return
    for i, later in enumerate(passes):
        for earlier in passes[:i]:
            _, a, b = np.intersect1d(used.touch[own[later]], used.touch[own[earlier]], return_indices=True)
            if len(a) >= FEWEST:
                yield later, [earlier], (used.position[own[later][a]] - used.position[own[earlier][b]])[None][:, :, columns]


def last_digit(values: Array) -> float:
    """positions, mm → the coarsest of DIGITS of which all are whole multiples; 0 where they have more digits."""
    return next((d for d in DIGITS if np.all(np.abs(values / d - np.round(values / d)) < 1e-6 / d)), 0.0) if values.size else 0.0


def alike_by_chance(machine: Machine, readings: Readings) -> float:
    """machine, readings → chance that so many touches have exactly the position of another one, 0 … 1.

    Touches of one facet at one rotary position scatter by the repeatability, and where that is no more than a few digits of the
    control many honest ones end on the same digits. Those of different facets never do.
    """
    used = readings.rows(readings.ok)
    linear = [used.axes.index(name) for name in used.axes if name in machine.linear]
    turned = np.delete(used.position, linear, axis=1)
    pairs = _couples(used.position)
    could = _couples(np.column_stack([np.unique(used.facet, return_inverse=True)[1], np.round(turned, 6)]))
    if pairs > could:
        return 0.0
    digit = last_digit(used.position[:, linear])
    return float(special.bdtrc(pairs - 1, could, _same_digits(digit, BETTER * machine.probe.repeatability))) if pairs else 1.0


def _couples(rows: Array) -> int:
    """(n, k) → how many couples of rows are equal."""
    _, count = np.unique(rows, axis=0, return_counts=True)
    return int((count * (count - 1) // 2).sum())


def _same_digits(digit: float, scatter: float) -> float:
    """last digit, standard deviation of a touch, mm → chance that two touches of one point round to the same digits.

    Apart by δ, they do with a chance of 1 − |δ| / digit, and δ has √2 times the scatter.
    """
    if scatter <= 0 or digit <= 0:
        return float(digit > 0)
    apart = np.sqrt(2) * scatter / digit
    far = 1 / (np.sqrt(2) * apart)
    return float(special.erf(far) + apart * np.sqrt(2 / np.pi) * np.expm1(-(far**2)))
