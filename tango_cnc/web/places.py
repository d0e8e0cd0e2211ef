"""Cells and histories → the machines that are shown, with what is known of each; kept for a few seconds."""

from __future__ import annotations

import os
import threading
import time
import zlib
from collections.abc import Callable, Container, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

from ..files import read_cell
from ..files.nightly import Nightly, history_of, read_nightly
from ..history import History, Night, Standing, UnreadableError, opened, refused
from ..history.clock import in_future
from ..history.clock import told as told_of
from ..history.former import formers, of_folder
from ..link.lock import broken_off, cut_off, ended
from ..records import Cell, InputError, Machine, TangoError
from ..report.age import due, nights_old
from ..report.answer import said_broken_off, said_cut_off
from ..report.signs import of_night
from ..report.suspects import as_limited
from .away import Away, kind_of, look, why_of
from .newest import NewestRecords
from .remembered import AGAIN, SELDOM, STATED, Remembered, Stamp, file_of, looks_of
from .served import Row, Served, slug_of
from .settings import Settings

LOOKED = 1.0  # s that the files of a cell are not looked at again
FEW = 20  # machines whose nights are read one by one where only theirs have changed
CELL = ("tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml")
AT_ONCE = 64  # servers with a history that are asked at the same time
AWAY = 15.0  # s that a history that does not answer is not asked again
PATIENCE = 5.0  # s for which a page waits for a database that takes the connection and is silent
STRIP = 30  # nights of the strip beside a machine


class Places(Remembered):
    """All machines of a server."""

    def __init__(self, settings: Settings, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(clock)
        self.settings, self._stack = settings, ExitStack()
        self._histories: dict[str, History] = {}
        self._files: dict[str, tuple[int, int] | None] = {}  # by history: which file is open
        self._replaced: list[History] = []  # what is read of a history is kept by its id, which no other may get
        self._read: dict[int, dict[int, Mapping[str, Any]]] = {}  # records of the list of machines, by entry
        self._nights: dict[int, tuple[dict[str, Any], dict[str, list[Night]]]] = {}  # by history: entries, nights
        self._unsure: dict[int, dict[int, bool]] = {}  # by history and entry: whether nobody knows if it is within a limit
        self._cells: dict[Path, tuple[float, Stamp, Cell | str]] = {}
        self._off: dict[str, Away] = {}  # histories that do not answer
        self._asking: set[str] = set()  # of these, those that a thread asks
        self._listed: tuple[str, ...] = ()  # machines of the history of all, when it was last read
        self._newest: dict[int, dict[str, tuple[object, tuple[Any, ...]]]] = {}  # by history: newest records
        self._nightlies: dict[Path, tuple[float, Nightly | TangoError]] = {}

    def close(self) -> None:
        """Lets go of the databases."""
        self._stack.close()

    def nightly(self, folder: Path) -> Nightly:
        """folder → its nightly.yaml; read again when it has changed. Raises TangoError for one that cannot be read."""
        try:
            stamp = (folder / "nightly.yaml").stat().st_mtime
        except OSError:
            stamp = 0.0
        known = self._nightlies.get(folder)
        if known is None or known[0] != stamp:
            try:
                known = stamp, read_nightly(folder)
            except TangoError as error:
                known = stamp, error
            self._nightlies[folder] = known
        if isinstance(known[1], TangoError):
            raise known[1].with_traceback(None)  # one that is raised again would keep all its ways
        return known[1]

    def machines(self) -> Mapping[str, Served]:
        """→ {slug: machine}, those of the cells first, then those that only the history knows."""
        return self.kept("machines", self._machines)

    def expected(self) -> int:
        """→ how many machines there will be about, before any of them is read: cells, or names in the history of all."""
        cells = len(self.settings.find() if self.settings.find else self.settings.cells)
        try:
            shared = self._history(self.settings.history) if self.settings.history else None
            return max(cells, 0 if shared is None else len(shared.machines()))
        except TangoError:  # the pages say why it cannot be read
            return cells

    def _machines(self) -> dict[str, Served]:
        where = self.settings.history
        shared, off = self._reached(where) if where else (None, None)
        found: dict[str, Served] = {}
        folders = self.settings.find() if self.settings.find else self.settings.cells
        reached = {} if where else self._of_cells(folders)
        for folder in folders:
            cell = self.cell(folder)
            name = cell.machine.name if isinstance(cell, Cell) else folder.name
            own, why = (shared, off) if where else reached[folder]
            slug = slug_of(name)
            if slug in found:
                slug = slug_of(f"{name} {folder.name}")
            found[slug] = Served(slug, name, folder, own, cell if isinstance(cell, str) else why_of(why), kind_of(why))
        if shared is not None:
            self._listed = shared.machines()
        for name in self._listed:
            found.setdefault(slug_of(name), Served(slug_of(name), name, None, shared, why_of(off), kind_of(off)))
        if off is not None and not found:
            raise UnreadableError(off.why.removeprefix("history: "), None)
        return self._with_former(found)

    def _with_former(self, found: dict[str, Served]) -> dict[str, Served]:
        """machines by slug → the same with what cells have under other names, and these names where their alarms are not closed."""
        names, more = {m.name for m in found.values() if m.folder is not None}, dict[str, Served]()
        histories = {id(m.history): m.history for m in found.values() if m.history is not None}
        ahead = {(key, n.machine) for key, h in histories.items() for n in self._ahead(h)}
        for slug, m in list(found.items()):
            dated = m.history is not None and (id(m.history), m.name) in ahead
            if dated and m.history is not None and (future := in_future(m.history, m.name)) is not None:
                m = found[slug] = replace(m, former=(told_of(future),))
            if m.folder is not None and (cut := cut_off(m.folder)):
                m = found[slug] = replace(m, former=(*m.former, *said_cut_off(cut, ended(m.folder, cut))))
            if m.folder is not None and (off := said_broken_off(broken_off(m.folder))):
                m = found[slug] = replace(m, former=(*m.former, *off))
            if m.folder is None or m.history is None or not isinstance(self.cell(m.folder), Cell):
                continue
            every = self.asked(m.history, "machines", m.history.machines, SELDOM)
            new = m.name not in every
            if self.settings.history and not new:  # every name of a history that all share is in the list by itself
                continue
            if every == (m.name,):
                continue
            within = not self.settings.history and self._within(m.folder)
            asked = f"formers {m.name} {within} {zlib.crc32(repr(sorted(names)).encode())} {today()}"
            read = NewestRecords(m.history, self.heads(m.history), self._newest.setdefault(id(m.history), {}))
            known = self.asked(m.history, asked, partial(formers, read, m.name, m.folder, within, names), SELDOM)
            told = tuple(f.told(m.name, new) for f in known if f.alarms or f.held or new)
            found[slug] = replace(m, former=(*m.former, *told))
            more |= {
                slug_of(f.machine): Served(slug_of(f.machine), f.machine, None, m.history) for f in known if f.alarms or f.held
            }
        return {**more, **found}

    def _ahead(self, history: History) -> tuple[Night, ...]:
        """history → nights that the clock dates in the future; where there was none the file has to change for one."""
        found = self.asked(history, "ahead", history.ahead, SELDOM)
        return self.asked(history, "ahead now", history.ahead) if found else found

    def _within(self, folder: Path) -> bool:
        """folder of a cell → whether its history is a file in it."""
        try:
            return of_folder(history_of(folder, self.nightly(folder)), folder)
        except TangoError:
            return True

    def geometry(self, machine: Served) -> Machine | None:
        """machine → its chain of axes, None where its cell is not on this computer or cannot be read."""
        cell = None if machine.folder is None else self.cell(machine.folder)
        return cell.machine if isinstance(cell, Cell) else None

    def late(self, machine: Served) -> str:
        """machine → date of its last complete night where that is too long ago; empty where it is not."""
        nights = self.nights(machine, STRIP)
        if not nights:
            return ""
        complete = next((n for n in nights if n.status == "complete"), None)
        limit = datetime.now(UTC) - timedelta(hours=self.settings.late_hours)
        if complete is not None and datetime.fromisoformat(complete.start_utc) >= limit:
            return ""
        return complete.night if complete is not None else nights[-1].night

    def owner(self, machine: Served) -> str:
        """machine → who is asked about its alarms by nightly.yaml of its cell; empty where nobody is stated."""
        return self.stated(machine).owner

    def deputy(self, machine: Served) -> str:
        """machine → who is asked where its owner does not answer, by nightly.yaml of its cell; empty where nobody is stated."""
        return self.stated(machine).deputy

    def limits_for(self, machine: Served) -> str:
        """machine → what its limits are for and who has stated them, by nightly.yaml of its cell; '' where that is not stated."""
        return self.stated(machine).limits_for

    def old(self, machine: Served, measured: str) -> int:
        """machine, date of its last measurement → nights since then, where these are too many for an answer of today; else 0."""
        return nights_old(measured, self.due(machine), self.stated(machine).answers_for)

    def due(self, machine: Served) -> str:
        """machine → date of the newest night that has begun by the clock of its nights, whether or not it measured."""
        last = next((n for n in self.nights(machine, STRIP) if n.verdict != "not_measured"), None)
        return due(datetime.now(UTC), "" if last is None else last.start_utc)

    def stated(self, machine: Served) -> Nightly:
        """machine → nightly.yaml of its cell; what holds without one where it has none, or one that cannot be read."""
        folder, usual = machine.folder, Nightly(late_hours=self.settings.late_hours)

        def read() -> Nightly:
            try:
                return usual if folder is None else self.nightly(folder)
            except TangoError:  # the night itself tells what is wrong with the file
                return usual

        return self.kept(f"{STATED}{machine.slug}", read, 60)

    def cell(self, folder: Path) -> Cell | str:
        """folder → its cell, or why it cannot be read; read again when its files have changed."""
        known, now = self._cells.get(folder), self.clock()
        if known is not None and 0 <= now - known[0] < LOOKED:
            return known[2]
        stamp = tuple(number for name in CELL for number in looks_of(f"{folder}{os.sep}{name}"))
        if known is not None and known[1] == stamp:
            self._cells[folder] = (now, stamp, known[2])
            return known[2]
        try:
            cell: Cell | str = read_cell(folder)
        except TangoError as error:
            cell = str(error)
        self._cells[folder] = (now, stamp, cell)
        return cell

    def _of_cells(self, folders: Sequence[Path]) -> dict[Path, tuple[History | None, Away | None]]:
        """folders → the history that each nightly.yaml names, None where it has none; why it cannot be read, where that is so.
        Servers are asked all at once: ten that are silent hold a page no longer than one.
        """
        named = {folder: self._named(folder) for folder in folders}
        each = dict.fromkeys(named.values())
        with ThreadPoolExecutor(AT_ONCE) as threads:  # starts no more of them than there are servers
            asked = {where: threads.submit(self._reached, where, False) for where in each if "://" in where}
            found = {where: asked[where].result() if where in asked else self._reached(where, must=False) for where in each}
        return {folder: found[where] for folder, where in named.items()}

    def _named(self, folder: Path) -> str:
        """folder → file or URL of the history that its nightly.yaml names."""
        try:
            settings = self.nightly(folder)
        except TangoError:  # the night itself tells what is wrong with the file
            settings = Nightly()
        return str(history_of(folder, settings))

    def _reached(self, where: str, must: bool = True) -> tuple[History | None, Away | None]:
        """file or URL of a history, whether it has to be there → the history (None: it does not answer, or nobody has begun it),
        and why it does not answer. The server asks one that does not answer again after a while, not at every look, and no page
        waits for a database a second time.
        """
        away = self._off.get(where)
        if away is not None and self.clock() < away.until and away.file == look(where):
            return None, away
        if away is not None and "://" in where:
            self._ask_beside(where)
            return None, away
        try:
            history = self._history(where, must)
            if history is not None and "://" in where:
                history.machines()  # a server that was open may have been switched off
        except TangoError as error:
            away = self._off[where] = self._away(where, error)
            return None, away
        self._off.pop(where, None)
        return history, None

    def _away(self, where: str, error: TangoError) -> Away:
        """file or URL of a history, what it has raised → that it does not answer from now on."""
        kind = "file" if "://" not in where else "settings" if isinstance(error, InputError) or refused(error) else "database"
        return Away(self.clock() + AWAY, str(error), look(where), kind)

    def _ask_beside(self, where: str) -> None:
        """URL of a history that did not answer → a thread asks it again, where none does yet; once it answers, pages read it."""
        with self._lock:
            if where in self._asking:
                return
            self._asking.add(where)

        def ask() -> None:
            try:
                with opened(where, create=False, patience=PATIENCE) as history:
                    history.machines()
                self._off.pop(where, None)
                self.forget()
            except TangoError as error:
                self._off[where] = self._away(where, error)
            finally:
                self._asking.discard(where)

        threading.Thread(target=ask, name="tango asks a history", daemon=True).start()

    def is_off(self, error: UnreadableError) -> bool:
        """what was raised while a page was made → whether one of the histories has just gone away: the next look at the machines
        goes on without it.
        """
        where = next((w for w, h in self._histories.items() if h.engine is error.engine), "")
        if not where:
            return False
        self._off[where] = self._away(where, error)
        self._histories[where].engine.dispose()  # its other connections are no better
        self.forget(self._histories[where])
        return True

    def _history(self, where: str, must: bool = True) -> History | None:
        known, file = self._histories.get(where), file_of(where)
        if known is not None and file in (None, self._files.get(where)):
            return known
        if not must and "://" not in where and not Path(where).exists():
            return None
        history = self._stack.enter_context(opened(where, create=False, patience=PATIENCE)).as_of(lambda: datetime.now(UTC))
        if known is not None:  # another file of this name: 'tango history restore', or a folder that was put back
            known.engine.dispose()
            self._replaced.append(known)
        self._histories[where], self.where[id(history)] = history, where
        self._files[where] = file
        return history

    def fleet(self) -> Sequence[Row]:
        """→ every machine with its last nights; those that need somebody first."""
        return self.kept("fleet", self._fleet)

    def _fleet(self) -> list[Row]:
        machines = self.machines()
        now = datetime.now(UTC).isoformat()
        standings: dict[tuple[int, str], Standing] = {}
        nights: dict[tuple[int, str], Sequence[Night]] = {}
        histories = {id(m.history): m.history for m in machines.values() if m.history is not None}
        for key, history in histories.items():
            own = self._standings(key, history, now)
            standings |= {(key, s.machine): s for s in own}
            nights |= {(key, name): listed for name, listed in self._last_nights(key, history, own).items()}
        records = {key: self._records(key, history, nights) for key, history in histories.items()}
        rows = []
        for m in machines.values():
            key, listed = id(m.history), tuple(nights.get((id(m.history), m.name), ()))
            known = records.get(key, {})
            wanted = (listed[0] if listed else None, measured_before(listed))
            last, before = (known.get(n.entry) if n is not None else None for n in wanted)
            rows.append(Row(m, standings.get((key, m.name)), listed, last, before))
        return sorted(rows, key=_urgent)

    def _standings(self, key: int, history: History, now: str) -> Sequence[Standing]:
        """history, moment → how its machines stand: asked where its file has changed, another day has begun, a machine has become
        late since, or the clock dates nights in the future.
        """
        hours = self.settings.late_hours
        limit = f"{datetime.fromisoformat(now) - timedelta(hours=hours):%Y-%m-%dT%H:%M:%SZ}"
        known = self._nights.get(key, ({}, {}))[1]
        complete = (next((n.start_utc for n in listed if n.status == "complete"), "") for listed in known.values())
        late = sum(start < limit for start in complete)
        again = AGAIN if self._ahead(history) else SELDOM
        return self.asked(history, f"fleet {hours} {today()} {late}", partial(history.fleet, now, hours), again)

    def _last_nights(self, key: int, history: History, own: Sequence[Standing]) -> Mapping[str, Sequence[Night]]:
        """history, how its machines stand → the nights of their strips; an entry never changes, so they are read once."""
        stamp = {s.machine: (s.nights, None if s.last is None else s.last.entry) for s in own}
        before, known = self._nights.get(key, ({}, {}))
        new = [name for name, counts in stamp.items() if before.get(name) != counts]
        if new or before.keys() != stamp.keys() or key not in self._nights:
            found: dict[str, list[Night]] = {name: listed for name, listed in known.items() if name in stamp and name not in new}
            if len(new) <= FEW:
                read = [night for name in new for night in history.nights(name, last=STRIP)]
            else:
                found, read = {}, list(history.nights(last=STRIP * max(len(own), 1)))
            for night in read:
                listed = found.setdefault(night.machine, [])
                if len(listed) < STRIP:
                    listed.append(night)
            self._nights[key] = stamp, found
        return self._nights[key][1]

    def _records(self, key: int, history: History, nights: Mapping[tuple[int, str], Sequence[Night]]) -> Mapping[int, Any]:
        """history, its nights → the records that the list of machines needs; an entry never changes, so none is read twice."""
        wanted = [n.entry for n in _of_records(nights, key)]
        known = self._read.get(key, {})
        new = history.records_of([entry for entry in wanted if entry not in known])
        self._read[key] = {
            entry: known[entry] if entry in known else new[entry] for entry in wanted if entry in known or entry in new
        }
        return self._read[key]

    def unsure(self, history: History | None, nights: Sequence[Night]) -> Container[int]:
        """history, nights → entries of those of which nobody knows whether they are within a limit; no entry changes, so none is
        asked about twice.
        """
        if history is None:
            return ()
        known = self._unsure.setdefault(id(history), {})
        new = [n.entry for n in nights if n.entry not in known and n.verdict in ("good", "changed")]
        found = history.unsure(new)
        known |= {entry: entry in found for entry in new}
        return frozenset(n.entry for n in nights if known.get(n.entry))

    def nights(self, machine: Served, last: int) -> tuple[Night, ...]:
        """machine, how many → its nights, newest first; none where it has no history."""
        if machine.history is None:
            return ()
        history, name = machine.history, machine.name
        return self.kept(
            f"nights {machine.slug} {last}", lambda: history.nights(name, last=last) if name in history.machines() else ()
        )


def sign_of(night: Night, unsure: Container[int]) -> str:
    """night, entries of nights of which nobody knows whether they are within a limit → what its sign is of: its own verdict."""
    return of_night(night.verdict, night.status, night.entry in unsure)


def today() -> str:
    """→ local date."""
    return f"{datetime.now().astimezone():%Y-%m-%d}"


def told(night: Night, limits: Mapping[str, float]) -> str:
    """night, limits (µm) → its verdict; changed and beyond its limit is out of limits, good and stopped is partial."""
    return as_limited(night.verdict, night.status, night.volume_um, limits)


def measured_before(nights: Sequence[Night]) -> Night | None:
    """nights, newest first → the last one that measured, where the newest did not; else None."""
    if not nights or nights[0].verdict != "not_measured":
        return None
    return next((n for n in nights[1:] if n.verdict != "not_measured"), None)


def _of_records(nights: Mapping[tuple[int, str], Sequence[Night]], key: int) -> list[Night]:
    """→ of every machine of one history the nights whose records the list of machines needs."""
    own = [every for (history, _), every in nights.items() if history == key and every]
    return [n for every in own for n in (every[0], measured_before(every)) if n is not None]


def _urgent(row: Row) -> tuple[int, str]:
    s = row.standing
    if s is None or s.last is None:
        return 3, row.machine.name
    bad = s.alarms_open > 0 or s.last.verdict in ("changed", "out_of_limits", "doubtful")
    if s.last.verdict in ("out_of_limits", "doubtful"):
        return -1, row.machine.name
    return (0 if bad else 1 if s.late or s.last.verdict == "not_measured" else 2), row.machine.name
