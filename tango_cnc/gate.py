"""Plan → the slow move before the first descent, during which somebody touches the stylus: a dead probe is found where nothing is.

Posts write it, the read-back asks for it, a driver makes it; all three take it from here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .records import InputError, Plan

ALIVE = 10.0  # mm of the slow move during which somebody touches the stylus, before the first descent
ALIVE_TIME = 20.0  # s of it, for a person to get there
TOUCH = "TOUCH THE STYLUS"  # what a program shows then, word by word


@dataclass(frozen=True, slots=True)
class Gate:
    """The slow move that proves the probe alive: positions (mm, rad; columns of `Machine.names`) of its beginning and its end.

    It begins where the first descent begins, at the clear level, and goes up along the tool, or sideways where there is no room.
    """

    start: tuple[float, ...]
    end: tuple[float, ...]
    feed: float  # mm/min


def gate(plan: Plan) -> Gate:
    """plan → the slow move before the first descent. Raises InputError where the travels leave no room for one."""
    first, linear = plan.touches[0], [plan.machine.column(name) for name in plan.machine.linear]
    start = first.enter or first.over
    up = [first.over[i] - first.standoff[i] for i in linear]
    length = math.hypot(*up)
    ways = [[u / length for u in up]] if length > 1e-6 else []
    for k in range(len(linear)):
        ways += [[s * float(i == k) for i in range(len(linear))] for s in (1.0, -1.0) if not ways or abs(ways[0][k]) < 0.1]
    room, way = max(((_room(plan, start, linear, way), -n) for n, way in enumerate(ways)), default=(0.0, 0))
    if room < 1:
        raise InputError(
            f"touch {first.number}: no axis has 1 mm of way left at the clear level; allowed: room for the move that "
            "proves the probe alive; correct travels, artefact or approach, or state gate: none under controller:"
        )
    end = list(start)
    for i, part in zip(linear, ways[-way], strict=True):
        end[i] += room * part
    return Gate(start, tuple(end), round(room / ALIVE_TIME * 60, 1))


def _room(plan: Plan, start: Sequence[float], linear: Sequence[int], way: Sequence[float]) -> float:
    """place, columns, direction → mm that there are within the travels, at most `ALIVE`."""
    room = min(ALIVE, plan.strategy.approach.standoff + plan.strategy.approach.search)
    for i, part in zip(linear, way, strict=True):
        travel = plan.machine.axes[i].travel
        if travel is not None and abs(part) > 1e-9:
            room = min(room, ((travel[1] if part > 0 else travel[0]) - start[i]) / part)
    return room
