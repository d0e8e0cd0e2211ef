"""The table wanders against the tool while the program runs (thesis Table 4-3, Figure 7-2)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...records import Array, InputError
from ..inputs import Law, Scene

TEXT = "drift of the machine"
REPEATS = True
SHARED = False


def factor(
    scene: Scene,
    *,
    amplitude: float,
    shape: Literal["random_walk", "exponential", "warm_up"] = "random_walk",
    tau: float | None = None,
) -> tuple[Array, Law]:
    """n touches → what a displacement does to them that is independent in x y z of the machine frame, t in s from the first touch.

    `random_walk`: standard deviation `amplitude` mm after one hour. `exponential`: `amplitude` at any time, the correlation of
    two times falls by e within `tau`. `warm_up`: amplitude · (1 − e^(−t/tau)) in a direction that nobody knows.
    Raises InputError when `tau` is missing.
    """
    if shape != "random_walk" and (tau is None or tau <= 0):
        raise InputError(f"budget: drift of shape {shape}: found tau {tau}; allowed: a time in s greater than 0")
    t = scene.touches.time - scene.touches.time[0]
    if shape == "random_walk":
        return scene.along(amplitude**2 / 3600 * np.minimum(t[:, None], t[None, :])), "normal"
    assert tau is not None
    if shape == "exponential":
        return scene.along(amplitude**2 * np.exp(-np.abs(t[:, None] - t[None, :]) / tau)), "normal"
    return scene.on_touches(amplitude * (1 - np.exp(-t / tau))[:, None] * scene.normal), "normal"
