"""Rows and positions do not belong together: shifted by one, in the whole run or from one touch on, or turned round."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ... import kinematics
from ...records import Array
from ...texts import say
from ..fit import BESIDE
from ._case import Case, Hypothesis, with_positions

WRONG = float(np.log(2.0))  # cost of a row that is beside its contact by `BESIDE`
FEWEST = 3  # rows before and after the one where it begins


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → positions one row up or down (all columns, or the linear ones; in all rows, or from one on), and in reverse order."""
    position = case.readings.position
    linear = [case.machine.column(name) for name in case.machine.linear]
    contact = _contacts(case)
    as_stated = _far(case, position, contact)
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
        first = _begins(as_stated, _far(case, part, contact))
        if first is None:
            continue
        later = np.array(position)
        later[first:, linear] = np.roll(position[first:, linear], way, axis=0)
        number = int(case.readings.touch[first])
        yield Hypothesis(
            say("mistake.row_order.from_on", what=say("mistake.row_order.every_row"), first=number, text=text),
            "readings",
            "touch",
            say(
                "mistake.row_order.move_from_on",
                first=number,
                place=say(f"mistake.row_order.one_{'after' if way < 0 else 'before'}"),
            ),
            readings=with_positions(case.readings, later),
            price=2.0,
        )
    yield Hypothesis(
        say("mistake.row_order.readings_fit_positions_reverse_order"),
        "readings",
        "touch",
        say("mistake.row_order.turn_rows_round_newest_record"),
        readings=with_positions(case.readings, position[::-1]),
        price=1.0,
    )


def _contacts(case: Case) -> Array:
    """case → (n, 3) mm, nominal contact of every touch."""
    facets = [case.artefact.facets[f] for f in case.readings.facet]
    return np.array([np.array(f.point) + case.machine.probe.tip_radius * np.array(f.normal) for f in facets])


def _far(case: Case, position: Array, contact: Array) -> Array:
    """case, (n, k) mm rad, (n, 3) mm → (n,) what it costs that every touch was made beside its nominal contact."""
    away = np.linalg.norm(kinematics.tip(kinematics.chain(case.machine), position) - contact, axis=1)
    return np.asarray(np.log1p((away / BESIDE) ** 2))


def _begins(as_stated: Array, shifted: Array) -> int | None:
    """(n,) cost of every row as it is, and shifted → first row of those that fit better shifted; None where that is no part of a
    run: then all rows are, or none.
    """
    if len(as_stated) < 2 * FEWEST:
        return None
    cost = np.r_[0.0, np.cumsum(as_stated)] + np.r_[np.cumsum(shifted[::-1])[::-1], 0.0]
    best = int(np.argmin(cost))
    # A record that is there twice costs nothing in either place, one that is lost costs the same in both: the first that is wrong.
    near = range(max(best - 1, 0), min(best + 2, len(as_stated)))
    first = next((i for i in near if as_stated[i] > WRONG), best)
    return first if FEWEST <= first <= len(as_stated) - FEWEST else None
