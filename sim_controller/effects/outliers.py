"""Now and then a touch is plainly wrong: a chip that falls off, a drop of coolant, somebody who bumps into the machine."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.05, "rate": 0.05}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, rate: float) -> Disturbance:
    """n touches → gap of either sign, between half of and all of `amplitude` mm, on a share `rate` of the touches.

    Raises InputError for a rate outside 0 to 1.
    """
    if not 0 <= rate <= 1:
        raise InputError(f"rate: found {rate}; allowed: a share of the touches, 0 to 1")
    drawn = rng.random((len(history), 2))
    signed = 2 * drawn[:, 1] - 1
    size = np.where(signed < 0, -0.5, 0.5) + signed / 2
    return Disturbance(gap=amplitude * (drawn[:, 0] < rate) * size)
