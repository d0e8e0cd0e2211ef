"""A linear axis errs again and again with the pitch of its screw or the period of its scale."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import LinearAxis, Positive
from ._parts import positioning

EXAMPLE = {"axis": "Y", "amplitude": 0.002, "period": 10}


def disturb(
    history: History, rng: np.random.Generator, *, axis: LinearAxis, amplitude: float, period: Positive, phase: float = 0.0
) -> Disturbance:
    """n touches → positioning error `amplitude` mm times cos(2π·q/period + phase); mm, deg."""
    turn = 2 * np.pi * history.position[:, history.column(axis)] / period
    return Disturbance(errors={positioning(axis): amplitude * np.cos(turn + np.radians(phase))})
