"""A rotary axis gets a knock: from one touch on it stands elsewhere on what carries it."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import Vector

from . import Disturbance, History, unit
from ._kinds import Count, RotaryAxis

EXAMPLE = {"axis": "C", "amplitude": 0.012, "direction": [1, 0, 0], "at": 100}


def disturb(
    history: History, rng: np.random.Generator, *, axis: RotaryAxis, amplitude: float, direction: Vector, at: Count
) -> Disturbance:
    """n touches → the axis location errors EX0 EY0 EZ0 of `axis` grow by `amplitude` mm along `direction` from touch `at` on."""
    moved = amplitude * np.outer(unit(direction), history.number >= at)
    return Disturbance(errors={f"E{c}0{axis}": row for c, row in zip("XYZ", moved, strict=True)})
