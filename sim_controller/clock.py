"""How long a motion takes: trapezoids of rapid and acceleration, feeds, clamps."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Array, Axis, Machine

RAPID = {"linear": 10_000.0, "rotary": 20 * np.pi, "spindle": 20 * np.pi}  # mm/min, rad/min, where the file says nothing
ACCELERATION = {"linear": 2.0, "rotary": 10.0, "spindle": 10.0}  # m/s², rad/s²
SETTLE = 0.2  # s, in-position check after a motion


def rapid_time(machine: Machine, change: Array) -> Array:
    """(n, k) mm rad signed → (n,) s until every axis has got there, clamps of the rotary axes that moved included."""
    times = np.column_stack([_trapezoid(axis, np.abs(change[:, i])) for i, axis in enumerate(machine.axes)])
    clamps = np.where(change != 0, [axis.clamp_time for axis in machine.axes], 0.0).max(axis=1)
    return times.max(axis=1) + clamps + np.where((change != 0).any(axis=1), SETTLE, 0.0)


def _trapezoid(axis: Axis, distance: Array) -> Array:
    speed = (axis.rapid or RAPID[axis.kind]) / 60
    acceleration = axis.acceleration or ACCELERATION[axis.kind]
    if axis.kind == "linear":
        acceleration *= 1000
    ramp = speed**2 / acceleration
    return np.where(distance > ramp, distance / speed + speed / acceleration, 2 * np.sqrt(distance / acceleration))


def feed_time(length: Array, feed: Array | float) -> Array:
    """(n,) mm, mm/min → (n,) s."""
    return length / (np.asarray(feed) / 60)
