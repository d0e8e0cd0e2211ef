"""What dates on record say of a night: its own, the last one with a result, nights that are missing, a clock that went back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from typing import Any

from ..texts import joined, say
from .ports import Past
from .words import LONG

MISSED = 14  # nights without a measurement that may lie between those that measured
NEAR = 1.5  # days within which the night before is last night
EVENING = timedelta(hours=6)  # before midnight: what begins later belongs to the next day
SECOND = 1.0 / 86_400  # d: what is on record is cut to the second
LISTED = 60  # nights looked back over for the last one with a result


@dataclass(frozen=True)
class Since:
    """The last night on which the machine was as before: its local date, and how a sentence names it."""

    date: str
    words: str


def date_of(day: float) -> str:
    """days since 1970-01-01 UTC → 2026-11-23, the date of the night that begins then."""
    return night_of((datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=day)).astimezone())


def night_of(begun: datetime) -> str:
    """moment at which a night begins, with its zone → 2026-11-23, the date of the morning after it.

    It is read on that morning, so a night has this one date on every page: a night from 23:00 to 01:00 is of the second day.
    """
    return (begun + EVENING).strftime("%Y-%m-%d")


def date_at(started: str, now: datetime) -> str:
    """start of a night (UTC), now in the zone of its clock → date of that night; what is no moment is cut to its date."""
    try:
        return night_of(datetime.fromisoformat(started).astimezone(now.tzinfo))
    except ValueError:
        return started[:10]


def day_of(stamp: str) -> float:
    """2026-11-23T02:00:00Z → days since 1970-01-01 UTC."""
    return datetime.fromisoformat(stamp).timestamp() / 86_400


def since(past: Past, machine: str, day: float, every_days: float = 1.0) -> Since:
    """history, machine, day of tonight, days from night to night → the last night that left a result; nights in between without
    one are counted, also those that are not on record one by one.
    """
    found = past.latest_knowledge(machine)
    if found is None:
        return Since("", say("night.alarms.newest_night"))
    last = found[0]
    newer = [n for n in past.nights(machine, last=LISTED) if n.start_utc > last.end_utc]
    newer = [n for n in newer if n.status != "refused" or day_of(n.end_utc) < day - SECOND]  # not by tonight, which measures
    if not newer and day - day_of(last.start_utc) < NEAR:
        return Since(last.night, say("night.alarms.last_night"))
    what = "not_measured" if all(n.verdict == "not_measured" for n in newer) else "no_result"
    count = max(len(newer), missing(day - day_of(last.start_utc), every_days)) if newer else 0
    how_many = "long" if count > LONG else "many" if count > 1 else "one"
    skipped = say(f"night.alarms.{what}_{how_many}", count=count) if newer else ""
    return Since(last.night, joined("", (last.night, skipped)))


def missing(days: float, every_days: float) -> int:
    """days between two nights that measured, days from night to night → nights missing between them."""
    return int(days / every_days + 0.5) - 1


def dated(before: Mapping[str, Any], past: Past, machine: str, begun: datetime, every_days: float) -> dict[str, Any]:
    """what is known of the nights before, history, machine, begin of this night, days from night to night → more of the same.

    `unmeasured_count`: nights missing since the last one that measured, where more are missing than are on record one by one;
    `clock_back`: date of the newest night on record, where the clock dates it in the future: one of both is wrong.
    """
    found: dict[str, Any] = {}
    tonight = night_of(begun)
    if before.get("unmeasured") and before.get("last_measured"):
        days = (date.fromisoformat(tonight) - date.fromisoformat(before["last_measured"])).days
        count = missing(days, every_days)
        found |= {"unmeasured_count": count} if count > len(before["unmeasured"]) else {}
    if ahead := past.ahead(machine):
        found["clock_back"] = ahead[0].night
    return found


def clock_wrong(past: Past, machine: str) -> bool:
    """history by the clock, machine → whether the clock itself is wrong: most of the nights that measured lie in its future."""
    future = [n for n in past.ahead(machine) if n.verdict != "not_measured"]
    return bool(future) and len(future) > sum(n.verdict != "not_measured" for n in past.nights(machine, 2 * len(future) + MISSED))
