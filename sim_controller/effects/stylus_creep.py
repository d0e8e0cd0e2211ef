"""The stylus works loose in its holder: its tip creeps sideways, and turns with the spindle."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError, Vector

from . import Disturbance, History, unit
from ._kinds import Positive
from ._parts import Shape, growth

EXAMPLE = {"amplitude": 0.005, "tau": 1800, "direction": [1, 1, 0]}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    direction: Vector,
    tau: Positive,
    shape: Shape = "exponential",
) -> Disturbance:
    """n touches → every surface seems to go `amplitude` mm along `direction` (spindle frame), times the growth of `thermal_drift`.

    The tip goes the other way. Raises InputError for a direction that is not across the spindle.
    """
    if direction[2]:
        raise InputError(
            f"direction: found {list(direction)}; allowed: across the spindle, such as [1, 0, 0]: the last number is 0"
        )
    x, y, _ = unit(direction)
    along = history.normal_spindle[:, 0] * x + history.normal_spindle[:, 1] * y
    return Disturbance(gap=amplitude * along * growth(history, tau, shape))
