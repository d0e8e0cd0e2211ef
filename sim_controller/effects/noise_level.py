"""The probe repeats worse than it should: white noise on top of the world's `noise`."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.001}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float) -> Disturbance:
    """n touches → gap, normal and independent, standard deviation `amplitude` mm."""
    return Disturbance(gap=amplitude * rng.standard_normal(len(history)))
