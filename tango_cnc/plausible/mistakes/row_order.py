"""Rows and positions do not belong together: shifted by one, or turned round."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis, with_positions


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → positions one row up or down (all columns, or the linear ones), and in reverse order."""
    position = case.readings.position
    linear = [case.machine.column(name) for name in case.machine.linear]
    for way, text in ((-1, say("mistake.row_order.row_after")), (1, say("mistake.row_order.row_before"))):
        rolled = np.roll(position, way, axis=0)
        part = np.array(position)
        part[:, linear] = rolled[:, linear]
        for moved, what in ((rolled, say("mistake.row_order.every_position")), (part, say("mistake.row_order.every_row"))):
            yield Hypothesis(
                say("mistake.row_order.readings_fit_belongs", what=what, text=text),
                "readings",
                "touch",
                say(
                    "mistake.row_order.move_positions_one_row_record",
                    place=say(f"mistake.row_order.one_{'after' if way < 0 else 'before'}"),
                ),
                readings=with_positions(case.readings, moved),
                price=1.0,
            )
    yield Hypothesis(
        say("mistake.row_order.readings_fit_positions_reverse_order"),
        "readings",
        "touch",
        say("mistake.row_order.turn_rows_round_newest_record"),
        readings=with_positions(case.readings, position[::-1]),
        price=1.0,
    )
