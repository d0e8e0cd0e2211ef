"""What the plan says of every touch before it is made: how each axis last moved, and how long it takes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..records import Array, Machine, Move, Plan, Touch

STEP = {"linear": 1e-4, "rotary": math.radians(1e-4), "spindle": math.radians(1e-4)}  # mm, rad: least increment of a program
RAPID = {"linear": 3000.0, "rotary": math.radians(3600), "spindle": math.radians(3600)}  # mm/min, rad/min where none is given
OVERHEAD = 0.5  # s a move: look-ahead stops, waiting for in-position


def last_motion(machine: Machine, touches: Sequence[Touch], moves: Iterable[Move]) -> Array:
    """machine, n touches, their moves → (n, k) −1 0 1: sense of each axis' last motion when touch i triggers, 0: none yet.

    Backlash is decided by the last motion, however many moves ago it was: rotary axes and the spindle keep the sense of their
    last indexation, linear axes have that of the measuring move or of the way to it. A measuring move counts as far as the
    nominal contact. The first position of an axis is where it came to from anywhere: its sense is unknown.
    """
    contacts = {touch.number: touch.contact for touch in touches}
    place = {touch.number: i for i, touch in enumerate(touches)}
    steps = [STEP[axis.kind] for axis in machine.axes]
    at: list[float | None] = [None] * len(steps)
    sense = [0.0] * len(steps)
    result = np.zeros((len(touches), len(steps)))
    for move in moves:
        for i, name in enumerate(machine.names):
            if name not in move.target:
                continue
            target = contacts[move.touch][i] if move.kind == "probe" else move.target[name]
            before = at[i]
            if before is not None and abs(target - before) > steps[i]:
                sense[i] = math.copysign(1.0, target - before)
            at[i] = target
        if move.kind == "probe":
            result[place[move.touch]] = sense
    return result


def durations(plan: Plan) -> dict[int, float]:
    """plan → {touch number: s from the touch before it to this one}, at full rapid; nobody promises more than the order of it."""
    machine = plan.machine
    at: dict[str, float] = {}
    result: dict[int, float] = {}
    spent = 0.0
    for move in plan.moves:
        spent += _duration(machine, at, move.target, plan.strategy.approach.feed if move.kind == "probe" else None)
        at.update(move.target)
        if move.kind == "probe":
            result[move.touch] = spent
            spent = 0.0
    return result


def _duration(machine: Machine, at: Mapping[str, float], target: Mapping[str, float], feed: float | None) -> float:
    times = [0.0]
    for name, value in target.items():
        axis = machine.axis(name)
        way = abs(value - at.get(name, value))
        if way <= STEP[axis.kind]:
            continue
        speed = feed if feed is not None and axis.kind == "linear" else axis.rapid or RAPID[axis.kind]
        times.append(60 * way / speed + axis.clamp_time)
    return max(times) + OVERHEAD
