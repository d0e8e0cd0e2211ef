"""The offsets of calibrated facets as their certificate states them."""

from __future__ import annotations

import numpy as np

from ...records import Array
from ..inputs import Law, Scene

TEXT = "calibrated offsets of the facets"
REPEATS = False
SHARED = True


def factor(scene: Scene) -> tuple[Array, Law]:
    """m calibrated facets → independent deviations, each with the `uncertainty` of artefact.yaml."""
    count, n = len(scene.model.calibrated), len(scene.touches)
    result = np.zeros((n + len(scene.stated), count))
    result[n : n + count] = np.diag(scene.stated[:count])
    return result, "normal"
