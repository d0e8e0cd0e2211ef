"""What is left of a run that stopped: which touches are repeated first, the plan of the others, and how long each takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from .. import duration
from ..plan import plan as make_plan
from ..records import Array, Cell, Indexation, InputError, Plan, Touch
from .entries import Entry, Reading


def repeatable(entries: Sequence[Entry], plan: Plan) -> tuple[int, ...]:
    """entries of a journal, its plan → up to three touches that look as differently as they can.

    They are of the indexation where the run stopped; where that has fewer than three readings, of those before it as well.
    """
    touches = {touch.number: touch for touch in plan.touches}
    good = [touches[entry.touch] for entry in entries if isinstance(entry, Reading) and entry.status == "ok"][::-1]
    last = good[min(3, len(good)) - 1].indexation if good else 0
    there = [touch for i, touch in enumerate(good) if i < 3 or touch.indexation == last]
    away = np.array([np.subtract(touch.standoff, touch.contact) for touch in there])
    chosen = [0] if there else []
    while len(chosen) < min(3, len(there)):
        likeness = np.abs(away @ away[chosen].T).max(axis=1)
        likeness[chosen] = np.inf
        chosen.append(int(np.argmin(likeness)))
    return tuple(sorted(there[i].number for i in chosen))


def rest_of(cell: Cell, plan: Plan, again: tuple[int, ...], left: tuple[int, ...]) -> Plan:
    """cell, its plan, touch numbers → plan of the touches `again`, then of those `left`, numbered from 1."""
    touches = {touch.number: touch for touch in plan.touches}
    wanted = [touches[number] for number in (*again, *left)]
    indexations = []
    for numbers in (again, left):
        for index, same in groupby(numbers, key=lambda number: touches[number].indexation):
            position = cell.strategy.indexations[index].position
            facets = tuple(touches[number].facet for number in same)
            indexations.append(Indexation(position, facets, cell.machine.stylus))
    strategy = replace(cell.strategy, indexations=tuple(indexations), before=0)
    rest = make_plan(replace(cell, strategy=strategy), "warn")
    as_before = len(rest.touches) == len(wanted) and np.allclose(_contacts(rest.touches), _contacts(wanted), rtol=0, atol=1e-6)
    if not as_before or [touch.facet for touch in rest.touches] != [touch.facet for touch in wanted]:
        raise InputError("the remaining touches cannot be planned as they were; run the whole plan again without --resume")
    return rest


def _contacts(touches: Sequence[Touch]) -> Array:
    return np.array([touch.contact for touch in touches])


def durations(plan: Plan) -> dict[int, float]:
    """plan → {touch number: predicted s from the touch before it, or from the start, to this one}."""
    result: dict[int, float] = {}
    spent = 0.0
    for move, seconds in zip(plan.moves, duration.of_moves(plan), strict=True):
        spent += seconds
        if move.kind == "probe":
            result[move.touch] = spent
            spent = 0.0
    if plan.only is not None:  # and none of its touches
        return {touch.number: spent for touch in plan.touches}
    return result
