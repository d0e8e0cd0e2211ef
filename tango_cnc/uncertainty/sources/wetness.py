"""A film of cutting fluid on some facets and not on others (thesis section 4.6, Figure 4-6)."""

from __future__ import annotations

import math

import numpy as np

from ...records import Array
from ..inputs import Law, Scene

TEXT = "cutting fluid on the facets"
REPEATS = True
SHARED = False


def factor(scene: Scene, *, range: float) -> tuple[Array, Law]:
    """n touches → each facet reads up to `range` mm higher when wet, anything between dry and wet being as likely.

    The facet's own offset takes the mean film; what remains differs from touch to touch as the film does.
    """
    return scene.on_touches(range / math.sqrt(12) * np.eye(len(scene.touches))), "rectangular"
