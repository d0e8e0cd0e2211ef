"""A heavy body goes to one side and another one tilts under it: the tilt of an axis as a function of another axis."""

from __future__ import annotations

import numpy as np

from tango_cnc.records import InputError

from . import Disturbance, History
from ._kinds import AnyAxis, ErrorMotion, Positive
from ._parts import span_of

EXAMPLE = {"name": "EAZ", "by": "Y", "amplitude": 1e-5}


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    name: ErrorMotion,
    by: AnyAxis,
    amplitude: float,
    span: Positive = 0.0,
) -> Disturbance:
    """n touches → `amplitude` rad · q/span of axis `by` added to the angle `name` of another one: EAZ by Y, a column that leans.

    `span` is in mm or deg, by default the far end of the travel. Raises InputError for no angle, the same axis, no span.
    """
    if name[1] not in "ABC" or name[2] == by:
        raise InputError(
            f"name, by: found {name} by {by}; allowed: an angle (EA, EB, EC) of another axis than {by}, such as EAZ by Y"
        )
    share = history.position[:, history.column(by)] / span_of(history, by, span)
    return Disturbance(errors={f"{name}0": amplitude * share})
