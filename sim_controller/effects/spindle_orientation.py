"""The spindle does not stop quite where it was told to: a stylus that is off its axis comes to stand somewhere else."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError

from . import Disturbance, History
from ._parts import positioning, wave

EXAMPLE = {"amplitude": 0.001}
OTHERWISE = "not drawn; test_sim_effects_probe.py"
UNDRAWN = "random at every touch, as the spindle of the thesis is not oriented"


def disturb(history: History, rng: np.random.Generator, *, amplitude: float, order: int = 0, phase: float = 0.0) -> Disturbance:
    """n touches → error of S: random at every stop, standard deviation |amplitude| rad, or (order from 1) as a graduation's.

    That is `amplitude` · cos(order·S + phase deg). What it does is this times the offset of the stylus (`stylus: EXt EYt` and
    `errors: EX0S …` of the world): without an offset, nothing. Raises InputError for a negative order.
    """
    if order < 0:
        raise InputError(f"order: found {order}; allowed: 0 (random at every stop) or the waves a turn, from 1")
    if order:
        return Disturbance(errors={positioning("S"): amplitude * wave(history, "S", order, phase)})
    s = history.position[:, history.column("S")]
    stop = np.cumsum(np.abs(np.diff(s, prepend=s[:1])) > 1e-9)
    return Disturbance(errors={positioning("S"): amplitude * rng.standard_normal(len(history))[stop]})
