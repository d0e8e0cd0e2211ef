"""A machine that drifts, or a stylus that creeps in its holder: while the spindle stands as it mostly does, both read alike.

They part where the spindle was turned, and there the places of spindle and tip take most of the difference up. So a drift that
was found is compared with a tip that creeps by a smooth curve of time (information criterion of Akaike 1974). Where it does about
as well as the drift, nobody can tell which it was, and what it would move is not to be trusted.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..records import Array
from ..texts import joined, say
from ..touches import Touches
from .data import Remark
from .either import AS_WELL, WORTH, Drift, to_white
from .lacking import MOVED, SHOWN, TOUCHED, Left, steady
from .shapes import TURNED
from .spindle import PLACE

CREPT = "plausible.lacking.creeping"  # key of the sentence


def creeps(result: Estimate, drift: Drift, behind: float = AS_WELL) -> Iterator[Remark]:
    """estimate, its drift → a remark where what was taken for a drift may as well be a stylus that creeps.

    `behind`: by how much the stylus may do worse than the drift.
    """
    white, touches = drift.white, result.model.touches
    if np.ptp(touches.axis("S")) <= TURNED:
        return
    smooth = max(_gain(touches, white, frame)[0] for frame in (touches.machine_normal, touches.of_table))
    gain, moved = _gain(touches, white, touches.spindle_normal[:, :2])
    if gain <= max(WORTH, min(drift.gain, smooth) - behind):
        return
    p = len(result.model.coefficients)
    by = np.abs(to_white(result, white) + moved)[:p] / result.std[:p]
    names = [result.model.names[int(j)] for j in np.argsort(-by) if by[j] > TOUCHED]
    if by.max(initial=0.0) < MOVED:
        return
    text = say(
        CREPT,
        names=joined(", ", [result.selection.label(n) for n in names[:SHOWN]]),
        size=f"{float(by.max()):.0f}",
    )
    places = [name for name in PLACE if name in result.model.names[:p]]  # they take up what the touches tell of it
    yield Remark("trustworthy", text, moves=tuple(dict.fromkeys([*names, *places])))


def _gain(touches: Touches, white: Left, frame: Array) -> tuple[float, Array]:
    """(n, k) mm a unit of a displacement → gain of the best of three smooth curves of it, by how much that moves each unknown."""
    t = (touches.time - touches.time.min()) / (float(np.ptp(touches.time)) or 1.0)
    tried = []
    for curve in ((t,), (t**2,), (t, t**2)):
        taken, free, moved = steady(white, np.hstack([frame * shape[:, None] for shape in curve]))
        tried.append((taken - 2 * free, moved))
    return max(tried, key=lambda one: one[0])
