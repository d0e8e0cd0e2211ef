"""The whole history of a machine once more, by the model of today: night after night from the readings that were kept.

The history itself stays as it is; what comes out is another one. Every night is a commit, so what was cut off goes on where it was.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..files import read_cell, read_readings_text
from ..files.nightly import history_of, read_nightly
from ..history import Stored, opened
from ..nightly import Measured, Ports, PreflightPoint, night
from ..plan import plan
from ..records import InputError
from ._cell_nights import as_of, nights_of
from ._simulated_nights import Folder, Nobody, Time

Mapper = Callable[[Callable[[int], Any], Iterable[int]], Iterable[Any]]


@dataclass(frozen=True)
class Redone:
    """A machine whose history was estimated again: nights with readings, how many of them now, verdicts that differ, alarms."""

    machine: str
    nights: int
    added: int
    differ: int
    alarms_then: int
    alarms_now: int


@dataclass(frozen=True)
class _Kept:
    """A night as it was: analysis and control in one, with its own kind and touches instead of a choice."""

    stored: Stored
    analysis: Any
    measured: Measured

    def choice(self, past: Any, day: float) -> tuple[str, str, tuple[int, ...]]:
        """→ what was measured then."""
        return self.stored.night.kind, "as it was measured", self.measured.asked

    def analysed(self, past: Any, day: float, kind: str, measured: Measured) -> Any:
        """→ what the readings say today. Raises TangoError."""
        return self.analysis.analysed(past, day, kind, measured)

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """→ nothing is asked of a machine."""
        return (PreflightPoint("again", True, f"readings of entry {self.stored.night.entry}"),)

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """→ the readings that there are."""
        return self.measured


@dataclass(frozen=True)
class Again:
    """What every worker does: one cell after another, into a folder that all of them can write to."""

    cells: tuple[Path, ...]
    where: str | None
    target: Path
    files: tuple[str, ...]  # of the cells, in `target`
    most: int | None = None  # nights a machine, of one call

    def __call__(self, number: int) -> Redone:
        """number of a cell → its history once more. Raises InputError, LinkError."""
        folder = self.cells[number]
        cell, settings = read_cell(folder), read_nightly(folder)
        quiet = replace(settings, diagnose=False, free_mb=0.0, every_days=1e6, notify=())
        analysis = replace(nights_of(cell, replace(quiet, every_days=settings.every_days), plan(cell)), written=None)
        name = cell.machine.name
        file = self.target / self.files[number]
        with opened(history_of(folder, settings, self.where), create=False) as before, opened(file) as after:
            if name not in before.machines():
                return Redone(name, 0, 0, 0, 0, 0)
            there = {n.start_utc for n in after.nights(name)} if name in after.machines() else set()
            old = sorted((n for n in before.nights(name) if n.touches), key=lambda n: (n.start_utc, n.entry))
            todo = [n for n in old if n.start_utc not in there][: self.most]
            for one in todo:
                stored = before.night(one.entry)
                if stored.readings is None:
                    continue
                analysis = as_of(analysis, one.start_utc)
                kept = _Kept(stored, analysis, _measured(cell, stored, analysis.check is None))
                world = Ports(
                    Time(datetime.fromisoformat(one.start_utc).astimezone()),
                    *(Folder(lambda stamp, name, text: None), kept, Nobody(), after, kept, nullcontext()),
                )
                night(name, stored.record["cell"], quiet, world)
            now = {n.start_utc: n for n in after.nights(name)} if name in after.machines() else {}
        both = [(n, now[n.start_utc]) for n in old if n.start_utc in now]
        then, today = sum(a.alarms for a, _ in both), sum(b.alarms for _, b in both)
        return Redone(name, len(old), len(todo), sum(a.verdict != b.verdict for a, b in both), then, today)


def _measured(cell: Any, stored: Stored, chosen: bool) -> Measured:
    readings, record = read_readings_text(str(stored.readings), cell.machine, cell.artefact), stored.record
    numbers = tuple(int(n) for n in np.unique(readings.touch)) if chosen and stored.night.kind == "check" else ()
    why = record["why"] if stored.night.status == "partial" else ""
    strange = {name: s["said"] for name, s in (record.get("sensors") or {}).items() if "said" in s}
    planned = int(record.get("planned") or len(readings))
    return Measured(readings, stored.readings, planned, record["machine_time_s"], why, asked=numbers, strange=strange)


def again(cells: Sequence[Path], where: str | None, target: Path, spread: Mapper, most: int | None = None) -> list[Redone]:
    """folders of cells, one history for all or None, folder of the new ones, `map` → a line a machine.

    Raises InputError for cells of one name, and for what no history or cell is; LinkError where a worker fails.
    """
    names = [read_cell(cell).machine.name for cell in cells]
    if twice := {n for n in names if names.count(n) > 1}:
        raise InputError(f"fleet: found two cells of the machine {sorted(twice)[0]!r}; allowed: one of them")
    target.mkdir(parents=True, exist_ok=True)
    own = tuple(cell.resolve() for cell in cells)
    return list(spread(Again(own, where, target.resolve(), files_of(names), most), range(len(own))))


def files_of(names: Sequence[str]) -> tuple[str, ...]:
    """names of machines → files of their own: what a name has beside plain signs is in a number behind it, and so is everything
    of names that some disks take for one.
    """
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "-", name) for name in names]
    folded = [p.casefold() for name, p in zip(names, plain, strict=True) if p == name]
    return tuple(
        f"{p}.db" if p == name and folded.count(p.casefold()) == 1 else f"{p}-{hashlib.sha256(name.encode()).hexdigest()[:8]}.db"
        for name, p in zip(names, plain, strict=True)
    )
