"""The probe triggers later in some directions around its axis than in others."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.004}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, order: int = 3, phase: float = 0.0) -> Disturbance:
    """n touches → gap `amplitude` mm · √(n_sx² + n_sy²) cos(order·θ + phase deg), θ azimuth of the normal in the spindle frame."""
    x, y = history.normal_spindle[:, 0], history.normal_spindle[:, 1]
    return Disturbance(gap=amplitude * np.hypot(x, y) * np.cos(order * np.arctan2(y, x) + np.radians(phase)))
