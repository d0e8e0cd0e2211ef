"""Lost motion of a linear axis: it stops short by half of the play, on the side it came from."""

from __future__ import annotations

from typing import Literal

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.005, "axis": "X"}


def disturb(history: History, rng: np.random.Generator, *, axis: Literal["X", "Y", "Z"], amplitude: float) -> Disturbance:
    """n touches → `amplitude` mm added to the axis' E_kkb."""
    return Disturbance(errors={f"E{axis}{axis}b": np.full(len(history), amplitude)})
