"""Lost motion of a rotary axis: it stops short by half of the play, on the side it came from."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import RotaryAxis

EXAMPLE = {"axis": "C", "amplitude": 2e-5}
UNDRAWN = "S3 has it"


def disturb(history: History, rng: np.random.Generator, *, axis: RotaryAxis, amplitude: float) -> Disturbance:
    """n touches → `amplitude` rad added to the axis' E_kkb: + after a positive, − after a negative motion."""
    return Disturbance(errors={f"E{axis}{axis}b": np.full(len(history), amplitude)})
