"""A machine that moved within the run of a night: what the morning says of it. Where the machine is now, the next full run says."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..records import Readings
from ..state import Within
from ..texts import say
from .alarms import Known, others, said_of
from .dates import Since
from .doubt import NightDoubt

SOON = 0.05  # min, which would be told as 0.0


def moved_within(k: Known, found: Within, readings: Readings) -> NightDoubt:
    """what is known, the step, readings → the judgement of a night whose touches are of two machines: it teaches nothing."""
    made = readings.touch[np.argsort(readings.time, kind="stable")].tolist()  # a check has few of the numbers of its strategy
    minutes = float(readings.time[np.flatnonzero(readings.touch == found.after)[0]] - readings.time.min()) / 60
    _, _, text = said_of(k, Since("", say("night.within.since")), found.named)
    names = others(k, found.named.hypothesis.parameter, found.named.instead)
    also = say("night.within.or", names=", ".join(names)) if names else ""
    place = {"before": str(made.index(found.before) + 1), "after": str(made.index(found.after) + 1), "count": str(len(made))}
    told = {"text": text, "also": also, **place}
    reason = say("night.within.step_soon", **told) if minutes < SOON else say("night.within.step", **told, minutes=f"{minutes:.1f}")
    return NightDoubt("doubtful", (reason,), believed=False)


def as_json(k: Known, found: Within) -> dict[str, Any]:
    """what is known, step within the run → member `within` of the record."""
    named = found.named
    size = float(named.size[0]) if len(named.size) == 1 else named.length
    return {
        **{"cause": named.hypothesis.cause, "parameter": named.hypothesis.parameter, "unit": named.hypothesis.unit},
        **{"size": size, "std": float(named.std.max()), "sigmas": named.sigmas},
        "instead": others(k, named.hypothesis.parameter, named.instead),
        **{"touch_before": found.before, "touch_after": found.after},
    }
