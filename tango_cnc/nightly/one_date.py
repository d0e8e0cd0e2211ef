"""One date for one movement: what a night says of a parameter is counted from where its open alarm, or its trend, began."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..report.tonight import is_over
from ..state import State
from .alarms import Known
from .course import followed, moved_since, name_of, on_record
from .drift import Drift, drift_of


def begun(alarms: Sequence[Mapping[str, Any]], moving: Drift | None = None) -> dict[str, tuple[str, float]]:
    """alarms of tonight and of other nights that nobody has closed, trend of tonight → {parameter: date since which it has moved,
    size, whose sign is the way that it went}. Of several alarms of a parameter the oldest counts that has not gone back.
    """
    found = {} if moving is None else {moving.parameter: (moving.since, moving.size)}
    for a in sorted(alarms, key=lambda a: str(a["since"]), reverse=True):
        if a["size"] and a["since"] and not is_over(a):
            found[str(a["parameter"])] = (str(a["since"]), float(a["size"]))
    return found


def night_of(
    told: Mapping[str, tuple[str, float]], name: str, size: float, records: Sequence[Mapping[str, Any]]
) -> Mapping[str, Any] | None:
    """dates by parameter, parameter, size of its movement, records newest first → the record of the night that it is counted from;
    None where no alarm has said one, and of a movement the other way.
    """
    since, way = told.get(name, ("", 0.0))
    if way * size <= 0:
        return None
    return next((r for r in records if r["night"] == since and r.get("parameters") and r.get("state")), None)


def as_alarmed(
    k: Known, moving: Drift | None, waiting: Sequence[Mapping[str, Any]], records: Sequence[Mapping[str, Any]], after: State
) -> Drift | None:
    """what is known, trend of tonight, alarms of other nights that nobody has closed, records newest first, state after tonight →
    the trend, counted from where the alarm of a drift of its parameter began.
    """
    if moving is None:
        return None
    told = begun([a for a in waiting if a["rate_per_day"]])
    record = night_of(told, moving.parameter, moving.size, records)
    place = next(i for i in followed(k) if name_of(k, i) == moving.parameter)
    if record is None or record["night"] == moving.since or on_record(k, place, record, after) is None:
        return moving
    size, std = moved_since(k, place, record, after)
    if size * moving.size <= 0:
        return moving
    return drift_of(k, place, record, size, std, after, moving.sigmas, moving.p_value, records, moving.alarms)
