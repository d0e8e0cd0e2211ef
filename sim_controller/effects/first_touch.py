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
    after: Literal["either", "indexation", "turn", "pause"] = "either",
    pause: Positive = 600.0,
) -> Disturbance:
    """n touches → gap of `amplitude` mm on the first touch of all, of each indexation and after more than `pause` s.

    With `turn` an indexation in which the spindle alone has turned does not count.
    """
    turned = np.zeros(len(history), dtype=bool)
    turned[:1] = True
    for name in history.machine.rotary:
        turned[1:] |= np.diff(history.position[:, history.column(name)]) != 0
    indexed = (np.diff(history.indexation, prepend=-1) != 0) & (turned if after == "turn" else after != "pause")
    rested = (np.diff(history.time, prepend=-np.inf) > pause) & (after not in ("indexation", "turn"))
    return Disturbance(gap=amplitude * (indexed | rested))
