"""Days on which the control got or lost a compensation, or one was found to help: a trend may jump there without a fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any

from .days import local_day
from .texts import Texts

SHOWN = {"written": "written", "kept": "kept", "rolled back": "taken_out"}  # event: key of its words; others change nothing


def marked(events: Sequence[Any], t: Texts) -> dict[str, str]:
    """events of compensations, newest first, texts → {date: what happened on it}, oldest first."""
    found: dict[str, list[str]] = {}
    for e in reversed(events):
        if e.event in SHOWN:
            said = t(f"trend.compensation_{SHOWN[e.event]}", number=e.number)
            found.setdefault(local_day(e.utc), []).append(said)
    return {day: ", ".join(dict.fromkeys(said)) for day, said in found.items()}


def placed(marks: Mapping[str, str], first: date, last: date) -> list[tuple[float, str]]:
    """{date: what happened}, first and last day of a curve → (days from the first, what happened) of those between."""
    days = [(date.fromisoformat(day), said) for day, said in marks.items()]
    return [(float((day - first).days), said) for day, said in days if first <= day <= last]


def begins(marks: Mapping[str, str], nights: Sequence[str]) -> set[int]:
    """{date: what happened}, dates of nights, oldest first → places of the first night after each."""
    found = {next((i for i, night in enumerate(nights) if night >= day), 0) for day in marks}
    return found - {0}
