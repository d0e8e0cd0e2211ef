"""The stylus does not come back to its neutral place: it rests a little on the side to which the touch before pushed it."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History

EXAMPLE = {"amplitude": 0.001}


def disturb(history: History, rng: np.random.Generator, *, amplitude: float) -> Disturbance:
    """n touches → tip `amplitude` mm along the outward normal of the surface touched before, in the spindle frame.

    The very first touch finds the stylus in its neutral place. The offset turns with the spindle, as the probe does.
    """
    pushed = np.vstack([np.zeros((1, 3)), history.normal_spindle])[: len(history)]
    return Disturbance(errors={f"E{letter}S0": amplitude * pushed[:, i] for i, letter in enumerate("XYZ")})
