"""What a control shows and commands: its axes in mm and deg, and the ways that roll-over axes turn."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from tango_cnc.records import Array, Machine

from ...motion import Motion, MotionStop
from .alarm import Silence

TURN = 360.0


def endless(machine: Machine) -> tuple[str, ...]:
    """machine → letters of the axes that roll over: those that turn more than two turns."""
    free = (a for a in machine.axes if a.kind == "rotary" and (a.travel is None or a.travel[1] - a.travel[0] > 4 * math.pi + 1))
    return tuple(axis.name for axis in free)


def shown(motion: Motion, axes: Iterable[str], position: Array | None = None) -> dict[str, float]:
    """axis letters, mm rad or where the axes stand → {axis: mm deg}."""
    values, machine = motion.position if position is None else position, motion.machine
    places = dict(zip(machine.names, values.tolist(), strict=True))
    return {name: places[name] if name in machine.linear else math.degrees(places[name]) for name in axes}


def commanded(motion: Motion, values: Mapping[str, float]) -> dict[str, float]:
    """{axis: mm deg} → {axis: mm rad}."""
    return {name: value if name in motion.machine.linear else math.radians(value) for name, value in values.items()}


def roll(motion: Motion, axes: Iterable[str]) -> None:
    """letters of roll-over axes → their scales read 0 ≤ angle < 360."""
    for name, angle in shown(motion, axes).items():
        if not 0 <= angle < TURN:
            motion.set_position(name, math.radians(angle % TURN))


def nearer(goal: float, now: float) -> float:
    """deg, deg → the goal, whole turns aside, by the nearer way; half a turn goes in the positive direction."""
    change = (goal - now) % TURN
    return now + (change - TURN if change > TURN / 2 else change)


def by_sign(goal: float, now: float, negative: bool) -> float:
    """deg, deg, direction → the goal, whole turns aside, in that direction."""
    ahead = (goal - now) % TURN
    return now + (ahead - TURN if negative and ahead else ahead)


def as_alarm(stop: MotionStop, alarm: Callable[[str, str], Exception]) -> Exception:
    """what ended a motion, alarms of a control by their kind → its alarm overtravel, collision or machine, or Silence."""
    if stop.cause in ("overtravel", "collision"):
        return alarm(stop.cause, str(stop))
    return Silence() if str(stop) == "silence" else alarm("machine", str(stop))
