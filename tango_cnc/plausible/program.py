"""Readings beside strategy.yaml: another facet, or another position of a rotary axis, than the touch of that number asks for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..asked import Asked, asked
from ..records import Array, Cell, Readings
from ..texts import say
from .columns import TURNED, Column, columns, turned
from .data import Remark, listed


def another_program(cell: Cell, readings: Readings, run: Mapping[str, Any] | None = None) -> Iterator[Remark]:
    """cell, readings, readings.json → remarks where touches are not those that strategy.yaml asks for."""
    touches, machine = asked(cell, run), cell.machine
    rows = np.flatnonzero((readings.touch >= 1) & (readings.touch <= len(touches)))
    place = readings.touch[rows] - 1
    names = (*machine.rotary, "S")
    turning = [machine.column(name) for name in names]
    made, meant = readings.position[rows][:, turning], touches.position[place][:, turning]
    off = turned(made, meant)
    wrong = np.abs(off) > np.radians(TURNED)
    others = [r for r, p in zip(rows.tolist(), place.tolist(), strict=True) if readings.facet[r] != touches.facet[p]]
    facets = [int(readings.touch[r]) for r in others]
    if others and all(_copied(readings, r) for r in others):
        change = say("plausible.readings.put_row_back")
        text = say("plausible.readings.row_copied_over", numbers=listed(facets), count=len(facets))
        yield Remark("doubtful", text, tuple(facets), "repeated_touches", "touch", change)
        wrong[np.isin(rows, others)] = False
    elif facets:
        what = say("plausible.readings.name_another_facet_than_strategy")
        yield _other(readings, facets, what, "facet", say("plausible.readings.take_strategy_yaml_program_was"))
    if not wrong.any():
        return
    numbers = [int(t) for t in readings.touch[rows[wrong.any(axis=1)]]]
    own = [name for name, there in zip(names, wrong.T, strict=True) if there.any()]
    lost = columns(cell, readings, run)
    if lost is not None:
        yield from (wrong_column(readings, column) for column in lost)
        return
    if not facets and len(own) == 1 and _is_one(touches, place[wrong.any(axis=1)], off[wrong]):
        yield _one_indexation(own[0], numbers, float(np.degrees(np.median(off[wrong]))))
        return
    mirrored = np.abs(turned(made, -meant)) > np.radians(TURNED)
    counted = [n for n, here, other in zip(names, wrong.T, mirrored.T, strict=True) if here.any() and not other.any()]
    change = say(f"plausible.readings.{'see_whether_column_has_sign' if counted else 'take_strategy_yaml_program_was'}")
    more = say("plausible.readings.has_other_sign_everywhere_counts", counted=counted[0]) if counted else ""
    what = say("plausible.readings.have_other_positions_than_strategy", columns=", ".join(own))
    yield _other(readings, numbers, what, ", ".join(own), change, more)


def _copied(readings: Readings, row: int) -> bool:
    """→ whether a row has the facet and every position of the row before it: no probe reads so twice."""
    return (
        row > 0
        and readings.facet[row] == readings.facet[row - 1]
        and bool(np.all(readings.position[row] == readings.position[row - 1]))
    )


def wrong_column(readings: Readings, column: Column) -> Remark:
    """readings, a column that is wrong from some touch on → what is said of it."""
    numbers = tuple(int(t) for t in readings.touch[column.rows])
    if column.still is None:
        how, value = "column_off", f"{np.degrees(column.off):+.4f}"
    else:
        how, value = "column_still", f"{np.degrees(column.still):.6g}"
    text = say(f"plausible.readings.{how}", axis=column.name, value=value, count=len(numbers), first=numbers[0], last=numbers[-1])
    change = say("plausible.readings.compare_column_with_control", axis=column.name)
    return Remark("doubtful", text, numbers, "column_wrong", column.name, change, sure=True)


def _is_one(touches: Asked, place: Array, off: Array) -> bool:
    """→ whether these touches are of one indexation of the strategy, off by one angle."""
    index = np.cumsum(np.any(np.diff(touches.position, axis=0, prepend=touches.position[:1]) != 0, axis=1))
    return bool(index[-1] > 1 and not np.ptp(index[place]) and np.ptp(off) < np.radians(TURNED))


def _one_indexation(axis: str, numbers: list[int], degrees: float) -> Remark:
    text = say(
        "plausible.readings.one_indexation_elsewhere", axis=axis, degrees=f"{degrees:+.4f}", first=numbers[0], last=numbers[-1]
    )
    return Remark("doubtful", text, tuple(numbers), "indexation", axis, say("mistake.indexation.see_whether_was_clamped_whether"))


def _other(readings: Readings, wrong: list[int], what: str, key: str, change: str, more: str = "") -> Remark:
    text = say(
        "plausible.readings.touches_readings_another_program_strategy",
        count=len(wrong),
        count2=len(readings),
        what=what,
        wrong=listed(wrong),
        more=more,
    )
    return Remark("doubtful", text, tuple(wrong), "another_program", key, change)
