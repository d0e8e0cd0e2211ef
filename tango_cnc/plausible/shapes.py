"""Shapes of what may be wrong with touches: what errs with position or with time, what may be elsewhere from a moment on."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..records import Array
from ..touches import FAR, Touches

LEADS = (2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 16.0, 20.0, 24.0, 25.0, 30.0, 32.0, 40.0)  # mm: of ball screws, and halves
SETTLED = 20.0  # s after a turn in which what it shook or heated has faded to a third
TURNED = math.radians(60)  # rad that S turns, at least, before touches show whether stylus or table has moved
FADES = (1.5, 4.0)  # touches after an indexation in which what settles then has faded to a third
SEEN = 0.2  # share of the largest wave below which one is not looked for


def candidates(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → (words, axis, (n, k) mm a unit) of each pattern that acts all the time."""
    yield from _by_position(touches)
    yield from _by_time(touches)
    yield from _by_direction(touches)
    yield from _by_place(touches)
    for axis in touches.machine.rotary:
        yield "settles", axis, touches.machine_normal * _settling(touches, axis)[:, None]
    for fades in FADES:
        yield "indexed", "", touches.machine_normal * np.exp(-_behind(touches) / fades)[:, None]
    yield "memory", "", _remembered(touches)


def _by_position(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → what errs with the position of an axis."""
    slots, machine = touches.seen.slots, touches.machine
    for axis in (*machine.rotary, *machine.linear):
        at = touches.axis(axis)
        span = float(np.ptp(at))
        if span == 0:
            continue
        x = 2 * (at - at.min()) / span - 1
        turns = axis in machine.rotary
        shape = [x, np.sin(at), np.cos(at), np.sin(2 * at), np.cos(2 * at)] if turns else [x, x**2, x**3]
        shapes = np.stack([f / np.linalg.norm(f) for f in shape], axis=1)
        for slot, lever in slots.items():
            if slot.axis == axis and slot.stage in ("motion", "inter"):
                yield "position" if slot.stage == "motion" else "motion", axis, lever[:, None] * shapes


def _course(touches: Touches) -> Array:
    """touches → (n,) time from 0 to 1."""
    return np.asarray((touches.time - touches.time.min()) / (float(np.ptp(touches.time)) or 1.0))


def _by_time(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → what moves while the test goes on: a center, the table, the spindle."""
    slots, machine, t = touches.seen.slots, touches.machine, _course(touches)
    for axis in machine.rotary:
        center = [lever for slot, lever in slots.items() if slot.axis == axis and slot.stage == "inter" and slot.component < 3]
        if center and np.ptp(touches.axis(axis)) > 0:
            yield "center", axis, np.hstack([np.stack(center, axis=1) * shape[:, None] for shape in (t, t**2)])
    table = touches.of_table
    for shape in (t, t**2, np.sin(np.pi * t), np.sin(2 * np.pi * t)):
        yield "drift", "", table * shape[:, None]
    if np.ptp(touches.axis("S")) > TURNED:  # else what creeps in the spindle is a drift of the table
        for shape in (t, t**2):
            yield "creeps", "", touches.spindle_normal[:, :2] * shape[:, None]


def _by_direction(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → what errs with the direction of a touch: one that answers late, a stylus that is not round, a wrong radius."""
    for i, axis in enumerate("XYZ"):
        for sign, word in ((1.0, "-"), (-1.0, "+")):
            yield "late", f"{axis}{word}", (touches.machine_normal[:, [i]] * sign > 0.5).astype(float)
    for normal in (touches.machine_normal, touches.spindle_normal):
        across = np.hypot(normal[:, 0], normal[:, 1])
        angle = np.arctan2(normal[:, 1], normal[:, 0])
        for k in (2, 3):
            yield "probe", "", across[:, None] * np.stack([np.cos(k * angle), np.sin(k * angle)], axis=1)
    up = touches.machine_normal @ np.array(touches.machine.spindle.direction)
    yield "probe", "", np.abs(touches.spindle_normal[:, [2]])
    yield "probe", "", np.abs(up)[:, None]
    yield "radius", "", np.ones((len(touches), 1))


def _by_place(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → what grows with a place: what gives way, a scale or a squareness that changes in time."""
    machine, at, t = touches.machine, places(touches), _course(touches)
    for i, axis in enumerate("XYZ"):
        if axis in machine.linear:
            squared = touches.machine_normal[:, [i]] ** 2  # whichever side is touched, it gives way
            yield "yields", axis, squared * np.column_stack([np.ones(len(t)), at])
    for column, axis in zip(at.T, machine.linear, strict=True):
        yield "grows", axis, (touches.lever(axis) * column)[:, None] * np.stack([t, t**2], axis=1)
    for moving in machine.linear:
        for other, column in zip(machine.linear, at.T, strict=True):
            if moving != other:
                yield "squares", f"{moving} and {other}", (touches.lever(moving) * column * t)[:, None]


def places(touches: Touches) -> Array:
    """→ (n, linear axes) positions from −1 to 1 of the travel that was used; 0 of an axis that stood still."""
    at = np.stack([touches.axis(name) for name in touches.machine.linear], axis=1)
    low, high = at.min(axis=0), at.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    return np.asarray((2 * at - low - high) / span)


def _settling(touches: Touches, axis: str) -> Array:
    """rotary axis → (n,) rad, its last turn, fading with the time since the first touch behind it."""
    at, begin = touches.axis(axis), _begin(touches)
    turn = at - at[np.maximum(begin - 1, 0)]
    return np.asarray(turn * np.exp(-(touches.time - touches.time[begin]) / SETTLED))


def _begin(touches: Touches) -> NDArray[np.int64]:
    """→ (n,) row of the first touch of the indexation of each."""
    index = touches.indexation
    first = np.concatenate([[True], index[1:] != index[:-1]])
    return np.asarray(np.flatnonzero(first)[np.cumsum(first) - 1])


def _behind(touches: Touches) -> Array:
    """→ (n,) touches since the first one of its indexation: whatever has turned or was clamped for it, it is the same each time."""
    return np.asarray(np.arange(len(touches)) - _begin(touches), dtype=float)


def _remembered(touches: Touches) -> Array:
    """→ (n, 2) mm, how far from its nominal place the touch before was, and the one after: readings that were filtered have a part
    of it. One that is far off says nothing of the others."""
    away = kinematics.tip(touches.chain, touches.position) - touches.point
    off = np.clip(np.sum(away * touches.normal, axis=1) - touches.radius, -FAR, FAR)
    return np.stack([np.concatenate([[0.0], off[:-1]]), np.concatenate([off[1:], [0.0]])], axis=1)


def movable(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → (words, axis, (n, k) mm a unit) of what may be elsewhere from a moment on."""
    yield "table", "", touches.of_table
    yield "tip", "", np.hstack([touches.spindle_normal, np.ones((len(touches), 1))])
    yield "offset", "", touches.machine_normal
    for axis in touches.machine.rotary:
        yield "turned", axis, touches.lever(axis)[:, None]
    at = np.column_stack([np.ones(len(touches)), places(touches)])
    normal = touches.machine_normal
    yield "compensation", "", (normal[:, :, None] * at[:, None, :]).reshape(len(touches), -1)


def periodic(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → (words, axis, (n, 2 or 1) mm a unit) of each linear axis whose screw errs once a turn, for the usual leads."""
    for axis in touches.machine.linear:
        at, lever = touches.axis(axis), touches.lever(axis)[:, None]
        for lead in LEADS:
            turn = 2 * np.pi * at / lead
            waves = lever * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            # Where all places lie at the zeros of a wave, nothing is left of it but what the trigger scatters by.
            seen = np.linalg.norm(waves, axis=0) > SEEN * np.linalg.norm(lever)
            if np.ptp(at) > lead and seen.any():
                yield "periodic", axis, waves[:, seen]
