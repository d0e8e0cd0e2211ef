"""The tip of the stylus wears, or gathers dirt: its effective radius changes with time."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import Positive
from ._parts import Shape, growth

EXAMPLE = {"amplitude": -0.005, "tau": 1800}


def disturb(
    history: History, rng: np.random.Generator, *, amplitude: float, tau: Positive, shape: Shape = "exponential"
) -> Disturbance:
    """n touches → `amplitude` mm, times the growth of `thermal_drift`, by which touches read early; below zero: it wears."""
    return Disturbance(gap=amplitude * growth(history, tau, shape))
