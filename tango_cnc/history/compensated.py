"""What happened to the compensations of a machine: lines of compensations/history.jsonl → entries of the chain, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import insert, select

from ..records import InputError
from . import _chain
from . import _tables as t
from .records import Compensation
from .store import History

EVENTS = ("proposed", "written", "kept", "kept as far as seen", "not as promised", "undecided", "no help", "rolled back")
_COLUMNS = ("entry_id", "utc", "number", "target", "event", "text", "before_um", "promised_um", "measured_um")


def add_compensations(history: History, machine: str, cell: str, events: Sequence[Mapping[str, Any]]) -> int:
    """history, machine, folder of the cell, events of its compensations oldest first → how many were not there yet and now are.

    An event that is there already stays as it is, so that all of them may be given each time. On disk when this returns.
    Raises InputError for an unknown event, LinkError when the database does not take it.
    """
    rows = [_row(event) for event in events]
    there: set[str] = set()
    if history.knows(machine):
        c = t.compensation.c
        there = {r.line_sha256 for r in history._rows(select(c.line_sha256).where(c.machine_id == history._machine(machine)))}
    missing = [row for row in rows if row["line_sha256"] not in there]
    if missing:
        with history._writing() as connection:
            for row in missing:
                content = _chain.content_of_compensation(row)
                number, entry = history._linked(connection, machine, cell, "compensation", row["utc"], content)
                connection.execute(insert(t.compensation), {"entry_id": entry, "machine_id": number, **row})
    return len(missing)


def compensations(history: History, machine: str, since: str | None = None) -> tuple[Compensation, ...]:
    """history, machine, from which moment (UTC) on → what happened to its compensations, newest first."""
    c = t.compensation.c
    wanted = select(*(c[name] for name in _COLUMNS)).where(c.machine_id == history._machine(machine))
    if since is not None:
        wanted = wanted.where(c.utc >= since)
    return tuple(Compensation(*tuple(row)) for row in history._rows(wanted.order_by(c.utc.desc(), c.entry_id.desc())))


def _row(event: Mapping[str, Any]) -> dict[str, Any]:
    if event.get("event") not in EVENTS:
        raise InputError(f"history: found the event {event.get('event')!r} of a compensation; allowed: {', '.join(EVENTS)}")
    promise = (event.get("promise") or {}) if event["event"] == "proposed" else {}
    try:
        line = _chain.canonical(event)
        row = {
            "number": int(event["compensation"]),
            **{name: str(event[name]) for name in ("target", "event", "utc")},
            "text": str(event.get("text", "")),
            "before_um": event.get("before_um", (promise.get("rms_before_um") or {}).get("value")),
            "promised_um": event.get("promised_um", (promise.get("rms_after_um") or {}).get("value")),
            "measured_um": event.get("measured_um"),
        }
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"history: found {event!r} ({error}); allowed: utc, compensation, target, and finite numbers") from None
    return {**row, "line": line, "line_sha256": _chain.sha256(line)}
