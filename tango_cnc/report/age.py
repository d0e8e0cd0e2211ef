"""How long ago a machine was measured: a result that is too old is no answer of today."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, time, timedelta
from typing import Any

from .days import days_between, ended_at, local_day

NIGHT = time(6)  # what began before that was begun by the clock of the nights
EVENING = timedelta(hours=6)  # before midnight: a night that begins later is of the next day (docs/nightly.md)


def measured_on(record: Mapping[str, Any], before: Mapping[str, Any] | None = None) -> str:
    """record of the newest night, of the last that measured where that one did not → date of the last measurement; '' for none.

    What was measured in the evening is of the next morning, as its night is.
    """
    known = (before if record.get("verdict") == "not_measured" else record) or {}
    if known and known.get("verdict") != "not_measured":
        return max(local_day(known.get("end_utc")), str(known.get("night") or ""))
    return str(record.get("last_measured") or "")


def due(now: datetime, begun: object) -> str:
    """now, when the last night that measured began (UTC) → date of the newest night that has begun by the clock of the nights of
    this machine: just after midnight that of today has not, where its nights begin at two.
    """
    now = now.astimezone()
    started = ended_at(begun)
    early = started is not None and now.time() < started.astimezone().time() < NIGHT
    return f"{now - timedelta(days=1) if early else now:%Y-%m-%d}"


def nights_old(measured: str, today: str, most: float) -> int:
    """date of the last measurement, of the newest night that was due, days for which a result is an answer → nights between them; 0
    as long as it is one.
    """
    nights = days_between(measured, today) if measured else 0
    return nights if nights > most else 0


def night_of_stamp(stamp: str) -> str:
    """2026-11-28T230000Z, stamp of a night → 2026-11-29, date of the morning after it; what is no stamp stays as it is."""
    try:
        begun = datetime.strptime(stamp[:18], "%Y-%m-%dT%H%M%SZ").replace(tzinfo=UTC).astimezone()
    except ValueError:
        return stamp
    return (begun + EVENING).strftime("%Y-%m-%d")
