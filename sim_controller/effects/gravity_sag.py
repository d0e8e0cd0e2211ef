"""A tilting axis carries a weight beside its centre: bearings and drive give way as the moment of that weight changes."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History
from ._kinds import RotaryAxis
from ._parts import displaced, in_axis_frame, positioning

EXAMPLE = {"axis": "B", "amplitude": 0.005, "direction": [0, -1, 0]}
OTHERWISE = "`direction` and `tilt` here, `component` in the term; test_sim_effects_axes.py"


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    axis: RotaryAxis,
    amplitude: float,
    direction: Vector,
    tilt: float = 0.0,
    phase: float = 0.0,
) -> Disturbance:
    """n touches → axis displaced by `amplitude` mm along `direction`, turned by `tilt` rad too far, both times sin(q + phase).

    `phase` in deg is 0 where the weight stands over or under the axis at q = 0. The displacement acts before the motion, so its
    `direction` (machine frame, zero pose) does not turn with the axis; the turn is what the drive gives way.
    """
    moment = np.sin(history.position[:, history.column(axis)] + np.radians(phase))
    sunk = displaced(f"0{axis}", in_axis_frame(history, axis, direction), amplitude * moment)
    return Disturbance(errors={**sunk, positioning(axis): tilt * moment})
