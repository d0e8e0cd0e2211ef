"""Air conditioning, a chiller, day and night: everything on the table swings against the tool, in the machine frame."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit
from ._kinds import Positive

EXAMPLE = {"amplitude": 0.003, "period": 1200, "direction": [1, 0, 0]}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    direction: Vector,
    period: Positive,
    phase: float = 0.0,
) -> Disturbance:
    """n touches → `amplitude` mm along `direction` times sin(2π·t/period + phase); s, deg; t runs through nights."""
    swing = np.sin(2 * np.pi * history.time / period + np.radians(phase))
    return Disturbance(work=amplitude * np.outer(swing, unit(direction)))
