"""A straightness, an angular error, a positioning error of any axis, as a power of its position (ISO 230-1)."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError

from . import Disturbance, History
from ._kinds import Count, ErrorMotion, Positive
from ._parts import span_of

EXAMPLE = {"name": "EYX", "amplitude": 0.01}
OTHERWISE = "its `name` lacks the degree that the term has; test_sim_effects_axes.py"


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    name: ErrorMotion,
    amplitude: float,
    degree: Count = 2,
    span: Positive = 0.0,
) -> Disturbance:
    """n touches → `amplitude` (mm; rad for A B C) · (q/span)^degree added to the component `name`: `EYX`, `EBX`, `EZC` …

    `span` is in mm or deg, by default the far end of the travel. Raises InputError when there is neither, or beyond degree 9.
    """
    if degree > 9:
        raise InputError(f"degree: found {degree}; allowed: 1 to 9")
    coefficient = amplitude / span_of(history, name[2], span) ** degree
    return Disturbance(errors={f"{name}{degree}": np.full(len(history), coefficient)})
