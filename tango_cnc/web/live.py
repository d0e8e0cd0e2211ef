"""The journal of a run → what the page of the run shows while it goes on: progress, deviations, drift, what is still to come."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from starlette.concurrency import run_in_threadpool

from ..files.checked import read_text
from ..files.readjson import parse_json
from ..link.entries import Entry, ProgramSent, Reading, RefusedRecord, by_no_machine
from ..link.journal import ReadSoFar, read_on
from ..link.lock import at_work
from ..link.progress import QUIET, in_minutes, progress
from ..records import Cell, InputError
from ..report.days import at
from ..report.texts import Texts

T = TypeVar("T")


@dataclass(frozen=True)
class LiveRun:
    """One run as its journal has it at this moment."""

    file: Path
    version: str  # changes with every entry
    state: str  # waiting, running, complete, stopped
    why: str
    started: str  # UTC, when the first program went out
    head: ProgramSent | None  # the last program that went out
    total: int
    readings: tuple[Reading, ...]
    refused: tuple[str, ...]
    left: Mapping[str, int]  # facet: touches still to come
    seconds: float  # since the start mark, of the last entry
    remaining: float | None  # s, at the pace so far
    touched: float = 0.0  # time of its last entry, s since 1970
    simulated: bool = False  # its touches are made by no machine


@dataclass
class Journals:
    """Journals that were read, by file: one that has not grown is not read again, of one that has only what is new."""

    _read: dict[Path, tuple[tuple[int, int], ReadSoFar, LiveRun]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self, file: Path, cell: Cell | None) -> LiveRun | None:
        """journal, its cell → the run, None when there is none. Raises InputError for a damaged journal."""
        try:
            stat = file.stat()
        except OSError:
            return None
        key = (stat.st_size, stat.st_mtime_ns)
        with self._lock:
            known = self._read.get(file)
            if known is not None and known[0] == key:
                return known[2]
            found = read_on(file, None if known is None else known[1])
            run = replace(run_of(file, f"{found.size:x}", found.entries, cell), touched=stat.st_mtime)
            self._read[file] = (key, found, run)
            if len(self._read) > 200:
                self._read.pop(next(iter(self._read)))
            return run


@dataclass
class Looks:
    """One look at the disk for all who ask for the same while it lasts: fifty followers cost little more than one."""

    _going: dict[Hashable, asyncio.Future[Any]] = field(default_factory=dict)

    async def at(self, key: Hashable, look: Callable[[], T]) -> T:
        """what is asked for, how to look → what was seen, by this look or by one that had begun. Raises what the look raises."""
        going = self._going.get(key)
        if going is None:
            going = self._going[key] = asyncio.ensure_future(run_in_threadpool(look))
            going.add_done_callback(lambda _: self._going.pop(key, None))
        found: T = await asyncio.shield(going)  # who goes away does not take it from the others
        return found


def called(file: Path) -> str:
    """journal → its name in a list; that of a night has the stamp of its night."""
    return f"{file.parent.name} {file.name}" if file.parent.parent.name == "nights" else file.name


def touched_by(file: Path, cell: Cell | str) -> Cell | None:
    """journal, the cell it lies in or why that cannot be read → the cell whose plan its touches are of; None for another plan."""
    if isinstance(cell, str):
        return None
    if file.parent.parent.name != "nights":
        return cell
    try:
        asked = parse_json(read_text(file.parent / "planned.json"))
        return cell if asked["kind"] == "full" else None
    except (InputError, OSError, ValueError, KeyError, TypeError):
        return None


def run_of(file: Path, version: str, entries: Sequence[Entry], cell: Cell | None) -> LiveRun:
    """journal, its entries, its cell → the run."""
    p, sent = progress(entries), [e for e in entries if isinstance(e, ProgramSent)]
    facets = _facets(cell)
    left = Counter(facets[n] for n in p.wanted if n not in p.done and n in facets)
    readings = tuple(e for e in entries if isinstance(e, Reading))
    refused = tuple(f"{e.record!r}: {e.why}" for e in entries if isinstance(e, RefusedRecord))[-5:]
    head, started = (sent[-1], sent[0].utc) if sent else (None, "")
    made = any(by_no_machine(s) for s in sent)
    counts = (len(p.wanted), readings, refused, dict(left), p.seconds, p.remaining)
    return LiveRun(file, version, p.state, p.why, started, head, *counts, simulated=made)


def minutes_left(run: LiveRun | None, now: float) -> int | None:
    """run, time (s) → minutes that it still takes, 0 where it has only begun; None where none goes on, or nothing was heard of it
    for `QUIET`.
    """
    if run is None or run.state != "running" or quiet(run, now) is not None:
        return None
    return in_minutes(run.remaining)


def quiet(run: LiveRun, now: float) -> int | None:
    """run, time (s) → minutes since its last entry where that is too long ago for a run that goes on, or nobody is at work in its
    cell any more: its program was killed; else None.
    """
    since = now - run.touched
    return max(1, round(since / 60)) if run.state == "running" and (since > QUIET or broken(run)) else None


def broken(run: LiveRun) -> bool:
    """run → whether it has no end although nobody is at work in its cell any more: the program that recorded it was killed."""
    place = run.file.parent
    cell = place.parent.parent if place.parent.name == "nights" else place
    return run.state in ("running", "waiting") and not at_work(cell)


def _facets(cell: Cell | None) -> dict[int, str]:
    if cell is None:
        return {}
    every = (facet for i in cell.strategy.indexations for facet in i.facets)
    return dict(enumerate(every, 1))


def title(run: LiveRun, t: Texts) -> str:
    """run, texts → when it began, as people say it; the name of its file where that is not known."""
    return at(run.started, t) if run.started else run.file.name
