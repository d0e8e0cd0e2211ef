"""Radial error motion of a rotary axis (ISO 230-7): its body moves sideways in waves of the angle."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History
from ._kinds import Count, RotaryAxis
from ._parts import across, displaced, wave

EXAMPLE = {"axis": "C", "amplitude": 0.003, "direction": [1, 0, 0]}


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
    """n touches → displacement of `amplitude` mm times cos(order·q + phase deg), along what of `direction` is across the axis.

    `direction` is given at the zero pose, in the machine frame; from there it turns with the body, as E_XC does (model.md), or
    stays with the axis before (fixed: it acts before the motion). Order m of the one is orders m − 1 and m + 1 of the other.
    """
    ending = f"0{axis}" if frame == "fixed" else f"{axis}0"
    return Disturbance(errors=displaced(ending, across(history, axis, direction), amplitude * wave(history, axis, order, phase)))
