"""A spindle that did not turn: the tip is at the same place whatever S says. A stylus that runs so true is rare; so is a lost M19.

Where the spindle stands still, what belongs to the stylus goes into the place of the spindle, and every touch fits. Two
explanations compete: no runout was seen because the spindle stood, or the stylus runs true within what is known. The second has
the runout normal in each direction, with `tolerances.runout` or what is usual as its standard deviation (Bayes factor).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..texts import say
from .data import Remark

TURNED = math.radians(60)  # rad between positions of S, at least
LOST = 0.02  # odds of a spindle that stands still before anything was measured
LIKELY = 1.0  # odds after that, beyond which the result is doubtful
POSSIBLE = 0.05  # odds beyond which the place of the spindle is not to be trusted
PLACE = ("EX0S", "EY0S", "EXt", "EYt")


def still(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark where the tip seems to be at the same place whatever S says, as if the spindle had not turned."""
    model = result.model
    if not set(PLACE) <= set(model.names) or np.ptp(model.touches.axis("S")) < TURNED:
        return
    rows = [model.names.index(name) for name in ("EXt", "EYt")]
    value, spread = result.values[rows], result.covariance[np.ix_(rows, rows)]
    if np.linalg.matrix_rank(spread) < len(rows):  # a wrong cell may leave a covariance of nothing
        return
    odds = standing(value, spread, model.touches.machine.tolerances.usual_runout)
    if odds < POSSIBLE:
        return
    size, std = float(np.hypot(*value)), float(np.sqrt(np.diag(spread)).max())
    yield Remark(
        "doubtful" if odds > LIKELY else "trustworthy",
        say("plausible.spindle.still", size=f"{size * 1000.0:.2f}", std=f"{std * 1000.0:.2f}"),
        (),
        "spindle_still",
        "S",
        say("plausible.spindle.change"),
        sure=True,
        moves=PLACE,
    )


def one_orientation(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark where the spindle was never turned, whatever the terms: then its place may be the stylus' own runout.

    Where no rotary axis turns, either, the set-up of a workpiece takes both out.
    """
    touches = result.model.touches
    if not touches.one_orientation or not any(np.ptp(touches.axis(name)) > TURNED for name in touches.machine.rotary):
        return
    size = touches.machine.tolerances.usual_runout
    yield Remark("trustworthy", say("plausible.spindle.one_orientation", size=f"{size * 1e3:g}"))


def standing(runout: np.ndarray, spread: np.ndarray, usual: float) -> float:
    """(2,) mm of runout, its (2, 2) covariance, mm of runout in each direction as styli have it → odds that S stood still."""
    turning = spread + usual**2 * np.eye(2)
    further = runout @ np.linalg.solve(spread, runout) - runout @ np.linalg.solve(turning, runout)
    return LOST * math.sqrt(float(np.linalg.det(turning) / np.linalg.det(spread))) * math.exp(-float(further) / 2)
