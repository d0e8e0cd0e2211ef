"""Whether parts may be made on a machine, for commands, as its page has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..link.progress import run_by_day
from ..records import Machine
from ..report.answer import Answer, by_newer
from ..report.newer import NewerAnswer, has_no_report
from ..report.texts import Texts
from ..report.units import Units
from ..texts import unstopped

if TYPE_CHECKING:
    from ..history import History


def answer_now(folder: Path, axes: Machine, place: str | Path, newer: NewerAnswer | None, t: Texts) -> Answer | None:
    """cell, its machine, its history, answer of readings after the newest night, texts → the answer of its page; None without a
    night.

    Raises TangoError.
    """
    from .report import nights  # loads what estimates

    u = Units()
    found = None if isinstance(place, Path) and not place.exists() else nights(folder, axes, u, t, where=place)
    if found is None:
        return None
    told = found.answer(u, t, axes)
    return told if newer is None else by_newer(told, newer, u, t, axes, found.before or found.record)


def run_without_report(folder: Path, record: Mapping[str, Any]) -> str:
    """cell, record of its newest night → when a newer complete run of it began (UTC) without a report; '' for none."""
    run = run_by_day(folder)
    return "" if run is None or not has_no_report(folder, *run, record) else run[0]


def in_short(told: Answer) -> Sequence[str]:
    """answer → its numbers, and what newer readings have otherwise than the night or say beside it, as parts of a line."""
    return [unstopped(x) for x in (told.numbers, told.moved, told.beside) if x]


def unanswered(history: History, machine: str, axes: Machine | None, before: Mapping[str, Any] | None, t: Texts) -> int:
    """history, machine with a night, its chain of axes, record of the last night that measured where the newest did not, texts →
    alarms without an answer as its page counts them: what is one cause counts once.
    """
    from ..history import compensations
    from ..report.faults import earlier, faults, still_open, unclosed

    today = datetime.now().astimezone().strftime("%Y-%m-%d")
    record = history.night(history.nights(machine, last=1)[0].entry).record
    alarms, decisions = unclosed(history, machine, today)
    happened = compensations(history, machine)
    found = faults(record, earlier(alarms), decisions, Units(), t, axes, before, today, happened)
    return sum(a["decision"] is None for a in still_open(found))
