"""The screw of a linear axis is warmed by its own motion and cools in between: it grows from the end at which it is held."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import LinearAxis, Positive

EXAMPLE = {"axis": "X", "amplitude": 1e-5, "tau": 600}

BLOCK = 500  # touches at once, so that no exponential overflows and memory stays small


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    axis: LinearAxis,
    amplitude: float,
    tau: Positive,
    zero: float = 0.0,
) -> Disturbance:
    """n touches → gain E_kk1 of `amplitude` mm/mm for each m of way whose heat is still there (`tau` s), about `zero` mm.

    The way is what lies between this touch and the one before on that axis; each day begins with a cold screw.
    """
    strain = amplitude * _warmth(history, axis, tau)
    return Disturbance(errors={f"E{axis}{axis}1": strain, f"E{axis}{axis}0": -zero * strain})


def _warmth(history: History, axis: str, tau: float) -> np.ndarray:
    """(n,) m: every way before a touch of its day, weighed by how much of its heat is left at that touch."""
    place, clock, day = history.position[:, history.column(axis)], history.warm, history.day
    travel = np.abs(np.diff(place, prepend=place[:1])) / 1000.0
    travel[np.diff(day, prepend=day[:1]) != 0] = 0.0
    warmth = np.zeros(len(place))
    for start in range(0, len(place), BLOCK):
        rows = slice(start, start + BLOCK)
        age = clock[rows, None] - clock[None, : start + BLOCK]
        same = (day[rows, None] == day[None, : start + BLOCK]) & (
            np.arange(len(clock))[rows, None] >= np.arange(len(clock))[None, : start + BLOCK]
        )
        warmth[rows] = np.where(same, np.exp(-np.where(same, age, 0.0) / tau), 0.0) @ travel[: start + BLOCK]
    return warmth
