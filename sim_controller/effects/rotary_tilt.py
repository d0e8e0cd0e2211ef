"""Tilt error motion of a rotary axis (ISO 230-7): its body wobbles in waves of the angle, about the point of the axis."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History
from ._kinds import Count, RotaryAxis
from ._parts import across, turned, wave

EXAMPLE = {"axis": "C", "amplitude": 1e-5, "direction": [1, 0, 0]}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    axis: RotaryAxis,
    amplitude: float,
    direction: Vector,
    order: Count = 2,
    phase: float = 0.0,
    frame: Literal["turning", "fixed"] = "turning",
) -> Disturbance:
    """n touches → rotation by `amplitude` rad times cos(order·q + phase deg), about what of `direction` is across the axis.

    `direction` and `frame` as in `rotary_radial`.
    """
    ending = f"0{axis}" if frame == "fixed" else f"{axis}0"
    return Disturbance(errors=turned(ending, across(history, axis, direction), amplitude * wave(history, axis, order, phase)))
