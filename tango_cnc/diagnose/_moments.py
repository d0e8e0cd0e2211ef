"""What belongs to one moment or one pose: it is set aside before names are looked for, so that it does not feed them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import terms as families
from ..records import Array, TermItem
from ._candidates import pattern
from ._contest import Outcome
from ._explain import Explanation
from ._rows import Rows


@dataclass(frozen=True)
class Moment:
    """Touches in a row that something else happened to."""

    kind: str  # indexation, window
    first: int  # row of its first touch, counted from 0
    last: int  # and of its last one
    axis: str | None  # rotary axis that stood at another angle; None for a shift
    item: TermItem  # the entry of a list of terms that takes it into the model
    columns: Array  # (n, k) mm
    amplitude: float  # mm at the touch that feels it most
    score: float  # evidence for it


def moments(means: Rows, found: Explanation, outcome: Outcome, weight: Array) -> list[Moment]:
    """rows, explanation, outcome of the contest → what it put down to one moment or pose."""
    touches, name = means.whole, families.serving("moment")
    result = []
    for p in outcome.events:
        setting = p.kernel.setting
        if p.kernel.kind == "window":
            first, last = int(setting["first"]), int(setting["last"]) - 1
        else:
            rows = np.flatnonzero(touches.indexation == setting["indexation"])
            first, last = int(rows[0]), int(rows[-1])
        axis = setting.get("axis")
        detail = {"at": first + 1, "until": last + 1} | ({"axis": axis} if axis else {})
        columns = pattern(touches, families.cause(name, touches.machine, detail))
        design = found.place.basis.T @ (columns * weight[:, None])
        values = np.linalg.lstsq(design, found.place.y, rcond=1e-9)[0]
        kind = "window" if p.kernel.kind == "window" else "indexation"
        size = float(np.abs(columns @ values).max())
        result.append(Moment(kind, first, last, axis, {"cause": name, **detail}, columns, size, p.score))
    return result
