"""Positions that were rounded in a part of the rows, or in one axis: read off a display, or written with fewer digits.

A touch moves some axes and leaves others where they were sent, at round numbers. So only axes that make a part of the search
show what digits they have. Of honest positions in steps of 1 µm, one in five is a whole multiple of 5 µm by chance.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..kinematics import chain, inverse
from ..records import Array, Cell, Readings

STEPS = (0.1, 0.05, 0.0254, 0.01, 0.005, 0.00254)  # mm; 0.001 and 0.0001 inch too
SHARE = 0.05  # of a search that an axis makes: with less, it may stand at the round number of the program
FEWEST = 20  # positions in a row that are all whole multiples: by chance with steps of 1 µm, one in 10^13


def partly(cell: Cell, readings: Readings) -> Iterator[tuple[str, float, tuple[int, ...]]]:
    """cell, readings → (axis, step mm, touches) of each run of rows in which positions of an axis are whole multiples of a step."""
    used = readings.rows(readings.ok)
    if len(used) < FEWEST:
        return
    facets = [cell.artefact.facets[f] for f in used.facet]
    point, normal = np.array([f.point for f in facets]), np.array([f.normal for f in facets])
    own = chain(cell.machine)
    search = inverse(own, used.position, point + normal) - inverse(own, used.position, point)
    for name in cell.machine.linear:
        column = used.axes.index(name)
        moved = np.flatnonzero(np.abs(search[:, column]) > SHARE)
        for step in STEPS:
            rows = moved[_longest(_whole(used.position[moved, column], step))]
            if len(rows) >= FEWEST:
                yield name, step, tuple(dict.fromkeys(int(t) for t in used.touch[rows]))
                break


def _whole(values: Array, step: float) -> Array:
    return np.asarray(np.abs(values / step - np.round(values / step)) < 1e-6 / step)


def _longest(flags: Array) -> slice:
    """→ the longest stretch that is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    if not len(begins):
        return slice(0, 0)
    longest = int(np.argmax(ends - begins))
    return slice(int(begins[longest]), int(ends[longest]))
