"""The scale or screw of a linear axis warms up and grows: the axis goes further than it reads."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import LinearAxis, Positive
from ._parts import Shape, growth

EXAMPLE = {"axis": "X", "amplitude": 4e-5, "tau": 2400}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    axis: LinearAxis,
    amplitude: float,
    tau: Positive,
    shape: Shape = "exponential",
    zero: float = 0.0,
) -> Disturbance:
    """n touches → gain E_kk1 of `amplitude` mm/mm growing in time, about the reading `zero` mm at which the scale is held."""
    strain = amplitude * growth(history, tau, shape)
    return Disturbance(errors={f"E{axis}{axis}1": strain, f"E{axis}{axis}0": -zero * strain})
