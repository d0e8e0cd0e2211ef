"""Nights of the simulated trunnion with people who answer its alarms: what was decided after which night."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from support.nights_parts import Story, nights
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import Decision, History, opened
from tango_cnc.report.faults import unclosed

UNTIL = "2026-12-24"
Answer = str | Callable[[History, Mapping[str, Any]], None]


def answered(
    root: Path,
    file: Path,
    story: Story,
    count: int,
    answers: Mapping[int, Answer],
    seed: int = 3,
    example: str = "trunnion",
    **settings: Any,
) -> list[dict[str, Any]]:
    """repository, file of the history, story, nights, {night: what is decided after it about all open alarms} → records."""
    folder, found = root / "examples" / example, []
    cell, truth = read_cell(folder), read_world(folder / "world.yaml")
    with opened(file) as history:
        for number, (record, _) in enumerate(
            nights(cell, truth, history, count, seed, story, Nightly(diagnose=False, **settings)), 1
        ):
            found.append(record)
            answer = answers.get(number)
            if callable(answer):
                answer(history, record)
            elif answer:
                for alarm in history.open_alarms(cell.machine.name):
                    decide(history, record, alarm["id"], answer)
        assert history.verify() == ()
    return found


def decide(history: History, record: Mapping[str, Any], alarm: str, action: str) -> None:
    """history, record of the last night, alarm, action → decided on the morning after it."""
    until = UNTIL if action == "ignore" else None
    history.decide(record["machine"], Decision(alarm, action, "Ann", "", until, record["end_utc"]))


def accept_stylus(history: History, record: Mapping[str, Any]) -> None:
    """history, record of the last night → its alarm of the stylus is accepted, and no other one."""
    (own,) = [a["id"] for a in record["alarms"] if a["cause"] == "stylus"]
    decide(history, record, own, "accept")


def open_and_decided(file: Path, today: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    with opened(file) as history:
        return unclosed(history, "trunnion", today)
