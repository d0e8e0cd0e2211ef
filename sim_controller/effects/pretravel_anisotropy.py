"""The probe is stiffer along its axis than across it: it triggers earlier where it is pushed in."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.003}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float) -> Disturbance:
    """n touches → gap of `amplitude` mm times n_sz², n_s the normal in the spindle frame: all of it along the probe's axis."""
    return Disturbance(gap=amplitude * history.normal_spindle[:, 2] ** 2)
