"""What parts have of the errors, and the limits for it: a compensation in the control may take away what probing does not see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..loaded import HELPS
from ..records import Array
from ..report.compensated import ENTERING, order
from ..report.texts import code
from ..report.units import shown
from ..state import Frame, State
from ..state.volume import Volume
from ..texts import Said, joined, say

COVER = 1.959964  # standard deviations of 95 %


@dataclass(frozen=True)
class InControl:
    """What a kept compensation takes away with tool center point control only."""

    number: int
    target: str
    date: str  # of the event that counts
    gone: Array  # (p,) of every unknown that is followed: what parts do not have
    event: str = "kept"  # or kept as far as seen; after another one nothing of it is gone: nobody knows that it acts
    beneath: int | None = None  # the one that was kept, and that it was made on top of: what is gone then

    @property
    def measured(self) -> bool:
        """→ whether it was found to help."""
        return self.event in HELPS

    def instead(self, do: Said | str, *, changed: bool) -> Said | str:
        """what to do about an error → the same while nobody knows whether the compensation acts: none is entered once more.

        `changed`: since another night, as after a knock, so that a compensation on top of it may be right.
        """
        words = {"number": self.number, "target": self.target, "event": code(self.event)}
        if not changed:
            return say(order(self.event), **words)
        return joined(" ", [do, say("night.on_top", **words)]) if isinstance(do, Said) and do.key in ENTERING else do

    def as_json(self) -> dict[str, Any]:
        """→ member `in_control` of the record."""
        found = {"number": self.number, "target": self.target, "date": self.date, "event": self.event, "measured": self.measured}
        return found | ({"beneath": self.beneath} if self.beneath is not None else {})


@dataclass(frozen=True)
class Given:
    """The control got a compensation, or lost it: runs that see it measure another machine since then."""

    utc: str
    date: str
    number: int
    target: str
    taken_out: bool = False

    def told(self, alarm: dict[str, Any]) -> dict[str, Any]:
        """alarm of the first night after that → the same, saying so, and who decides."""
        key = "compensation_taken_out" if self.taken_out else "compensation_given"
        words = {"number": self.number, "target": self.target, "date": self.date}
        unknown = isinstance(alarm["text"], Said) and alarm["text"].key == "changed.unknown"
        first = say("changed.several") if unknown else alarm["text"]  # its cause is what was written or taken out
        text, part = say(f"changed.after_{key}", text=first, **words), say(f"part.{key}", number=self.number)
        told = {"text": text, "do": say(f"night.{key}_do", **words), "on_part": part, "on_part_um": None}
        return alarm | told | {"compensation": {"number": self.number, "taken_out": self.taken_out}}


def limited(followed: Frame, stated: Mapping[str, float], have: State, chart: Volume) -> list[dict[str, Any]]:
    """what is followed, limits by name, state of what parts have, errors over the volume → member `limits` of the record."""
    found = []
    places = {followed.selection.label(followed.names[i]): i for i in followed.machine}
    for name, limit in stated.items():
        if name == "volume":
            size, spread, unit = chart.worst * 1e3, chart.std * 1e3, "µm"
        elif name in places:
            i = places[name]
            factor, unit = shown(followed.units[i])
            size, spread = abs(float(have.mean[i])) * factor, float(have.std[i]) * factor
        else:
            continue
        low, high = size - COVER * spread, size + COVER * spread
        passed = True if high <= limit else False if low > limit else None
        found.append({"what": name, "value": size, "unit": unit, "low": low, "high": high, "limit": limit, "passed": passed})
    return found


def reached(followed: Frame, lever: Array, mean: Array, a_day: Array, limit: Mapping[str, Any]) -> float:
    """what is followed, (m, 3, p) of the volume, (p,) errors that parts have, (p,) what goes on a day, limit → days until it is
    reached if that goes on; infinite for one that is crossed already or never reached.
    """
    if limit["passed"] is False:
        return np.inf
    if limit["what"] != "volume":
        place = next((i for i in followed.machine if followed.selection.label(followed.names[i]) == limit["what"]), None)
        if place is None or a_day[place] == 0.0:
            return np.inf
        most = float(limit["limit"]) / shown(followed.units[place])[0]
        return max((np.copysign(most, a_day[place]) - float(mean[place])) / float(a_day[place]), 0.0)
    # |e + t d| = limit at each pose: the larger root of a square; the first pose that gets there counts
    error, way, most = lever @ mean, lever @ a_day, float(limit["limit"]) * 1e-3
    a, b, c = np.sum(way**2, axis=1), np.sum(way * error, axis=1), np.sum(error**2, axis=1) - most**2
    moving = a > 1e-30
    if not moving.any():
        return np.inf
    root = (-b + np.sqrt(np.maximum(b**2 - a * c, 0.0)))[moving] / a[moving]
    return float(np.maximum(root, 0.0).min())
