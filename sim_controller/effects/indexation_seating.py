"""After every indexation the clamped rotary axes sit a little elsewhere."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.002}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float) -> Disturbance:
    """n touches → one random displacement per indexation, standard deviation `amplitude` mm in each of x y z, machine frame."""
    seats = amplitude * rng.standard_normal((int(history.indexation.max(initial=-1)) + 1, 3))
    return Disturbance(work=seats[history.indexation])
