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


def moved_within(k: Known, found: Within, readings: Readings) -> NightDoubt:
    """what is known, the step, readings → the judgement of a night whose touches are of two machines: it teaches nothing."""
    minutes = float(readings.time[np.flatnonzero(readings.touch == found.after)[0]] - readings.time.min()) / 60
    since = say("night.within.since", touch=str(found.before), minutes=f"{minutes:.1f}")
    _, _, text = said_of(k, Since("", since), found.named)
    names = others(k, found.named.hypothesis.parameter, found.named.instead)
    also = say("night.within.or", names=", ".join(names)) if names else ""
    reason = say("night.within.step", text=text, also=also, before=str(found.before), after=str(found.after))
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
