"""What the plan says of every touch before it is made: how each axis last moved, and how long it takes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from .. import duration
from ..records import Array, Machine, Move, Plan, Touch

STEP = {"linear": 1e-4, "rotary": math.radians(1e-4), "spindle": math.radians(1e-4)}  # mm, rad: least increment of a program


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
    """plan → {touch number: predicted s from the touch before it, or from the start, to this one}."""
    result: dict[int, float] = {}
    spent = 0.0
    for move, seconds in zip(plan.moves, duration.of_moves(plan), strict=True):
        spent += seconds
        if move.kind == "probe":
            result[move.touch] = spent
            spent = 0.0
    return result
