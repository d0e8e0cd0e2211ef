"""What belongs to one moment or one pose: it is set aside before names are looked for, so that it does not feed them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from .. import terms as families
from ..records import Array
from ._candidates import pattern
from ._catalogue import Chosen
from ._contest import Outcome
from ._explain import Explanation
from ._records import Remainder
from ._rows import Rows


@dataclass(frozen=True)
class Moment:
    """Touches in a row that something else happened to."""

    kind: str  # indexation, window
    first: int  # row of its first touch, counted from 0
    last: int  # and of its last one
    axis: str | None  # rotary axis that stood at another angle; None for a shift
    item: Mapping[str, Any]  # the entry of a list of terms that takes it into the model
    columns: Array  # (n, k) mm
    amplitude: float  # mm at the touch that feels it most
    score: float  # evidence for it


def moments(means: Rows, found: Explanation, outcome: Outcome, weight: Array) -> list[Moment]:
    """rows, explanation, outcome of the contest → what it put down to one moment or pose.

    Where a second named interruption takes the first one back, both are one window, and no two knocks.
    """
    touches = means.whole
    result = []
    for p in outcome.events:
        setting = p.kernel.setting
        if p.kernel.kind == "window":
            first, last = int(setting["first"]), int(setting["last"]) - 1
        else:
            rows = np.flatnonzero(touches.indexation == setting["indexation"])
            first, last = int(rows[0]), int(rows[-1])
        axis = setting.get("axis")
        kind = "window" if p.kernel.kind == "window" else "indexation"
        result.append(_moment(means, found, weight, kind, first, last, {"axis": axis} if axis else {}, p.score))
    return [*result, *_there_and_back(means, found, outcome.named, weight)]


def left(means: Rows, found: Explanation, outcome: Outcome, weight: Array, aside: Sequence[Moment]) -> list[Remainder]:
    """rows, explanation, what stands in the end, what was set aside → events that were not, as a matter without a name.

    They come up where a name that had taken their place is not named after all.
    """
    known = [m.item for m in aside]
    return [
        Remainder("time" if m.kind == "window" else "indexation", "machine", m.kind, m.amplitude, 0.0, np.zeros(len(means.seen)))
        for m in moments(means, found, replace(outcome, named=()), weight)
        if m.item not in known
    ]


def _moment(
    means: Rows, found: Explanation, weight: Array, kind: str, first: int, last: int, where: dict[str, Any], score: float
) -> Moment:
    name = families.serving("moment")
    detail = {"at": int(means.whole.counted[first]), "until": int(means.whole.counted[last]), **where}
    columns = pattern(means.whole, families.cause(name, means.whole.machine, detail))
    design = found.place.basis.T @ (columns * weight[:, None])
    values = np.linalg.lstsq(design, found.place.y, rcond=1e-9)[0]
    size = float(np.abs(columns @ values).max())
    return Moment(kind, first, last, where.get("axis"), {"cause": name, **detail}, columns, size, score)


def _there_and_back(means: Rows, found: Explanation, named: Sequence[Chosen], weight: Array) -> list[Moment]:
    """Pairs of interruptions in one frame whose three further numbers the residuals do not ask for (Schwarz 1978)."""
    place, interruption = found.place, families.serving("interruption")
    result: list[Moment] = []
    steps = sorted((c for c in named if c.candidate.cause == interruption), key=lambda c: int(c.candidate.setting["at"]))
    for first, second in combinations(steps, 2):
        frame = str(first.candidate.setting["frame"])
        if frame != second.candidate.setting["frame"] or not means.all:
            continue
        at, until = (means.whole.row(c.candidate.setting["at"]) for c in (first, second))
        where = {} if frame == "machine" else {"frame": frame}
        one = _moment(means, found, weight, "window", at, until - 1, where, 0.0)
        window = place.basis.T @ (one.columns * weight[:, None])
        beside = [c.columns for c in named if c is not first and c is not second]
        pair = _misfit(place.y, [*beside, first.columns, second.columns])
        more = first.columns.shape[1] + second.columns.shape[1] - window.shape[1]
        if _misfit(place.y, [*beside, window]) - pair < more * np.log(len(place.y)):
            result.append(one)
    return result[:1]


def _misfit(y: Array, columns: Sequence[Array]) -> float:
    """data (m,), columns → minus twice the log likelihood at its best, without what is common to all."""
    design = np.hstack(columns)
    left = y - design @ np.linalg.lstsq(design, y, rcond=1e-9)[0]
    return float(len(y) * np.log(left @ left))
