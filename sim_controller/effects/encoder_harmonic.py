"""The graduation of a rotary axis is eccentric (order 1), oval (2) …: its angle is wrong by waves of its reading."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import Count, RotaryAxis
from ._parts import positioning, wave

EXAMPLE = {"axis": "C", "amplitude": 2e-5}


def disturb(
    history: History, rng: np.random.Generator, *, axis: RotaryAxis, amplitude: float, order: Count = 1, phase: float = 0.0
) -> Disturbance:
    """n touches → positioning error `amplitude` rad times cos(order·q + phase deg)."""
    return Disturbance(errors={positioning(axis): amplitude * wave(history, axis, order, phase)})
