"""Plan of a cell → a plan in the air: measuring moves at the clear level of a few indexations, that meet nothing.

    probe moves up from the stand-off ▲ 5 mm, record of a miss
    stand-off  ──────────────────────── 10 mm above the clear level
    clear level ─ ─ ─ nothing on the table reaches it at this indexation

Rotary axes turn where the cell's own plan turns them, so what is tried here is what the cell does later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..gate import gate
from ..plan import part, plan_hash
from ..records import InputError, Plan, Touch

MOST = 6  # indexations
ABOVE, WAY = 10.0, 5.0  # mm over the clear level where a measuring move begins; mm that it goes
ENTER = 1.0  # mm above its beginning from where it is approached


def air(whole: Plan, most: int = MOST) -> Plan:
    """plan of a cell, indexations at most → plan in the air: one measuring move an indexation, each a miss where all is right.

    Raises InputError where the travels leave no room above the clear level.
    """
    chosen = _chosen(whole, most)
    few = part(whole, [touch.number for touch in chosen])
    up = _up(whole)
    touches = []
    for touch in few.touches:
        place = [np.array(touch.over) + distance * up for distance in (ABOVE, ABOVE + WAY / 2, ABOVE + WAY, ABOVE + ENTER)]
        standoff, contact, end, over = (tuple(float(v) for v in p) for p in place)
        touches.append(replace(touch, facet="air", standoff=standoff, contact=contact, end=end, over=over, enter=None, leave=None))
    approach = replace(few.strategy.approach, standoff=WAY / 2, search=WAY / 2, find=None)
    made = replace(few, touches=tuple(touches), strategy=replace(few.strategy, approach=approach))
    _within(made)
    gate(made)
    plan_hash(made)
    return made


def _chosen(whole: Plan, most: int) -> Sequence[Touch]:
    """→ the first touch of indexations that differ in every rotary axis and the spindle, the first one among them."""
    first: dict[int, Touch] = {}
    for touch in whole.touches:
        first.setdefault(touch.indexation, touch)
    turning = [whole.machine.column(name) for name in (*whole.machine.rotary, "S")]
    found: list[Touch] = []
    for touch in first.values():
        if len(found) < most and (not found or any(all(abs(touch.over[i] - f.over[i]) > 1e-6 for f in found) for i in turning)):
            found.append(touch)
    for touch in first.values():  # and a second look at each sense of turning, as far as there is room
        if len(found) < most and touch not in found:
            found.append(touch)
    return sorted(found, key=lambda touch: touch.number)


def _up(whole: Plan) -> np.ndarray:
    """→ (k,) the step of 1 mm up along the tool, in the columns of the linear axes."""
    touch = whole.touches[0]
    way = np.array(touch.over) - np.array(touch.standoff)
    for name in (*whole.machine.rotary, "S"):
        way[whole.machine.column(name)] = 0.0
    length = float(np.linalg.norm(way))
    if length < 1e-6:
        raise InputError(f"touch {touch.number}: its stand-off is at the clear level; allowed: one below it, so that up is known")
    return way / length


def _within(made: Plan) -> None:
    for touch in made.touches:
        for axis, *values in zip(made.machine.axes, touch.standoff, touch.end, touch.over, strict=True):
            if axis.travel is not None and not all(axis.travel[0] - 1e-6 <= v <= axis.travel[1] + 1e-6 for v in values):
                raise InputError(
                    f"{axis.name}: {max(values):.1f} mm is beyond its travel {axis.travel[0]:g} … {axis.travel[1]:g}; allowed: "
                    f"{ABOVE + WAY:g} mm of room above the clear level at every indexation, to try the control there"
                )
