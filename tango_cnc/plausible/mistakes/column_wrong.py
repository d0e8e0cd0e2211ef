"""From a touch on the column of a rotary axis or the spindle stands still or is off, and the machine did its program."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..columns import columns
from ..program import wrong_column
from ._case import Case, Hypothesis, with_positions


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the readings with the positions that strategy.yaml has for such a column."""
    found = columns(case.cell, case.readings)
    if found is None:
        return
    position = np.array(case.readings.position)
    for column in found:
        position[column.rows, case.machine.column(column.name)] = column.meant
    remarks = [wrong_column(case.readings, column) for column in found]
    yield Hypothesis(
        remarks[0].text,
        "readings",
        ", ".join(column.name for column in found),
        remarks[0].change,
        readings=with_positions(case.readings, position),
        touches=remarks[0].touches,
        price=2.0,
    )
