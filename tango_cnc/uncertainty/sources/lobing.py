"""The probe triggers later in some directions around its axis than in others (thesis section 7.3, procedure IV)."""

from __future__ import annotations

import numpy as np

from ...records import Array
from ..inputs import Law, Scene

TEXT = "lobing of the probe"
REPEATS = False
SHARED = True


def factor(scene: Scene, *, amplitude: float, order: int = 2, phase: float | None = None) -> tuple[Array, Law]:
    """n touches → gap `amplitude` mm · √(n_sx² + n_sy²) cos(order·θ + phase), θ azimuth of the normal in the spindle frame.

    Without a phase (deg) any is as likely as any other; with one, `amplitude` is the standard uncertainty of that pattern.
    """
    x, y = scene.normal_spindle[:, 0], scene.normal_spindle[:, 1]
    across, azimuth = amplitude * np.hypot(x, y), order * np.arctan2(y, x)
    if phase is not None:
        return scene.on_touches((across * np.cos(azimuth + np.radians(phase)))[:, None]), "normal"
    pair = np.column_stack([across * np.cos(azimuth), -across * np.sin(azimuth)]) / np.sqrt(2)
    return scene.on_touches(pair), "phase"
