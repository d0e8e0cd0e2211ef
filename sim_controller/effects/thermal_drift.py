"""The machine warms up: everything on the table drifts against the tool, in the machine frame."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    direction: Vector,
    tau: float,
    shape: Literal["exponential", "linear"] = "exponential",
) -> Disturbance:
    """n touches → `amplitude` mm along `direction` times 1 − exp(−t/tau), or t/tau (linear); t in s since that day's start."""
    grown = 1 - np.exp(-history.warm / tau) if shape == "exponential" else history.warm / tau
    return Disturbance(work=amplitude * np.outer(grown, unit(direction)))
