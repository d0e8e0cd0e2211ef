"""The position is latched a moment after the trigger: the probe has gone on by then, and the surface is read late."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"delay": 0.001}
OTHERWISE = "a time that the feed makes a way; test_sim_effects_probe.py"
UNDRAWN = "one feed makes it the radius of the tip"


def disturb(history: History, rng: np.random.Generator, *, delay: float) -> Disturbance:
    """n touches → gap of −feed · `delay` s, for an approach along the normal: 1 µm a ms at 60 mm/min."""
    return Disturbance(gap=-history.feed / 60 * delay)
