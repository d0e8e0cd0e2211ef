"""What stands behind a crossed limit: the changes of the last month that brought the volume there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..records import Array
from ..report.texts import texts
from ..state import State
from ..texts.number import number
from .alarms import Known, effect_of
from .course import cause_of, only
from .dates import date_of
from .drift import drift_of
from .one_date import night_of
from .words import value

MONTH = 30  # nights that what stands behind a limit is looked for over
NAMED = 3  # parameters that stand behind one limit, at most
SHARE = 1 / 3  # of what the first of them does to the volume, from which another one stands behind the limit as well
BEFORE = 0.25  # share of a movement that the parameter may have been off by before it
SURE = 3.0  # standard deviations that a parameter has moved by, and of another one beyond what it wanders in that time


def behind(
    k: Known,
    records: Sequence[Mapping[str, Any]],
    after: State,
    limit: Mapping[str, Any],
    gone: Array | None = None,
    dates: Mapping[str, tuple[str, float]] | None = None,
) -> list[dict[str, Any]]:
    """what is known, records newest first, state after tonight, limit that is crossed → the parameters that stand behind it; what
    does most comes first.

    `gone`: (p,) what the control takes away from parts, so that it does not stand behind anything. `dates`: {parameter: date since
    which its open alarm or its trend says that it has moved, and which way}: that date counts.

    Against the first of the last `MONTH` nights that kept the limit: what has moved most since, by what it does to the volume, and
    the last night on which it had not; others that do `SHARE` of that at least, and more than they wander. Where no night kept it,
    the parameter that does most, and no date.
    """
    known = [r for r in records[:MONTH] if r.get("parameters") and r.get("state")]
    kept = [r for r in known if any(x["what"] == limit["what"] and x["passed"] is not False for x in r.get("limits") or ())]
    share: list[tuple[float, int, float, float]] = []
    for i in k.followed.machine:
        name = k.followed.selection.label(k.followed.names[i])
        then = kept[-1]["parameters"].get(name) if kept else {"value": 0.0 if gone is None else float(gone[i]), "std": 0.0}
        if limit["what"] not in ("volume", name) or then is None:
            continue
        size, std = float(after.mean[i]) - then["value"], float(np.hypot(after.std[i], then["std"]))
        if abs(size) > SURE * std:
            share.append((k.worst(only(k, int(i), size)), int(i), size, std))
    if not share:
        return []
    share.sort(reverse=True)
    if not kept:
        worst, i, size, std = share[0]
        return [_most(k, limit, worst, i, size, std)]
    days = after.day - float(kept[-1]["state"]["day"])
    more = [
        (i, std)
        for worst, i, size, std in share[1:]
        if worst > SHARE * share[0][0] and abs(size) > SURE * float(np.sqrt(std**2 + after.rates[i] * max(days, 0.0)))
    ]
    first = (share[0][1], share[0][3])
    return [_moved(k, records, known, kept, after, limit, dates or {}, *one) for one in [first, *more][:NAMED]]


def _most(k: Known, limit: Mapping[str, Any], worst: float, i: int, size: float, std: float) -> dict[str, Any]:
    """what is known, limit that no night kept, µm that its largest parameter does, the parameter, its size ± std → that."""
    name, unit = k.followed.selection.label(k.followed.names[i]), k.followed.units[i]
    _, on_part, _ = effect_of(k, cause_of(k, i), name, size, unit, only(k, i, size))
    text = texts()("changed.most", name=name, size=value(size, unit, std), share=number(worst, "µm", signed=False))
    return {
        **{"what": limit["what"], "parameter": name, "unit": unit, "text": text, "since": "", "rate_per_day": None},
        **{"size": size, "std": std, "on_part": on_part, "do": texts()("night.most_do")},
    }


def _moved(
    k: Known,
    records: Sequence[Mapping[str, Any]],
    known: Sequence[Mapping[str, Any]],
    kept: Sequence[Mapping[str, Any]],
    after: State,
    limit: Mapping[str, Any],
    dates: Mapping[str, tuple[str, float]],
    i: int,
    std: float,
) -> dict[str, Any]:
    """what is known, records newest first, those of them that measured and those that kept the limit, state after tonight, limit,
    dates, a parameter ± std → since when and how fast it has moved.
    """
    name, unit = k.followed.selection.label(k.followed.names[i]), k.followed.units[i]
    begun = kept[-1]["parameters"][name]
    still = [
        r for r in known if name in r["parameters"] and abs(r["parameters"][name]["value"] - begun["value"]) < 3 * begun["std"]
    ]
    size = float(after.mean[i]) - begun["value"]
    own = night_of(dates, name, size, records) or _alarmed(name, size, begun["value"], known)
    since = own if own is not None and name in own["parameters"] else still[0]
    found = drift_of(k, i, since, float(after.mean[i]) - since["parameters"][name]["value"], std, after, 0.0, 0.0, records)
    with_it = [r for r in known if r["night"] > found.since]
    later = with_it[:-1]  # after the night that found it
    again = [r["night"] for r in later if r.get("kind") == "full" and r["parameters"].get(name, {}).get("seen")]
    return {
        **{"what": limit["what"], "parameter": name, "unit": unit},
        **{"night": str(with_it[-1]["night"]) if with_it else date_of(after.day)},
        **{"cause": cause_of(k, i), "confirmed": again[-1] if again else None, "text": found.text, "since": found.since},
        **{"rate_per_day": found.rate_per_day if found.steady else None, "size": found.size, "std": found.std},
        **{"on_part": found.on_part, "do": found.do},
    }


def _alarmed(name: str, size: float, begun: float, known: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """parameter, its movement, where that began, nights that measured, newest first → the night since which an alarm said so that
    somebody has closed since: the newest one that went the same way from about there. None where there was no such alarm.
    """
    by_night = {r["night"]: r for r in known}
    for a in (a for r in known for a in r.get("alarms") or ()):
        since = by_night.get(a.get("since"))
        if a.get("parameter") != name or since is None or float(a.get("size") or 0.0) * size <= 0:
            continue
        there = since["parameters"].get(name)
        if there is not None and abs(there["value"] - begun) < BEFORE * abs(size):
            return since
    return None
