"""The machine warms up: everything on the table drifts against the tool, in the machine frame."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit
from ._kinds import Positive
from ._parts import Shape, growth

EXAMPLE = {"amplitude": 0.01, "tau": 2400, "direction": [0, 1, 0]}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    direction: Vector,
    tau: Positive,
    shape: Shape = "exponential",
) -> Disturbance:
    """n touches → `amplitude` mm along `direction` times 1 − exp(−t/tau), or t/tau (linear); t in s since that day's start."""
    return Disturbance(work=amplitude * np.outer(growth(history, tau, shape), unit(direction)))
