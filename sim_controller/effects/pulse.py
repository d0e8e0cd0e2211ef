"""For some touches in a row something is elsewhere: one clamping, an open door, a knock that goes back."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tango_cnc.records import InputError, Vector

from . import Disturbance, History, unit
from ._kinds import RotaryAxis
from ._parts import positioning

EXAMPLE = {"amplitude": 0.004, "direction": [0, 0, 1], "at": 20, "until": 60}
OTHERWISE = "not drawn; test_sim_effects.py"
UNDRAWN = "it is set aside before the search; tests/test_diagnose_outside.py"


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    amplitude: float,
    at: int,
    until: int,
    direction: Vector | None = None,
    axis: RotaryAxis | None = None,
    frame: Literal["machine", "table"] = "machine",
) -> Disturbance:
    """n touches → from touch `at` to `until` everything on the table is off by `amplitude` mm along `direction` of that
    frame, or `axis` stands `amplitude` rad too far. Raises InputError for both or none of the two.
    """
    if (direction is None) == (axis is None):
        raise InputError("direction, axis: found both or none of them; allowed: one of them")
    on = (history.number >= at) & (history.number <= until)
    if axis is not None:
        return Disturbance(errors={positioning(axis): np.asarray(amplitude * on, dtype=float)})
    assert direction is not None
    moved = amplitude * np.outer(on, unit(direction))
    return Disturbance(work=moved) if frame == "machine" else Disturbance(table=moved)
