"""The position is latched a moment after the trigger: the probe has gone on by then, and the surface is read late."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"delay": 0.001}


def disturb(history: History, rng: np.random.Generator, *, delay: float) -> Disturbance:
    """n touches → gap of −feed · `delay` s, for an approach along the normal: 1 µm a ms at 60 mm/min."""
    return Disturbance(gap=-history.feed / 60 * delay)
