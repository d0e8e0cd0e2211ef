"""The control looks at the probe input once in a period: the position that it takes is up to one period's way late."""

from __future__ import annotations

import math

import numpy as np

from ...records import Array, InputError
from ..inputs import Law, Scene

TEXT = "sampling of the probe input by the control"
REPEATS = True
SHARED = False


def factor(scene: Scene, *, period: float, feed: float | None = None) -> tuple[Array, Law]:
    """n touches → independent deviations, rectangular with the width feed × `period` (s; `feed` mm/min, default: of the readings).

    Half that width is late on the mean: alike for every touch of one feed, the facets' own offsets take it. Raises InputError
    for readings without feeds when none is stated.
    """
    feeds = scene.touches.feed if feed is None else np.full(len(scene.touches), feed)
    if not np.isfinite(feeds).all():
        raise InputError("budget: probe_latch: the readings have no column feed; state the measuring feed, e.g. feed: 180")
    return scene.on_touches(np.diag(feeds / 60 * period / math.sqrt(12))), "rectangular"
