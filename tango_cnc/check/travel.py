"""Axis positions against the travels of a machine."""

from __future__ import annotations

import math

import numpy as np

from ..records import Array, Machine

ROUNDING = 1e-6  # mm or rad: positions come out of arithmetic


def outside(machine: Machine, position: Array) -> Array:
    """(n, k) mm rad → (n, k), how far each axis would be beyond its travel, negative below and 0 within."""
    low = np.array([-math.inf if axis.travel is None else axis.travel[0] for axis in machine.axes])
    high = np.array([math.inf if axis.travel is None else axis.travel[1] for axis in machine.axes])
    beyond = np.minimum(position - low, 0.0) + np.maximum(position - high, 0.0)
    return np.where(np.abs(beyond) > ROUNDING, beyond, 0.0)


def travel_text(machine: Machine, name: str, value: float) -> str:
    """axis letter and a position beyond its travel → 'X 412.300 mm, travel -400 … 400 mm'."""
    axis = machine.axis(name)
    low, high = axis.limits
    scale, unit = (1.0, "mm") if axis.kind == "linear" else (180 / math.pi, "deg")
    return f"{name} {value * scale:.3f} {unit}, travel {low * scale:g} … {high * scale:g} {unit}"
