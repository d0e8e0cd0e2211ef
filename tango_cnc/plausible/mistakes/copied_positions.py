"""A position was copied from row to row: one axis stands still to the last digit, while the facets ask it to move."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis

FEWEST = 5  # rows in a row
AWAY = 1.0  # mm beside or beyond the contact, of more than half of them


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the readings without the longest run of rows with one position of an axis that does not fit."""
    machine, readings = case.machine, case.readings
    wrong = np.maximum(np.abs(case.stated.gaps), case.stated.beside) > AWAY
    found = []
    for name in machine.linear:
        values = readings.position[:, machine.column(name)]
        ends = [0, *(np.flatnonzero(np.diff(values) != 0) + 1).tolist(), len(values)]
        for first, last in pairwise(ends):
            if last - first >= FEWEST and wrong[first:last].mean() > 0.5:
                found.append((last - first, name, slice(first, last)))
    if not found:
        return
    count, name, rows = max(found, key=lambda f: f[0])
    touches = tuple(int(t) for t in readings.touch[rows])
    keep = np.ones(len(readings), dtype=np.bool_)
    keep[rows] = False
    value = f"{readings.position[rows.start, machine.column(name)]:g}"
    yield Hypothesis(
        say(
            "mistake.copied_positions.without",
            first=touches[0],
            last=touches[-1],
            axis=name,
            value=value,
            count=count,
        ),
        "readings",
        name,
        say("mistake.copied_positions.again"),
        readings=readings.rows(keep),
        touches=touches,
        price=5.0,
    )
