"""Backlashes of several linear axes that are large and all alike: a wrong tip radius makes them where no table turns.

Where only the head turns, every facet is met from one side of the machine. A ball that reads too large on all sides then looks the
same as axes that all lose the same way.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..texts import joined, say
from .bounds import is_backlash
from .data import Remark

LARGE = 0.01  # mm
CERTAIN = 10.0  # standard deviations
ALIKE = 0.1  # of their mean, within which they are alike


def alike(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark where backlashes of two linear axes or more are large and alike."""
    model = result.model
    rows = [i for i, c in enumerate(model.coefficients) if is_backlash(c) and c.slot.axis in model.touches.machine.linear]
    large = [i for i in rows if abs(result.values[i]) > max(LARGE, CERTAIN * result.std[i])]
    if len(large) < 2:
        return
    middle = float(np.median(result.values[large]))
    most = max((result.values[i] for i in large), key=abs)
    same = [i for i in large if abs(result.values[i] - most) < ALIKE * abs(most)]
    if len(same) < 2 or middle * most < 0:
        return
    yield Remark(
        "doubtful",
        say(
            "plausible.backlashes.alike",
            axes=joined(", ", [model.coefficients[i].slot.axis for i in same]),
            size=f"{abs(float(np.mean(result.values[same]))) * 1000.0:.0f}",
        ),
        (),
        "tip_radius",
        "probe.tip_radius",
        say("plausible.backlashes.change"),
        file="machine",
        sure=True,
        moves=tuple(model.names[i] for i in rows),
    )
