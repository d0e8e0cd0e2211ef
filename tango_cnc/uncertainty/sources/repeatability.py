"""The probe triggers a little earlier or later each time (thesis sections 4.6 and 7.3)."""

from __future__ import annotations

import numpy as np

from ...records import Array
from ..inputs import Law, Scene

TEXT = "repeatability of the probe"
REPEATS = True
SHARED = False


def factor(scene: Scene, *, std: float | None = None) -> tuple[Array, Law]:
    """n touches → independent deviations of `std` mm each (default: the probe's repeatability in machine.yaml)."""
    size = scene.touches.machine.probe.repeatability if std is None else std
    return scene.on_touches(size * np.eye(len(scene.touches))), "normal"
