"""Dates as people say them: Sun 22 Nov 2026, 03:04 with its zone, 4 h ago."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, date, datetime

from .texts import Texts

DATE = re.compile(r"(?<![\w/-])(\d{4}-\d{2}-\d{2})(?![\w-])")


def day(text: object, t: Texts, year: bool = True) -> str:
    """2026-11-22, texts, whether with the year → Sun 22 Nov 2026; what is no date stays as it is."""
    try:
        found = date.fromisoformat(str(text))
    except ValueError:
        return str(text)
    words = {"weekday": t("date.days").split()[found.weekday()], "month": t("date.months").split()[found.month - 1]}
    return t("date.long" if year else "date.short", day=str(found.day), year=str(found.year), **words)


def between(nights: Sequence[str], t: Texts) -> str:
    """dates, oldest first, texts → Sun 1 Nov 2026 … Mon 30 Nov 2026."""
    return f"{day(nights[0], t)} … {day(nights[-1], t)}"


def spoken_days(text: str, t: Texts) -> str:
    """sentence, texts → the same with its dates as people say them."""
    return DATE.sub(lambda m: day(m[1], t), text)


def ended(utc: object, t: Texts, now: datetime | None = None) -> str:
    """end of a night (UTC), texts, now (None: not told) → at 03:04 CET, 4 h ago; '' where no end is on record."""
    moment = ended_at(utc)
    if moment is None:
        return ""
    told = t("date.ended", time=clock(moment))
    return told if now is None or now < moment else f"{told}, {ago(moment, t, now)}"


def ended_at(utc: object) -> datetime | None:
    """end of a night (UTC) as it is on record → its moment; None where none is."""
    try:
        moment = datetime.fromisoformat(str(utc))
    except ValueError:
        return None
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment


def ago(moment: datetime, t: Texts, now: datetime) -> str:
    """moment, texts, now → 4 h ago."""
    hours = max((now - moment).total_seconds() / 3600, 0.0)
    key, count = ("minutes", hours * 60) if hours < 1 else ("hours", hours) if hours < 48 else ("days_ago", hours // 24)
    return t(f"date.{key}", count=f"{count:.0f}")


def at(utc: object, t: Texts) -> str:
    """moment (UTC), texts → Sun 22 Nov 2026, 03:04 CET; what is no moment stays as it is."""
    try:
        moment = datetime.fromisoformat(str(utc))
    except ValueError:
        return str(utc)
    moment = (moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment).astimezone()
    return f"{day(moment.date(), t)}, {clock(moment)}"


def local_day(utc: object) -> str:
    """moment (UTC) → 2026-11-22, its date in the zone of this computer; what is no moment is cut to its date."""
    try:
        moment = datetime.fromisoformat(str(utc or ""))
    except ValueError:
        return str(utc or "")[:10]
    return (moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment).astimezone().strftime("%Y-%m-%d")


def clock(moment: datetime) -> str:
    """moment → 03:04 CET, in the zone of this computer."""
    return moment.astimezone().strftime("%H:%M %Z")


def days_between(first: object, last: object) -> int:
    """two dates as text → days from the first to the last; 0 where one is no date."""
    try:
        return (date.fromisoformat(str(last)[:10]) - date.fromisoformat(str(first)[:10])).days
    except ValueError:
        return 0
