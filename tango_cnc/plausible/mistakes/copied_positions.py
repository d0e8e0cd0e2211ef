"""A position was copied: an axis stands still to the last digit while the facets ask it to move, or a whole row is another's."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...texts import say
from ..data import listed
from ._case import Case, Hypothesis

FEWEST = 5  # rows in a row
PASTED = 2  # rows, at least, that are those of others
AWAY = 1.0  # mm beside or beyond the contact, of more than half of them


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the readings without the longest run of rows with one position of an axis that does not fit; without pasted rows."""
    machine, readings = case.machine, case.readings
    wrong = np.maximum(np.abs(case.stated.gaps), case.stated.beside) > AWAY
    yield from _pasted(case, wrong)
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


def _pasted(case: Case, wrong: NDArray[np.bool_]) -> Iterator[Hypothesis]:
    """Rows far from their facet whose linear axes are where they are in a row that fits: no two touches end on the same digits."""
    machine, readings = case.machine, case.readings
    place = np.round(readings.position[:, [machine.column(name) for name in machine.linear]], 7)
    right = {tuple(row): i for i, row in enumerate(place.tolist()) if not wrong[i]}
    pairs = [(i, right[key]) for i in np.flatnonzero(wrong) if (key := tuple(place[i].tolist())) in right]
    if len(pairs) < PASTED or len(pairs) > len(readings) / 2:
        return
    keep = np.ones(len(readings), dtype=np.bool_)
    keep[[i for i, _ in pairs]] = False
    touches = tuple(int(readings.touch[i]) for i, _ in pairs)
    others = listed([int(readings.touch[j]) for _, j in pairs])
    yield Hypothesis(
        say("mistake.copied_positions.pasted", listed=listed(touches), others=others),
        "readings",
        ", ".join(machine.linear),
        say("mistake.copied_positions.again"),
        readings=readings.rows(keep),
        touches=touches,
        price=5.0,
    )
