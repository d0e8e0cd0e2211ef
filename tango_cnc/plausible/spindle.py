"""A spindle that did not turn: the tip is at the same place whatever S says. A stylus that runs so true is rarer than a lost M19.

Where the spindle stands still, what belongs to the stylus goes into the place of the spindle, and every touch fits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..texts import say
from .data import Remark

TURNED = math.radians(60)  # rad between positions of S, at least
TRUE = 3.5  # standard deviations of the runout within which it is none
DECIDED = 0.001  # mm: a runout that is less well known says nothing
PLACE = ("EX0S", "EY0S", "EXt", "EYt")


def still(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark where the stylus seems to run true to the last digit, as if the spindle had not turned."""
    model = result.model
    if not {"EX0S", "EY0S", "EXt", "EYt"} <= set(model.names) or np.ptp(model.touches.axis("S")) < TURNED:
        return
    rows = [model.names.index(name) for name in ("EXt", "EYt")]
    value, spread = result.values[rows], result.covariance[np.ix_(rows, rows)]
    std = float(np.sqrt(np.diag(spread)).max())
    if std > DECIDED or np.linalg.matrix_rank(spread) < len(rows):  # a wrong cell may leave a covariance of nothing
        return
    if float(value @ np.linalg.solve(spread, value)) > TRUE**2:
        return
    yield Remark(
        "doubtful",
        say("plausible.spindle.still", size=f"{float(np.hypot(*value)) * 1000.0:.2f}", std=f"{std * 1000.0:.2f}"),
        (),
        "spindle_still",
        "S",
        say("plausible.spindle.change"),
        sure=True,
        moves=PLACE,
    )
