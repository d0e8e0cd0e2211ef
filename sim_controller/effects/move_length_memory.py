"""Friction winds an axis up on a long way and lets go on a short one: where it stops depends on how far it came."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import AnyAxis, Positive
from ._parts import Shape, in_units_of, positioning

EXAMPLE = {"axis": "X", "amplitude": 0.003, "length": 50}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    axis: AnyAxis,
    amplitude: float,
    length: Positive,
    shape: Shape = "exponential",
) -> Disturbance:
    """n touches → positioning error `amplitude` (mm; rad) times 1 − exp(−way/length), or way/length (linear); `length` mm or deg.

    The way is what lies between this touch and the one before on that axis, whatever its sign; 0 for the first touch of a day.
    """
    q = history.position[:, history.column(axis)]
    way = np.abs(np.diff(q, prepend=q[:1])) / in_units_of(history, axis, length)
    way[np.diff(history.day, prepend=history.day[:1]) != 0] = 0.0
    wound = 1 - np.exp(-way) if shape == "exponential" else way
    return Disturbance(errors={positioning(axis): amplitude * wound})
