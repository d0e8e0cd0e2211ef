"""A rotary axis does not come to rest where its scale says: clamping, encoder, backlash left over (ISO 230-2)."""

from __future__ import annotations

import math

import numpy as np

from ...records import Array, InputError
from ..inputs import Law, Scene

TEXT = "positioning of a rotary axis"
REPEATS = True
SHARED = False


def factor(scene: Scene, *, axis: str, std: float) -> tuple[Array, Law]:
    """n touches → one angle a indexation, `std` deg, that acts on each touch with its lever about `axis`.

    Raises InputError for an axis that the machine does not turn.
    """
    machine = scene.touches.machine
    if axis not in (*machine.rotary, "S"):
        raise InputError(f"budget: rotary_positioning: found axis {axis!r}; allowed: {', '.join((*machine.rotary, 'S'))}")
    own = scene.touches.indexation[:, None] == np.unique(scene.touches.indexation)
    return scene.on_touches(math.radians(std) * scene.lever(axis)[:, None] * own), "normal"
