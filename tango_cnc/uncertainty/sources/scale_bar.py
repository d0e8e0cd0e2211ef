"""The length of the scale bar as its certificate states it."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...records import Array
from ..inputs import Law, Scene

TEXT = "calibrated length of the scale bar"
REPEATS = False
SHARED = True


def factor(
    scene: Scene, *, std: float | None = None, distribution: Literal["normal", "rectangular"] = "normal"
) -> tuple[Array, Law]:
    """bar → its standard uncertainty `std` mm (default: `uncertainty` in artefact.yaml); nothing when it was not touched."""
    size = len(scene.touches) + len(scene.stated)
    column = np.zeros((size, 1))
    if scene.model.bar is not None:
        column[-1] = scene.stated[-1] if std is None else std
    return column, distribution
