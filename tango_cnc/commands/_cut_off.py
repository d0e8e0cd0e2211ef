"""Nights that were cut off: the journal of their run becomes readings, before the next night puts them on record."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from ..files import readings_text, write_text
from ..files.readjson import parse_json
from ..link import lock
from ..link.entries import Entry, ProgramSent
from ..link.journal import look_at, salvaged
from ..link.measure import silence_after
from ..link.process import endings
from ..link.readings import provenance, readings_of
from ..link.rest import durations
from ..plan import plan_hash
from ..records import LinkError, Plan, TangoError
from ..texts import say

PLANNED = "planned.json"  # what the run of a night was to touch
JOURNAL = "readings.journal"
STAMP = "%Y-%m-%dT%H%M%SZ"
LONGER = 1.5  # times its predicted time that a program is taken to last at most, with the wait for its start
KEPT = ("readings.csv", "readings.partial.csv")
READING = b'"kind":"reading"'  # of a journal in which a touch is
LOOKED = 30  # nights looked back over


def note_planned(folder: Path, kind: str, touches: Sequence[int]) -> None:
    """folder of a night, its kind, touches of the strategy (empty: all) → on disk, for the night that finds it cut off."""
    write_text(folder / PLANNED, json.dumps({"kind": kind, "touches": list(touches)}) + "\n")


def newest_run(folder: Path, stamp: str) -> tuple[str, tuple[Entry, ...]]:
    """cell, stamp of tonight → stamp of the last run before that has a journal, and what can be read of it; ("", ()) for none.

    That of a night is the stamp of its night; that of `tango run` is when its last program went out. One that broke off may still
    be executed by a control that nobody can ask, whoever ended it.
    """
    found = [(f.parent.name, f.stat().st_mtime, f) for f in (folder / "nights").glob("*/*.journal")]
    runs = [(night, _read(f)) for night, _, f in sorted(found) if night < stamp][-1:]
    own = _read(lock.newest_run(folder))
    begun = [f"{datetime.fromisoformat(e.utc).astimezone(UTC):{STAMP}}" for e in own if isinstance(e, ProgramSent)]
    runs += [(moment, own) for moment in begun[-1:] if moment < stamp]
    return max(runs, key=lambda run: run[0], default=("", ()))


def _read(journal: Path) -> tuple[Entry, ...]:
    """journal → what can be read of it; () where nothing can."""
    with suppress(TangoError, OSError, ValueError):
        return tuple(salvaged(look_at(journal))[0])
    return ()


def executed_until(folder: Path, stamp: str, whole: Plan) -> datetime | None:
    """cell, stamp of tonight, plan of all touches → until when at the latest a control may execute the program of the last run
    before; None where it came to its end, or none was.

    It began after its stamp, and waited for its start no longer than a run does.
    """
    began, entries = newest_run(folder, stamp)
    if not silence_after(entries, whole):
        return None
    try:
        moment = datetime.strptime(began[:18], STAMP).replace(tzinfo=UTC)
    except ValueError:
        return None
    return moment + timedelta(seconds=LONGER * sum(durations(whole).values()))


def keep_readings(folder: Path, planned: Callable[[str, Sequence[int]], Plan]) -> tuple[str, ...]:
    """cell, (kind, touches) → plan of a night → readings.partial.csv beside the journal of every night that was cut off, or whose
    readings the disk refused; a sentence on each that it refuses again.

    A journal that no plan of the cell fits stays as it is, and so does one that cannot be read: a night is not held up by it.
    """
    refused = []
    for stamp in _without_readings(folder):
        night = folder / "nights" / stamp
        try:
            if READING not in (night / JOURNAL).read_bytes():
                continue
            asked = parse_json((night / PLANNED).read_text(encoding="utf-8"))
            found = from_journal(night, planned(str(asked["kind"]), [int(number) for number in asked["touches"]]))
        except (TangoError, OSError, ValueError, KeyError, TypeError):
            continue
        try:
            if found is not None:
                write_text(night / KEPT[1], found[0])
        except OSError as error:
            name = f"nights/{stamp}/{KEPT[1]}"
            refused.append(say("night.night.not_written", name=name, why=error.strerror or error))
    return tuple(refused)


def _without_readings(folder: Path) -> list[str]:
    """cell → stamps of nights that have a journal and no readings, while nobody is at work there; of those on record the newest."""
    if lock.at_work(folder):
        return []
    newest = sorted(f.parent.name for f in (folder / "nights").glob(f"*/{JOURNAL}"))[-LOOKED:]
    nights = {stamp: folder / "nights" / stamp for stamp in sorted({*lock.cut_off(folder), *newest})}
    return [stamp for stamp, f in nights.items() if (f / JOURNAL).is_file() and not any((f / name).exists() for name in KEPT)]


def from_journal(night: Path, made: Plan) -> tuple[str, dict[str, Any]] | None:
    """folder of a night, plan of its run → text of the readings in its journal, where they come from (`missing`: touches that are
    not there); None where it has none of this plan.

    Raises TangoError, OSError for a journal that cannot be read.
    """
    entries, _ = salvaged(look_at(night / JOURNAL))
    runs = {entry.plan_hash for entry in entries if isinstance(entry, ProgramSent)}
    if runs != {plan_hash(made)} or (readings := readings_of(entries, made)) is None:
        return None
    return readings_text(readings), provenance(entries, made)


@contextmanager
def told_of_signals() -> Iterator[Callable[[], None]]:
    """→ what asks a program to end (SIGTERM, SIGHUP) is an error as others until the block ends, or until what is yielded is
    called: then it does nothing.

    A run notices them by itself between two bytes. Before the first touch and while readings are evaluated nothing else does, and
    the night ended without a record and without a message.
    """
    ends = endings()
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return

    def stop(number: int, frame: object) -> None:
        raise LinkError(say("night.night.ended_from_outside"))

    def ignored() -> None:
        for number in ends:
            signal.signal(number, signal.SIG_IGN)

    before = {number: signal.signal(number, stop) for number in ends}
    try:
        yield ignored
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
