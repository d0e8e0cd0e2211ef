"""Days on which the control got or lost a compensation, or one was found to help: a trend may jump there without a fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any

from .days import local_day
from .texts import Texts

SHOWN = {"written": "written", "kept": "kept", "rolled back": "taken_out"}  # event: key of its words; others change nothing
HELD = {"kept": "in_control", "written": "in_control_written"}  # event: key of what the night says of it
ORDERS = {"written": "measure_first", "undecided": "decide", "no help": "take_out"}  # event: key of what to do


def marked(events: Sequence[Any], t: Texts) -> dict[str, str]:
    """events of compensations, newest first, texts → {date: what happened on it}, oldest first."""
    found: dict[str, list[str]] = {}
    for e in reversed(events):
        if e.event in SHOWN:
            said = t(f"trend.compensation_{SHOWN[e.event]}", number=e.number)
            found.setdefault(local_day(e.utc), []).append(said)
    return {day: ", ".join(dict.fromkeys(said)) for day, said in found.items()}


def held(record: Mapping[str, Any], t: Texts) -> str:
    """record of a night, texts → what to say of a compensation in the control that probing may not see; '' without one."""
    if not (known := record.get("in_control")):
        return ""
    event = str(known.get("event") or ("kept" if known["measured"] else "written"))
    line = t(
        f"night.{HELD.get(event, 'in_control_open')}", **{key: known[key] for key in ("number", "target", "date")}, event=event
    )
    return line if event == "kept" else f"{line} {t(order(event), number=known['number'], target=known['target'], event=event)}"


def order(event: str) -> str:
    """event after which nobody knows whether a compensation acts → key of what to do before anything else is entered."""
    return f"night.{ORDERS.get(event, 'measure_again')}"


def placed(marks: Mapping[str, str], first: date, last: date) -> list[tuple[float, str]]:
    """{date: what happened}, first and last day of a curve → (days from the first, what happened) of those between."""
    days = [(date.fromisoformat(day), said) for day, said in marks.items()]
    return [(float((day - first).days), said) for day, said in days if first <= day <= last]


def begins(marks: Mapping[str, str], nights: Sequence[str]) -> set[int]:
    """{date: what happened}, dates of nights, oldest first → places of the first night after each."""
    found = {next((i for i, night in enumerate(nights) if night >= day), 0) for day in marks}
    return found - {0}
