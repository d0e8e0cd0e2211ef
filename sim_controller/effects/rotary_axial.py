"""Axial error motion of a rotary axis (ISO 230-7): its body moves to and fro along the axis in waves of the angle."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import Count, RotaryAxis
from ._parts import ALONG, displaced, wave

EXAMPLE = {"axis": "C", "amplitude": 0.003}


def disturb(
    history: History, rng: np.random.Generator, *, axis: RotaryAxis, amplitude: float, order: Count = 1, phase: float = 0.0
) -> Disturbance:
    """n touches → displacement of `amplitude` mm times cos(order·q + phase deg), along + x y z of the frame of the A B C axis."""
    along = np.eye(3)[ALONG[axis]]
    return Disturbance(errors=displaced(f"{axis}0", along, amplitude * wave(history, axis, order, phase)))
