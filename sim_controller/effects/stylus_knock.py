"""The stylus gets a knock: from one touch on its tip is elsewhere, and turns with the spindle."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit
from ._kinds import Count

EXAMPLE = {"amplitude": 0.008, "direction": [1, 0, 0], "at": 100}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, direction: Vector, at: Count) -> Disturbance:
    """n touches → every surface seems `amplitude` mm along `direction` of the spindle frame from touch `at` on."""
    along = history.normal_spindle @ unit(direction)
    return Disturbance(gap=amplitude * along * (history.number >= at))
