"""A history: opened, added to, and read. Nothing that is in it is ever changed.

    with opened("history.db") as history:
        history.add_night(record, readings_text, knowledge)
        history.nights(machine="HU40T", last=30)

A night and everything that belongs to it is one transaction: after a power cut it is there whole or not at all.
"""

from __future__ import annotations

import json
import unicodedata
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Connection, Engine, Row, Select, insert, select
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError

from ..nearest import printable
from ..records import InputError, LinkError
from . import _asked as asked
from . import _chain, _fleet, _whole
from . import _tables as t
from ._answers import UnreadableError, answers
from ._columns import columns_of, rows_of
from ._database import connect, first_line
from .answers import of_machine
from .records import ACTIONS, AHEAD, Decision, Knowledge, Night, Standing, Stored, Trend, date_of, stamp_of

FORMAT = "tango-night/1"
REFUSED = 8  # nights that others at work may have refused, one after the other


@dataclass(frozen=True)
class History:
    """An open history; `opened` makes one."""

    engine: Engine
    _ids: dict[str, int] = field(default_factory=dict, compare=False, repr=False)  # of machines: they never change
    _alarms: dict[int, _fleet.Told] = field(default_factory=dict, compare=False, repr=False)  # of entries: nor do they
    clock: Callable[[], datetime] | None = field(default=None, compare=False, repr=False)
    _heard: dict[Any, list[Row[Any]]] | None = field(default=None, compare=False, repr=False)  # answers of one moment

    def as_of(self, clock: Callable[[], datetime]) -> History:
        """clock → the same history, read as it is by that clock: without nights that it dates in the future.

        The clock of such a night was wrong. Where it was the newest by its date, it would hide every night after it.
        """
        return replace(self, clock=clock)

    def of_now(self) -> History:
        """→ the same history, for reading as it is at one moment: what is asked a second time is not asked of the database.

        Who judges a night asks for the same nights thirty times. What somebody decides meanwhile counts in the next night.
        """
        return replace(self, _heard={})

    def _until(self) -> dict[str, Any]:
        """→ the last moment at which a night may have begun, where there is a clock."""
        return {} if self.clock is None else {"until": stamp_of(self.clock() + AHEAD)}

    # Adding ---------------------------------------------------------------------------------------------------------

    def add_night(self, record: Mapping[str, Any], readings: str | None = None, knowledge: Knowledge | None = None) -> int:
        """tango-night/1, text of readings.csv, all unknowns → number of the entry; on disk when this returns.

        Raises InputError for a malformed record, LinkError when the database does not take it.
        """
        if record.get("format") != FORMAT:
            raise InputError(f"history: found a record of format {record.get('format')!r}; allowed: {FORMAT}")
        try:
            text = _chain.written(record)
        except ValueError as error:
            raise InputError(f"history: the record of a night has a number that is not finite ({error})") from None
        numbers = None if knowledge is None else _packed(knowledge)
        csv_hash = None if readings is None else _chain.sha256(readings)
        names = None if knowledge is None else json.dumps(knowledge.names)
        content = _chain.content_of_night(text, csv_hash, numbers, names)
        with self._writing() as connection:
            machine, entry = self._linked(
                connection, record["machine"], record.get("cell", ""), "night", record["end_utc"], content
            )
            own = {"entry_id": entry, "machine_id": machine}
            connection.execute(asked.ADD[t.night.name], {**own, **columns_of(record)})
            connection.execute(asked.ADD[t.night_record.name], {"entry_id": entry, "json": text})
            parameters = [
                {**own, "name": name, "start_utc": record["start_utc"], **{key: p[key] for key in ("value", "std", "unit")}}
                for name, p in (record.get("parameters") or {}).items()
            ]
            if parameters:
                connection.execute(asked.ADD[t.night_parameter.name], parameters)
            if readings is not None:
                packed = zlib.compress(readings.encode(), 6)
                own_readings = {"entry_id": entry, "rows": rows_of(readings), "sha256": csv_hash, "csv": packed}
                connection.execute(asked.ADD[t.night_readings.name], own_readings)
            if knowledge is not None:
                connection.execute(asked.ADD[t.night_estimate.name], {"entry_id": entry, "names": names, "numbers": numbers})
        return entry

    def decide(self, machine: str, decision: Decision) -> int:
        """machine, decision about an alarm → number of the entry. Raises InputError for what cannot be decided."""
        if decision.action not in ACTIONS:
            raise InputError(f"decision: found {decision.action!r}; allowed: {', '.join(ACTIONS)}")
        if decision.action == "ignore" and decision.until is None:
            raise InputError("decision: found ignore without until when; allowed: ignore with a date, such as --until 2026-12-24")
        if decision.action != "ignore" and decision.until is not None:
            raise InputError(
                f"decision: found {decision.action} with until {decision.until}; allowed: until a date with ignore only"
            )
        if decision.until is not None:
            today = date_of(decision.utc or stamp_of(datetime.now(UTC)))
            last = decision.last_ignored(today)
            if not today <= _date(decision.until) <= last:
                why = "which is over" if decision.until < today else "more than a year from now"
                raise InputError(f"decision: found until {decision.until!r}, {why}; allowed: {today} … {last}")
        if not decision.owner.strip():
            raise InputError("decision: found no owner; allowed: the name of who decides")
        for key, text in (("owner", decision.owner), ("note", decision.note)):
            if strange := [c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]:
                code = f"U+{ord(strange[0]):04X}"
                raise InputError(f"decision: {key}: found the character {code}; allowed: one line of characters that are seen")
        known = {alarm["id"] for stored in self.alarmed(machine) for alarm in stored.record["alarms"]}
        if decision.alarm not in known:
            raise InputError(f"decision: found no alarm {decision.alarm!r} of {machine}; allowed: {_listed(sorted(known)[-5:])}")
        row = {key: getattr(decision, key) for key in ("alarm", "action", "until", "owner", "note")}
        row["utc"] = decision.utc or stamp_of(datetime.now(UTC))
        with self._writing() as connection:
            number, entry = self._linked(connection, machine, "", "decision", row["utc"], _chain.content_of_decision(row))
            connection.execute(insert(t.decision), {"entry_id": entry, "machine_id": number, **row})
        return entry

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        if self._heard is not None:
            self._heard.clear()
        try:
            with self.engine.connect().execution_options(writes=True) as connection, connection.begin():
                yield connection
        except IntegrityError as error:
            raise LinkError(f"history: another program added at the same moment ({first_line(error)}); do it again") from None
        except OperationalError as error:
            raise LinkError(f"history: it could not be written ({first_line(error)}); check the disk and the database") from None
        except DBAPIError as error:
            raise LinkError(f"history: the database refused ({first_line(error)})") from None

    def _linked(self, connection: Connection, name: str, cell: str, kind: str, utc: str, content: str) -> tuple[int, int]:
        """→ (id of the machine, id of its new entry), linked to its last one."""
        machine = connection.execute(asked.MACHINE, {"name": name}).scalar()
        if machine is None:
            added = {"name": name, "cell": cell, "added_utc": utc}
            try:
                with connection.begin_nested():
                    machine = connection.execute(insert(t.machine).returning(t.machine.c.id), added).scalar_one()
            except IntegrityError:  # another program has added the machine since it was looked for
                machine = connection.execute(asked.MACHINE, {"name": name}).scalar_one()
        last = connection.execute(asked.LAST, {"machine": machine}).first()
        number, previous = (last.number + 1, last.hash) if last else (1, _chain.FIRST)
        row = {
            **{"machine_id": machine, "number": number, "kind": kind, "utc": utc, "content": content, "previous": previous},
            "hash": _chain.link(name, number, kind, utc, content, previous),
        }
        return machine, connection.execute(asked.ADD_ENTRY, row).scalar_one()

    # Reading --------------------------------------------------------------------------------------------------------

    def machines(self) -> tuple[str, ...]:
        """→ names, in the order of the alphabet."""
        return tuple(row.name for row in self._rows(asked.MACHINES))

    def knows(self, machine: str) -> bool:
        """machine → whether there is one of that name."""
        return machine in self._ids or machine in self.machines()

    def nights(
        self, machine: str | None = None, last: int | None = None, since: str | None = None, before: str | None = None
    ) -> tuple[Night, ...]:
        """machine (None: all), how many, from and before which local date → nights, newest first."""
        limits = {
            "machine": None if machine is None else self._machine(machine),
            "since": None if since is None else _date(since),
            "before": None if before is None else _date(before),
            "last": last,
            **self._until(),
        }
        given = {key: value for key, value in limits.items() if value is not None}
        if last is not None:
            given["last"] = last + REFUSED
        return _by_end([_whole.listed(Night(*tuple(row))) for row in self._rows(asked.nights(frozenset(given)), given)])[:last]

    def ahead(self, machine: str | None = None) -> tuple[Night, ...]:
        """machine (None: all) → nights that the clock dates in the future, newest first; none without a clock."""
        if self.clock is None or (machine is not None and not self.knows(machine)):
            return ()
        day_before = f"{(self.clock() - timedelta(days=2)).astimezone():%Y-%m-%d}"
        later = replace(self, clock=None).nights(machine, since=day_before)
        return tuple(n for n in later if n.start_utc > self._until()["until"])

    def night(self, entry: int) -> Stored:
        """number of an entry → that night whole. Raises InputError when there is none."""
        found = self._rows(asked.NIGHT, {"entry": entry})
        if not found:
            raise InputError(f"history: found no night {entry}; 'tango history list' lists them")
        row = found[0]
        text = None if row.csv is None else _whole.readings(row.csv)
        known = None if row.names is None else _whole.knowledge(row.names, row.numbers)
        return Stored(_whole.night(row), _whole.record(row.json, row.entry_id), text, known)

    def records_of(self, entries: Sequence[int]) -> dict[int, Mapping[str, Any]]:
        """numbers of entries → {number: record of that night}, without readings and estimate; what is no night is left out."""
        rows = self._rows(asked.RECORDS_OF, {"entries": list(entries)}) if entries else ()
        return {row.entry_id: _whole.record(row.json, row.entry_id) for row in rows}

    def unsure(self, entries: Sequence[int]) -> frozenset[int]:
        """numbers of entries → those of nights of which nobody knows whether they are within a limit."""
        return frozenset(row.entry_id for row in self._rows(asked.UNSURE, {"entries": list(entries)})) if entries else frozenset()

    def simulated(self, machine: str) -> frozenset[int]:
        """machine → entries of its nights whose readings come from no machine."""
        return frozenset(row.entry_id for row in self._rows(asked.SIMULATED, {"machine": self._machine(machine)}))

    def readings_of(self, entries: Sequence[int]) -> dict[int, str]:
        """numbers of entries → {number: text of its readings.csv}; what has none is left out."""
        rows = self._rows(asked.READINGS_OF, {"entries": list(entries)}) if entries else ()
        return {row.entry_id: _whole.readings(row.csv) for row in rows}

    def last(self, machine: str) -> Stored | None:
        """machine → its newest night, None when there is none."""
        found = self.nights(machine, last=1) if self.knows(machine) else ()
        return self.night(found[0].entry) if found else None

    def latest_knowledge(self, machine: str) -> tuple[Night, Knowledge] | None:
        """machine → its newest night that left an estimate, and that; None when there is none."""
        if not self.knows(machine):
            return None
        given = {"machine": self._machine(machine)} | self._until()
        row = self._rows(asked.knowledge(frozenset(given)), given)
        return (_whole.night(row[0]), _whole.knowledge(row[0].names, row[0].numbers)) if row else None

    def records(self, machine: str, last: int | None = None) -> tuple[Mapping[str, Any], ...]:
        """machine, how many → tango-night/1 of its nights, newest first."""
        given = {"machine": self._machine(machine)} | ({} if last is None else {"last": last}) | self._until()
        return tuple(_whole.record(row.json) for row in self._rows(asked.records(frozenset(given)), given))

    def parameters(self, machine: str) -> tuple[str, ...]:
        """machine → names of the parameters that any night estimated, in the order of the alphabet."""
        own = t.night_parameter.c.machine_id == self._machine(machine)
        return tuple(row.name for row in self._rows(select(t.night_parameter.c.name).where(own).distinct().order_by("name")))

    def trend(self, machine: str, name: str, since: str | None = None) -> Trend:
        """machine, parameter, from which local date → its values, oldest first. Raises InputError for a parameter never seen."""
        c = t.night_parameter.c
        wanted = select(c.entry_id, c.start_utc, t.night.c.night, c.value, c.std, c.unit)
        wanted = wanted.join(t.night, t.night.c.entry_id == c.entry_id).where(
            c.machine_id == self._machine(machine), c.name == name
        )
        if since is not None:
            wanted = wanted.where(t.night.c.night >= _date(since))
        if until := self._until():
            wanted = wanted.where(c.start_utc <= until["until"])
        rows = self._rows(wanted.order_by(c.start_utc, c.entry_id))
        if not rows and name not in (known := self.parameters(machine)):
            raise InputError(f"history: {machine} has no parameter {name!r}; allowed: {_listed(known)}")
        entries, when, dates, value, std, unit = zip(*rows, strict=True) if rows else ((), (), (), (), (), ("",))
        return Trend(
            machine, name, unit[0], tuple(entries), tuple(when), tuple(dates), np.array(value, float), np.array(std, float)
        )

    def alarmed(self, machine: str, last: int | None = None) -> tuple[Stored, ...]:
        """machine, how many → its nights with alarms, newest first; readings and unknowns are left out."""
        given = {"machine": self._machine(machine)} | ({} if last is None else {"last": last}) | self._until()
        rows = self._rows(asked.alarmed(frozenset(given)), given)
        return tuple(Stored(_whole.night(row), _whole.record(row.json, row.entry_id), None, None) for row in rows)

    def decisions(self, machine: str) -> tuple[Decision, ...]:
        """machine → what was decided about its alarms, oldest first."""
        rows = self._rows(asked.DECISIONS, {"machine": self._machine(machine)})
        return tuple(Decision(r.alarm, r.action, r.owner, r.note, r.until, r.utc, machine, r.entry_id) for r in rows)

    def fleet(self, now_utc: str, late_hours: float = 36.0) -> tuple[Standing, ...]:
        """moment, hours after which a machine is late → how every machine is doing, those that need somebody first."""
        return _fleet.standings(self, now_utc, late_hours, self._alarms)

    def open_alarms(self, machine: str, last: int | None = None, today: str = "") -> tuple[Mapping[str, Any], ...]:
        """machine, how many of its nights with an alarm (None: all), local date ('': none is over) → alarms without an answer, each
        as the last night that told it.
        """
        known = of_machine(self, machine, today, last)
        return tuple(known.newest[key][1] for key in known.unanswered())

    # Trusting -------------------------------------------------------------------------------------------------------

    def verify(self, machine: str | None = None) -> tuple[str, ...]:
        """machine (None: all) → what is wrong with the chain, as sentences; empty when all is as it was added."""
        return tuple(text for texts in self.broken(machine).values() for text in texts)

    def broken(self, machine: str | None = None) -> dict[str, list[str]]:
        """machine (None: all) → {machine: what is wrong with its chain}, '' for what belongs to none; {} when all is as it was."""
        found = {name: self._wrong_with(name) for name in ((machine,) if machine else self.machines())}
        return {name: texts for name, texts in {**found, "": list(self._loose())}.items() if texts}

    def _wrong_with(self, name: str) -> list[str]:
        """machine → what is wrong with its chain, as sentences; of one that cannot be read, why."""
        try:
            return list(self._verified(name))
        except InputError as error:
            return [f"{name}: {printable(str(error).removeprefix('history: ').partition('; ')[0], 300)}"]

    def newest_hashes(self) -> dict[str, tuple[int, str]]:
        """→ {machine: (number of entries, hash of the newest)}: kept elsewhere, it shows a history whose end was cut off."""
        return {row.name: (row.number, row.hash) for row in self._rows(asked.NEWEST)}

    def holds(self, digest: str) -> bool:
        """hash of an entry → whether any machine has it."""
        return bool(self._rows(select(t.entry.c.id).where(t.entry.c.hash == digest)))

    def _verified(self, name: str) -> Iterator[str]:
        machine = self._machine(name)
        rows = self._rows(select(t.entry).where(t.entry.c.machine_id == machine).order_by(t.entry.c.number))
        decisions, compensations = (
            {r.entry_id: r for r in self._rows(select(table).where(table.c.machine_id == machine))}
            for table in (t.decision, t.compensation)
        )
        previous = _chain.FIRST
        for place, row in enumerate(rows, 1):
            what = f"{name}: entry {row.number} ({row.kind}, {row.utc})"
            if row.number != place:
                yield f"{name}: entry {place} is missing before entry {row.number}"
                return
            if row.previous != previous or row.hash != _chain.link(name, row.number, row.kind, row.utc, row.content, row.previous):
                yield f"{what} does not fit the entry before it: one of them was changed"
            contents = self._contents(machine, row.id) if row.kind == "night" else ()
            if row.kind == "decision" and row.id in decisions:
                contents = (_chain.content_of_decision(decisions[row.id]._asdict()),)
            if row.kind == "compensation" and row.id in compensations:
                contents = (_chain.content_of_compensation(compensations[row.id]._asdict()),)
            if row.content not in contents:
                yield f"{what} is not what was added"
            previous = row.hash
        of_machine = select(t.night.c.entry_id).where(t.night.c.machine_id == machine)
        loose = {r.entry_id for r in self._rows(of_machine)} | set(decisions) | set(compensations)
        yield from (f"{name}: entry {i} is not in the chain" for i in sorted(loose - {row.id for row in rows}))

    def _loose(self) -> Iterator[str]:
        """→ what belongs to no entry or no machine: it was slipped in, or what it belonged to was taken away."""
        for row in self._rows(asked.NOBODYS):
            yield f"entries of a machine that is not there (number {row.machine_id}): its name was taken away"
        for name, rows in asked.LOOSE.items():
            yield from (f"{name} {row.entry_id} belongs to no entry of the chain: it was slipped in" for row in self._rows(rows))

    def _contents(self, machine: int, entry: int) -> tuple[str, ...]:
        """id of a machine, of its entry → what its content may be: of today, and of a night from before names were in it."""
        found = self._rows(asked.WHOLE, {"machine": machine, "entry": entry})
        if not found:
            return ()
        row = found[0]
        try:
            record = _whole.record(row.json, entry)
            text = None if row.csv is None else _whole.readings(row.csv)
            csv = None if text is None else _chain.sha256(text)
            if row.names is not None:
                _whole.knowledge(row.names, row.numbers)
        except InputError:
            return ()
        parameters = {tuple(p) for p in self._rows(asked.PARAMETERS, {"entry": entry})}
        own, said = (record["start_utc"], machine), record.get("parameters") or {}
        if parameters != {(n, p["value"], p["std"], p.get("unit"), *own) for n, p in said.items()}:
            return ()
        if text is not None and (row.csv_sha256, row.csv_rows) != (csv, rows_of(text)):
            return ()
        if any(getattr(row, key) != value for key, value in columns_of(record).items()):
            return ()
        held = (row.json, csv, row.numbers)
        return _chain.content_of_night(*held, row.names), _chain.content_without_names(*held)

    # ----------------------------------------------------------------------------------------------------------------

    def _machine(self, name: str) -> int:
        if name not in self._ids:
            rows = self._rows(asked.ID, {"name": name})
            if not rows:
                raise InputError(f"history: found no machine {name!r}; allowed: {_listed(self.machines())}")
            self._ids[name] = int(rows[0].id)
        return self._ids[name]

    def _rows(self, wanted: Select[Any], given: Mapping[str, Any] | None = None) -> list[Row[Any]]:
        if self._heard is None:
            return self._asked(wanted, given)
        key = wanted, *(tuple(v) if isinstance(v, list) else v for item in sorted((given or {}).items()) for v in item)
        if key not in self._heard:
            self._heard[key] = self._asked(wanted, given)
        return self._heard[key]

    def _asked(self, wanted: Select[Any], given: Mapping[str, Any] | None) -> list[Row[Any]]:
        try:
            found = answers(self.engine, wanted, given)
        except (DBAPIError, UnicodeDecodeError) as error:
            raise UnreadableError(f"it cannot be read ({first_line(error)}); {self._look_at(error)}", self.engine) from None
        _whole.rows(wanted, found)
        return found

    def _look_at(self, error: Exception) -> str:
        """what was raised while it was read → what a person does: a server that went away has lost nothing."""
        if isinstance(error, OperationalError) and self.engine.dialect.name == "postgresql":
            return "is the database switched on, and the network between?"
        return "restore a backup with 'tango history restore'"

    def close(self) -> None:
        """Lets go of the database."""
        self.engine.dispose()


@contextmanager
def opened(where: str | Path, create: bool = True, patience: float | None = None) -> Iterator[History]:
    """as `connect` → history. Raises InputError for no such place, LinkError where the database does not answer."""
    history = History(connect(where, create, patience))
    try:
        yield history
    finally:
        history.close()


def _by_end(nights: Sequence[Night]) -> tuple[Night, ...]:
    """nights, the one that began last first → one that was refused stands behind the one at work, which ended after it."""
    refused = any(n.status == "refused" for n in nights)
    return tuple(sorted(nights, key=lambda n: n.end_utc, reverse=True) if refused else nights)


def _listed(names: Sequence[str]) -> str:
    return printable(", ".join(names)) or "none yet"


def _packed(knowledge: Knowledge) -> bytes:
    p = len(knowledge.names)
    lower = np.asarray(knowledge.covariance)[np.tril_indices(p)]
    return zlib.compress(np.concatenate([knowledge.values, lower]).astype("<f8").tobytes(), 1)


def _date(text: str) -> str:
    try:
        return datetime.strptime(text, "%Y-%m-%d").strftime("%Y-%m-%d")
    except ValueError:
        raise InputError(f"date: found {text!r}; allowed: year-month-day, e.g. 2026-11-23") from None
