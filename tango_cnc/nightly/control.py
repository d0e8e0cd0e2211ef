"""What parts have of the errors, and the limits for it: a compensation in the control may take away what probing does not see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..records import Array
from ..report.units import shown
from ..state import Frame, State
from ..state.volume import Volume

COVER = 1.959964  # standard deviations of 95 %


@dataclass(frozen=True)
class InControl:
    """What a kept compensation takes away with tool center point control only."""

    number: int
    target: str
    date: str  # on which it was found to help
    gone: Array  # (p,) of every unknown that is followed: what parts do not have

    def as_json(self) -> dict[str, Any]:
        """→ member `in_control` of the record."""
        return {"number": self.number, "target": self.target, "date": self.date}


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
