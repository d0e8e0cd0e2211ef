"""A knock, a restart, a remounted table: everything sits somewhere else from one touch on."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit

EXAMPLE = {"amplitude": 0.005, "direction": [0, 0, 1], "at": 100}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    direction: Vector,
    at: int,
    frame: Literal["machine", "table"] = "machine",
) -> Disturbance:
    """n touches → `amplitude` mm along `direction` from touch `at` on, touches counted 1 2 3 … over all cycles and days."""
    moved = amplitude * np.outer(history.number >= at, unit(direction))
    return Disturbance(work=moved) if frame == "machine" else Disturbance(table=moved)
