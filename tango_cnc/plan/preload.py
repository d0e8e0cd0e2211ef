"""Stops a little short of where an axis goes, so that the sense of its last motion does not depend on what nobody knows.

At the start nobody knows how an axis came to where it stands. Later the way between two angles half a turn or more apart
depends on the control: with roll-over it takes the shorter one, without it goes as the numbers say. A stop on the way, as
near as the sense of the last motion wants it, makes that sense the same for both.
"""

from __future__ import annotations

import math

from ..records import Array, Axis, Machine

ROTARY = math.radians(5)
LINEAR = 5.0  # mm
LEAST = 0.01  # of a whole stop: less room than that is none
ENDLESS = math.radians(800)  # travel that no table with limits has


def endless(axis: Axis) -> bool:
    """axis → whether it turns without limits: no travel is stated, or one of more than two turns and a little."""
    return axis.kind != "linear" and (axis.travel is None or axis.travel[1] - axis.travel[0] > ENDLESS)


def turned(axis: Axis, change: float) -> float:
    """axis, mm or rad from one position to the next as the numbers say → as it goes: an endless axis takes the shorter way."""
    return math.remainder(change, math.tau) if endless(axis) else change


def ways(axis: Axis, goal: float, size: float) -> list[float]:
    """axis, where it goes, wanted distance → signed distances at which a stop is within the travel, the preferred one first.

    Below the goal when there is room for it, else above; as far as there is room when there is too little on both sides.
    """
    low, high = axis.limits
    below, above = min(size, goal - low), min(size, high - goal)
    found = [-below, above] if below >= above else [above, -below]
    return [way for way in found if abs(way) >= LEAST * size]


def stop(machine: Machine, start: Array, goal: Array) -> tuple[float, ...] | None:
    """machine, positions (k,) before and after → the stop on the way of axes that turn half a turn or more; None without such."""
    place = start.copy()
    for name in machine.rotary:
        column, axis = machine.column(name), machine.axis(name)
        change = float(goal[column] - start[column])
        place[column] = goal[column]
        if abs(change) < math.pi - 1e-6:
            continue
        sense = math.copysign(1.0, turned(axis, change) if abs(turned(axis, change)) > 1e-9 else change)
        low, high = axis.limits
        place[column] = min(max(goal[column] - sense * ROTARY, low), high)
    place[machine.column("S")] = goal[machine.column("S")]
    return None if (place == goal).all() else tuple(place.tolist())
