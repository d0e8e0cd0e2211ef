"""The table warms up or slips on its clamps: the facets drift against the last axis, and turn with the table."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit
from ._kinds import Positive
from ._parts import Shape, growth

EXAMPLE = {"amplitude": 0.005, "tau": 2400, "direction": [0, 1, 0]}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    direction: Vector,
    tau: Positive,
    shape: Shape = "exponential",
) -> Disturbance:
    """n touches → `amplitude` mm along `direction` (table frame) times the growth in time of `thermal_drift`."""
    return Disturbance(table=amplitude * np.outer(growth(history, tau, shape), unit(direction)))
