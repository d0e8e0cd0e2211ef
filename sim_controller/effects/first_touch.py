"""The first touch after an indexation or a pause reads otherwise: a probe that has to wake up, a film of oil that settled."""

from __future__ import annotations

from typing import Literal

import numpy as np

from . import Disturbance, History
from ._kinds import Positive

EXAMPLE = {"amplitude": 0.002}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    after: Literal["either", "indexation", "pause"] = "either",
    pause: Positive = 600.0,
) -> Disturbance:
    """n touches → gap of `amplitude` mm on the first touch of all, of each indexation and after more than `pause` s."""
    indexed = (np.diff(history.indexation, prepend=-1) != 0) & (after != "pause")
    rested = (np.diff(history.time, prepend=-np.inf) > pause) & (after != "indexation")
    return Disturbance(gap=amplitude * (indexed | rested))
