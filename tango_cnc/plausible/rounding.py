"""Positions that were rounded in a part of the rows, or in one axis: read off a display, or written with fewer digits.

A touch moves some axes and leaves others where they were sent, at round numbers. So only axes that make a part of the search
show what digits they have. Of honest positions in steps of 1 µm, one in five is a whole multiple of 5 µm by chance.

A drive that counts in steps (80 a millimetre, 4096 a turn of the screw) is read in steps of no round number. What is read of one
facet then errs alike every time: no residual shows it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..kinematics import chain, inverse, tip
from ..records import Array, Cell, Readings
from ..touches import FAR

STEPS = (0.1, 0.05, 0.0254, 0.01, 0.005, 0.00254)  # mm; 0.001 and 0.0001 inch too
SHARE = 0.05  # of a search that an axis makes: with less, it may stand at the round number of the program
FEWEST = 20  # positions in a row that are all whole multiples: by chance with steps of 1 µm, one in 10^13
SOME = 4  # positions here and there that are whole multiples, at least
FINE = (1e-3, 5e-4, 1e-4, 1e-5, 0.0)  # mm, digits that a control writes
OFTEN = 3  # times that another remainder has to come before it says how often one does by chance
LEVEL = 1e-8  # chance that so many of them are
SWAMPS = 3.0  # times the stated repeatability: a step makes a scatter of its length over √12
FINEST = 0.002  # mm
DIFFERENT = 8  # positions that have to lie on one lattice: by chance, one in 10^15
MOST = 40  # steps that the two nearest positions may lie apart
DIGIT = 1e-6  # mm, of readings.csv


def partly(cell: Cell, readings: Readings) -> Iterator[tuple[str, float, tuple[int, ...]]]:
    """cell, readings → (axis, step mm, touches) of each run of rows in which positions of an axis are whole multiples of a step.

    Rows that were made elsewhere are left out: where positions belong to other rows, an axis that was sent to a round number and
    stood there seems to have made the search.
    """
    used = readings.rows(readings.ok)
    used = used.rows(np.flatnonzero(away(cell, used) < FAR))
    every = list(_moved(cell, used))
    found = [(name, step, rows) for name, values, moved in every for step, rows in _rounded(values, moved)]
    for name, step, rows in found or _together(every):
        yield name, step, tuple(dict.fromkeys(int(t) for t in used.touch[rows]))


Moved = tuple[str, Array, NDArray[np.int64]]  # axis, its positions where it makes a part of the search, which rows these are


def _rounded(values: Array, moved: NDArray[np.int64]) -> Iterator[tuple[float, NDArray[np.int64]]]:
    """positions of one axis, their rows → the first step that a run of them, or many here and there, are whole multiples of."""
    for step in STEPS:
        longest = moved[_longest(_whole(values, step))]
        rows = longest if len(longest) >= FEWEST else moved[_scattered(values, step)]
        if len(rows):
            yield step, rows
            return


def _together(every: Sequence[Moved]) -> Iterator[tuple[str, float, NDArray[np.int64]]]:
    """The same of all axes together: a few rows of a short plan are one or two of each axis."""
    values = np.concatenate([own for _, own, _ in every]) if every else np.empty(0)
    for step in STEPS:
        if not (whole := _scattered(values, step)).any():
            continue
        for (name, _, moved), own in zip(every, np.split(whole, np.cumsum([len(v) for _, v, _ in every])[:-1]), strict=True):
            if own.any():
                yield name, step, moved[own]
        return


def grid(cell: Cell, readings: Readings) -> float:
    """cell, readings → mm, of which all positions of all axes are whole multiples, as where a control counts 0.0001 inch.

    0 where no such step fits all of them.
    """
    every = [values for _, values, _ in _moved(cell, readings.rows(readings.ok)) if len(values)]
    return next((step for step in STEPS if every and all(_whole(values, step).all() for values in every)), 0.0)


def swamping(cell: Cell) -> float:
    """cell → mm, the step from which on rounding swamps the stated repeatability: a finer one is scatter like any other."""
    return max(SWAMPS * cell.machine.probe.repeatability, FINEST)


def counted(cell: Cell, readings: Readings) -> Iterator[tuple[str, float]]:
    """cell, readings → (axis, step mm) of each axis whose positions all lie on a lattice that swamps the stated repeatability."""
    least = swamping(cell)
    for name, values, _ in _moved(cell, readings.rows(readings.ok)):
        if len(values) >= FEWEST and (step := _lattice(values, least)):
            yield name, step


def _moved(cell: Cell, used: Readings) -> Iterator[Moved]:
    """cell, touches that count → each axis with its positions."""
    if len(used) < FEWEST:
        return
    facets = [cell.artefact.facets[f] for f in used.facet]
    point, normal = np.array([f.point for f in facets]), np.array([f.normal for f in facets])
    own = chain(cell.machine)
    search = inverse(own, used.position, point + normal) - inverse(own, used.position, point)
    for name in cell.machine.linear:
        column = used.axes.index(name)
        rows = np.flatnonzero(np.abs(search[:, column]) > SHARE)
        yield name, used.position[rows, column], rows


def away(cell: Cell, used: Readings) -> Array:
    """cell, touches that count → (n,) mm between the tip and where it would touch by the drawings."""
    facets = [cell.artefact.facets[f] for f in used.facet]
    radius = cell.machine.probe.tip_radius
    contact = np.array([np.array(f.point) + radius * np.array(f.normal) for f in facets]).reshape(-1, 3)
    return np.asarray(np.linalg.norm(tip(chain(cell.machine), used.position) - contact, axis=-1))


def _lattice(values: Array, least: float) -> float:
    """(n,) mm, mm → the largest step from `least` on of which all lie whole multiples apart; 0 where there is none.

    The two nearest positions are a few steps apart, which tells the step roughly; the far ones tell it sharply: a periodogram.
    """
    from_first = np.unique(np.round(values - values.min(), 6))
    near = float(np.diff(from_first).min(initial=np.inf))
    if len(from_first) < DIFFERENT:
        return 0.0
    for apart in range(1, min(MOST, int(near / least)) + 1):
        rate = apart / near
        rates = rate + np.arange(-2 * DIGIT * rate / near, 2 * DIGIT * rate / near, 0.05 / from_first[-1])
        best = rates[np.argmax(np.abs(np.exp(2j * np.pi * rates[:, None] * from_first).mean(axis=1)))]
        step, first = np.polyfit(np.round(from_first * best), from_first, 1)
        if np.abs(from_first - first - step * np.round(from_first * best)).max() < 2 * DIGIT:
            return float(step)
    return 0.0


def _whole(values: Array, step: float) -> NDArray[np.bool_]:
    if not step:
        return np.ones(len(values), dtype=np.bool_)
    return np.asarray(np.abs(values / step - np.round(values / step)) < 1e-6 / step)


def _scattered(values: Array, step: float) -> NDArray[np.bool_]:
    """positions, mm → (n,) which are whole multiples of the step, where far more of them are than of any other remainder.

    Positions in steps of their own have a few remainders, all alike frequent. Equal positions count once.
    """
    whole = _whole(values, step)
    rest = np.round(np.mod(np.unique(values), step) / DIGIT).astype(np.int64) % round(step / DIGIT)
    _, others = np.unique(rest[rest != 0], return_counts=True)
    count, n, most = int((rest == 0).sum()), len(rest), int(others.max(initial=0))
    chance = max(next(d for d in FINE if _whole(values, d).all()) / step, most / n if most >= OFTEN else 0.0)
    if count < SOME or chance >= 1 or special.bdtrc(count - 1, n, chance) > LEVEL:
        whole[:] = False
    return whole


def _longest(flags: NDArray[np.bool_]) -> slice:
    """→ the longest stretch that is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return slice(0, 0)
    longest = int(np.argmax(ends - begins))
    return slice(int(begins[longest]), int(ends[longest]))
