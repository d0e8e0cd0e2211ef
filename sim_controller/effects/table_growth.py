"""The table warms up and grows: every point of it moves away from the point that stays (ISO 230-3)."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import Point, Positive
from ._parts import Shape, growth

EXAMPLE = {"amplitude": 4e-5, "tau": 2400}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    tau: Positive,
    shape: Shape = "exponential",
    centre: Point = (0.0, 0.0, 0.0),
) -> Disturbance:
    """n touches → points of the table moved by `amplitude` mm/mm of their way from `centre` (mm, table frame), growing in time.

    Balls grow like the rest: the point that is touched counts, not the centre.
    """
    strain = amplitude * growth(history, tau, shape)
    return Disturbance(table=strain[:, None] * (history.point - np.array(centre)))
