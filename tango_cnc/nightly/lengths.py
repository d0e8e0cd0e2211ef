"""Alarms of a stylus, a table or a ball of other nights: their size is a length in space, which no one parameter has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..report.tonight import LENGTHS, NOW, WAS
from ..state import State
from ..texts import Said, say
from .alarms import FARTHEST, Known
from .goes_on import newest_of
from .moved import Moved, moved
from .ports import Past
from .standing import still
from .words import value


def with_total(
    past: Past, machine: str, k: Known, after: State, waiting: Sequence[dict[str, Any]], kind: str
) -> list[dict[str, Any]]:
    """history, machine, what is known, state after tonight, alarms of other nights, kind of night → the same; those of a length
    with `now` and `total`: how far it is tonight from where it was before the alarm.
    """
    if not any(a["cause"] in LENGTHS for a in waiting):
        return list(waiting)
    newest = newest_of(past, machine)
    mine = [a["cause"] in LENGTHS and not a.get("ended") for a in waiting]  # what went back is as its night has told it
    return [_with_total(past, machine, k, after, a, newest, kind) if own else a for a, own in zip(waiting, mine, strict=True)]


def _with_total(
    past: Past,
    machine: str,
    k: Known,
    after: State,
    alarm: dict[str, Any],
    newest: Mapping[str, tuple[Any, Mapping[str, Any]]],
    kind: str,
) -> dict[str, Any]:
    if alarm["id"] not in newest or (m := moved(past, machine, k, after, *newest[alarm["id"]])) is None:
        return alarm
    total, std = _length(m)
    told = value(total, m.unit, std, signed=False) if total <= FARTHEST else say("night.alarms.farther", size=f"{FARTHEST:g}")
    return alarm | {"total": total, "now": still(float(alarm["size"]), total, std, told, confirmed=kind == "full")}


def as_seen_last(alarms: Sequence[dict[str, Any]], recent: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """alarms of other nights, records newest first → the same for a night that knows nothing itself: those of a length with how far
    the last night that is believed has seen them, those of a drift with since when it stands still.
    """
    last = next((r for r in recent if r.get("verdict") not in ("not_measured", "doubtful")), {})
    seen = {str(a["id"]): a for a in last.get("standing") or ()}
    return [_as_seen(a, seen.get(str(a["id"])), str(last.get("night"))) for a in alarms]


def _as_seen(a: dict[str, Any], seen: Mapping[str, Any] | None, night: str) -> dict[str, Any]:
    pace = {key: seen[key] for key in ("stands", "slowed") if seen.get(key)} if seen is not None and a.get("rate_per_day") else {}
    a = {**a, **pace}
    if a["cause"] not in LENGTHS or a.get("ended") or a.get("now") or seen is None or seen.get("total") is None:
        return a
    now = seen.get("now")
    if isinstance(now, Said) and now.key in NOW:
        now = say(WAS, told=now.values["told"], night=night)
    return a | {"now": now, "total": seen["total"]}


def _length(m: Moved) -> tuple[float, float]:
    """how far it has moved → mm from where it was before, and its standard deviation: the share along the way of the alarm where
    it has come back, else the whole.
    """
    then, along, std = m.along()
    whole = float(np.linalg.norm(m.now))
    return (whole if along > 0.5 * then else along), std
