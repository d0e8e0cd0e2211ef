"""Cell → the same with two more indexations, at 350° and at 10° of a rotary axis: which way the control turns between them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

from ..records import Axis, Cell, Indexation, Plan
from .experiment import Question

FROM, TO = math.radians(350.0), math.radians(10.0)
ENDLESS = math.radians(800.0)  # travel of more than two turns and a little, which no limited table has


def limited(axis: Axis) -> bool:
    """axis → whether it is a rotary one with limits and room for both angles: one without limits may turn either way."""
    if axis.kind != "rotary" or axis.travel is None or axis.travel[1] - axis.travel[0] > ENDLESS:
        return False
    return axis.travel[0] <= TO and axis.travel[1] >= FROM


def rolling(cell: Cell) -> Cell:
    """cell → with the indexations from 350° to 10° of each limited rotary axis at the end of its strategy, as many as needed."""
    first = cell.strategy.indexations[0]
    more = [
        Indexation({**first.position, axis.name: angle}, first.facets, first.stylus)
        for axis in cell.machine.axes
        if limited(axis)
        for angle in (FROM, TO)
    ]
    return replace(cell, strategy=replace(cell.strategy, indexations=(*cell.strategy.indexations, *more)))


def rolled(made: Plan) -> dict[str, Question]:
    """plan in the air → {rotary axis: which way it has to turn from 350° to 10°}."""
    found: dict[str, Question] = {}
    for axis in (axis for axis in made.machine.axes if limited(axis)):
        column = made.machine.column(axis.name)
        for before, after in pairwise(made.touches):
            if abs(before.standoff[column] - FROM) < 1e-6 and abs(after.standoff[column] - TO) < 1e-6:
                what = "the table" if axis.name in made.machine.workpiece_branch else "the spindle head"
                moves = f"between move {before.number} and move {after.number}"
                text = f"{moves} {axis.name} went 350 to 10: did {what} turn the long way, back by 340 deg?"
                found[axis.name] = Question(text, (before.number, after.number))
    return found
