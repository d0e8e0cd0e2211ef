"""The journals of a cell → whether a run or a night is at work there, and how long it still takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..records import TangoError
from .entries import Again, End, Entry, ProgramSent, Reading, RefusedRecord, StartMark, by_no_machine
from .journal import read_on
from .lock import JOURNAL, at_work, begun, newest_run

PACED = 5  # touches since the start from which a pace is known: before the first one probe and path are proven
LOOKED = 10  # runs that are looked through for a complete one
QUIET = 600.0  # s without an entry after which a run is no longer said to go on


@dataclass(frozen=True)
class Progress:
    """How far a run has come."""

    state: str  # waiting, running, complete, stopped
    why: str
    wanted: tuple[int, ...]  # touches
    done: frozenset[int]
    seconds: float  # since the start mark, of the last entry
    remaining: float | None  # s, at the pace so far, before PACED touches by the plan; None where it does not run, or has no plan

    def minutes_left(self, since: float) -> int | None:
        """s since its last entry → minutes that it still takes, 0 where it has only begun; None where nothing runs, or was heard of
        it for `QUIET`.
        """
        return None if self.state != "running" or since > QUIET else in_minutes(self.remaining)


def in_minutes(remaining: float | None) -> int:
    """s that a run still takes, None where nobody knows its pace → minutes, at least one; 0 for None."""
    return 0 if remaining is None else max(1, math.ceil(remaining / 60))


def journals(folder: Path) -> list[Path]:
    """cell → its journals: of the last run and of a night at work (or cut off), the newest first, then those set aside."""
    present = [newest_run(folder), *(folder / "nights" / stamp / JOURNAL for stamp in begun(folder))]
    there = sorted((f for f in present if f.is_file()), key=lambda f: f.stat().st_mtime, reverse=True)
    return [*there, *sorted(folder.glob("readings.*.journal"), reverse=True)]


def progress(entries: Sequence[Entry]) -> Progress:
    """entries of a journal → how far its run has come."""
    sent = [e for e in entries if isinstance(e, ProgramSent)]
    done = frozenset(e.touch for e in entries if isinstance(e, Reading))
    wanted = tuple(dict.fromkeys(n for s in sent for n in s.touches))
    last = entries[-1] if entries else None
    part = sent[-1].part if sent else (1, 1)
    state, why = ("running", "") if any(isinstance(e, StartMark) for e in entries) else ("waiting", "")
    if isinstance(last, End) and not (last.complete and part[0] < part[1]):
        state, why = ("complete" if last.complete else "stopped"), last.why
    seconds = max((e.time_s for e in entries if isinstance(e, StartMark | Reading | Again | RefusedRecord)), default=0.0)
    pace = _pace(entries) or _expected(sent)
    remaining = pace * (len(wanted) - len(done)) if pace is not None and state == "running" else None
    return Progress(state, why, wanted, done, seconds, remaining)


def run_by_day(folder: Path) -> tuple[str, float, bool] | None:
    """cell → when its newest complete run outside the nights began (UTC) and ended (s since 1970), whether no machine was measured
    by it; None where its last `LOOKED` journals have none, or none can be read.
    """
    for file in journals(folder)[:LOOKED]:
        with suppress(TangoError, OSError):
            entries = read_on(file).entries if file.parent == folder else []
            sent = [e for e in entries if isinstance(e, ProgramSent)]
            if sent and progress(entries).state == "complete":
                return sent[0].utc, file.stat().st_mtime, any(by_no_machine(e) for e in sent)
    return None


def newest_complete(folder: Path) -> str:
    """cell → when its newest complete run began (UTC); '' where its last `LOOKED` runs have none, or none can be read."""
    for file in journals(folder)[:LOOKED]:
        with suppress(TangoError, OSError):
            entries = read_on(file).entries
            if progress(entries).state == "complete":
                return next((e.utc for e in entries if isinstance(e, ProgramSent)), "")
    return ""


def minutes_left(folder: Path, now: float) -> int | None:
    """cell, time (s since 1970) → minutes that its run or its night still takes, 0 where that is not known yet; None where none is
    at work.

    A journal that cannot be read says nothing of a run that goes on: the page of the run, and whoever resumes it, name the damage.
    """
    if not at_work(folder):
        return None
    with suppress(TangoError, OSError):
        for file in journals(folder)[:1]:
            since = now - file.stat().st_mtime
            return None if since > QUIET else progress(read_on(file).entries).minutes_left(since)
    return None


def _expected(sent: Sequence[ProgramSent]) -> float | None:
    """programs sent of a run → s a touch by the plan of the last one; None where its journal does not say it."""
    last = sent[-1] if sent else None
    return last.expected_s / len(last.touches) if last is not None and last.expected_s and last.touches else None


def _pace(entries: Sequence[Entry]) -> float | None:
    """entries of a journal → s a touch since the last start mark (what was made before an interruption has another clock), and of
    few touches since then s a touch before it; None where neither is known.
    """
    last = max((i for i, e in enumerate(entries) if isinstance(e, StartMark)), default=0)
    for part in (entries[last:], entries):
        times = [e.time_s for e in part if isinstance(e, Reading)]
        if len(times) >= PACED and times[-1] > times[0]:
            return (times[-1] - times[0]) / (len(times) - 1)
    return None
