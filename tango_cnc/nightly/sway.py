"""What goes to and fro from night to night by more than it is known to, and has moved beside that: a sentence, and never an alarm.

Of a machine that swings with its hall, and that no sensor tells of, a slow drift is lost in the swing: how fast it wanders is
learned from that. Means of ten nights have hardly any swing left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import special

from ..state import State
from .alarms import Known
from .course import Place, followed, moved_since, name_of, names_of, now_of, on_record, only, places_of, told_of
from .drift import LEAST, TOLD, Drift, drift_do, drift_of

MEAN = 10  # measured nights of a mean
SWAYS = 2.0  # times what a value is known to: what differs by more from night to night goes to and fro
BESIDE = 1.5  # standard deviations of what goes to and fro, from which two means are another place


def swayed(k: Known, records: Sequence[Mapping[str, Any]], after: State) -> Drift | None:
    """what is known, records newest first, state after tonight → what has moved farthest beside its way to and fro: the mean of the
    last ten measured nights against that of the first ten, back to its own last alarm; None where nothing has.
    """
    back = [r for r in records if r.get("parameters") and r.get("state")]
    found = [one for i in followed(k) if not isinstance(i, tuple) and (one := _beside(k, i, back, after)) is not None]
    return max(found, key=lambda d: d.sigmas, default=None)


def _beside(k: Known, i: Place, back: Sequence[Mapping[str, Any]], after: State) -> Drift | None:
    """what is known, a parameter, measured nights newest first, state after tonight → how it has moved, as above."""
    own = []
    for r in back:
        if on_record(k, i, r, after) is None:
            break
        own.append(r)
        if not told_of(r).isdisjoint(names_of(k, i)):
            break
    if len(own) + 1 < 2 * MEAN:
        return None
    nights = [now_of(i, after), *(x for r in own if (x := on_record(k, i, r, after)) is not None)]
    values, stds = np.array(nights).T
    known = float(np.median(stds))
    last, first = values[:MEAN], values[-MEAN:]
    spread = float(np.sqrt((np.var(last, ddof=1) + np.var(first, ddof=1)) / 2))
    size = float(last.mean() - first.mean())
    record = own[-MEAN]
    if spread < SWAYS * known or abs(size) < max(BESIDE * spread, TOLD * known) or k.worst(only(k, i, size)) < LEAST:
        return None
    std = moved_since(k, i, record, after)[1]
    sigmas = abs(size) / float(np.hypot(std, spread * np.sqrt(2 / MEAN)))
    chance = float(2 * special.ndtr(-sigmas))
    found = drift_of(k, i, record, size, std, after, sigmas, min(1.0, len(k.followed.machine) * chance), own, alarms=False)
    do = drift_do(str(k.followed.families[places_of(i)[0]]), name_of(k, i))
    return replace(found, steady=False, step=None, stepped="", do=do, mean_of=MEAN)
