"""Drift without a pattern: the table wanders against the tool, in the machine frame."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.003}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float) -> Disturbance:
    """n touches → random walk with a standard deviation of `amplitude` mm after one hour, in each of x y z."""
    hours = np.diff(history.time, prepend=0.0) / 3600
    steps = rng.standard_normal((len(history), 3)) * np.sqrt(np.maximum(hours, 0.0))[:, None]
    return Disturbance(work=amplitude * np.cumsum(steps, axis=0))
