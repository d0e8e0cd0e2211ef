"""Rows and positions do not belong together: shifted by one, or turned round."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ._case import Case, Hypothesis, with_positions


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → positions one row up or down (all columns, or the linear ones), and in reverse order."""
    position = case.readings.position
    linear = [case.machine.column(name) for name in case.machine.linear]
    for way, text in ((-1, "the row after it"), (1, "the row before it")):
        rolled = np.roll(position, way, axis=0)
        part = np.array(position)
        part[:, linear] = rolled[:, linear]
        for moved, what in ((rolled, "every position"), (part, "X, Y and Z of every row")):
            yield Hypothesis(
                f"the readings fit if {what} belongs to {text}",
                "readings",
                "touch",
                f"move the positions by one row: the record of a touch carries the number of {text.replace('the row', 'the one')}",
                readings=with_positions(case.readings, moved),
                price=1.0,
            )
    yield Hypothesis(
        "the readings fit if the positions are in reverse order",
        "readings",
        "touch",
        "turn the rows round: the newest record comes first",
        readings=with_positions(case.readings, position[::-1]),
        price=1.0,
    )
