"""What a history is asked for: statements that are built once, with names for what differs from one call to the next."""

from __future__ import annotations

from functools import cache
from typing import Any

from sqlalchemy import BindParameter, Insert, Select, bindparam, func, insert, select

from . import _tables as t

COLUMNS = (  # of a night in a list
    *("night", "start_utc", "end_utc", "kind", "status", "verdict", "headline"),
    *("alarms", "p_value", "touches", "rms_um", "volume_um", "duration_s"),
)
_NEWEST_FIRST = (t.night.c.start_utc.desc(), t.night.c.entry_id.desc())
_OF_MACHINE = t.night.c.machine_id == bindparam("machine")
_BEFORE_UNTIL = t.night.c.start_utc <= bindparam("until")


@cache
def nights(given: frozenset[str]) -> Select[Any]:
    """which of machine, since, before, until, last are given → nights as they are listed, newest first."""
    columns: tuple[Any, ...] = (t.night.c.entry_id, t.machine.c.name, *(t.night.c[key] for key in COLUMNS))
    wanted = select(*columns).join(t.machine, t.machine.c.id == t.night.c.machine_id)
    if "machine" in given:
        wanted = wanted.where(_OF_MACHINE)
    if "since" in given:
        wanted = wanted.where(t.night.c.night >= bindparam("since"))
    if "before" in given:
        wanted = wanted.where(t.night.c.night < bindparam("before"))
    return _first(wanted.order_by(*_NEWEST_FIRST), given)


@cache
def records(given: frozenset[str]) -> Select[Any]:
    """which of last, until are given beside the machine → its records, newest first."""
    wanted = select(t.night_record.c.json).join(t.night, t.night.c.entry_id == t.night_record.c.entry_id)
    return _first(wanted.where(_OF_MACHINE).order_by(*_NEWEST_FIRST), given)


@cache
def alarmed(given: frozenset[str]) -> Select[Any]:
    """which of last, until are given beside the machine → its nights with alarms and their records, newest first."""
    wanted = (
        select(t.machine.c.name, t.night, t.night_record.c.json)
        .join(t.machine, t.machine.c.id == t.night.c.machine_id)
        .join(t.night_record, t.night_record.c.entry_id == t.night.c.entry_id)
    )
    return _first(wanted.where(_OF_MACHINE, t.night.c.alarms > 0).order_by(*_NEWEST_FIRST), given)


@cache
def knowledge(given: frozenset[str]) -> Select[Any]:
    """whether until is given beside the machine → its newest night that left an estimate."""
    wanted = (
        select(t.machine.c.name, t.night, t.night_estimate)
        .join(t.machine, t.machine.c.id == t.night.c.machine_id)
        .join(t.night_estimate, t.night_estimate.c.entry_id == t.night.c.entry_id)
    )
    return _first(wanted.where(_OF_MACHINE).order_by(*_NEWEST_FIRST), given).limit(1)


def _first(wanted: Select[Any], given: frozenset[str]) -> Select[Any]:
    wanted = wanted.where(_BEFORE_UNTIL) if "until" in given else wanted
    return wanted.limit(bindparam("last")) if "last" in given else wanted


NIGHT = (
    select(t.machine.c.name, t.night, t.night_record.c.json, t.night_readings.c.csv, t.night_estimate)
    .join(t.machine, t.machine.c.id == t.night.c.machine_id)
    .join(t.night_record, t.night_record.c.entry_id == t.night.c.entry_id)
    .outerjoin(t.night_readings, t.night_readings.c.entry_id == t.night.c.entry_id)
    .outerjoin(t.night_estimate, t.night_estimate.c.entry_id == t.night.c.entry_id)
    .where(t.night.c.entry_id == bindparam("entry"))
)
_OF_ENTRIES: BindParameter[Any] = bindparam("entries", expanding=True)
RECORDS_OF = select(t.night_record).where(t.night_record.c.entry_id.in_(_OF_ENTRIES))
READINGS_OF = select(t.night_readings.c.entry_id, t.night_readings.c.csv).where(t.night_readings.c.entry_id.in_(_OF_ENTRIES))
WHOLE = (  # one night, of this machine alone: all that its hash is of
    select(
        *(t.night, t.night_record.c.json, t.night_estimate.c.names, t.night_estimate.c.numbers),
        *(t.night_readings.c.csv, t.night_readings.c.rows.label("csv_rows"), t.night_readings.c.sha256.label("csv_sha256")),
    )
    .join(t.night_record, t.night_record.c.entry_id == t.night.c.entry_id)
    .outerjoin(t.night_readings, t.night_readings.c.entry_id == t.night.c.entry_id)
    .outerjoin(t.night_estimate, t.night_estimate.c.entry_id == t.night.c.entry_id)
    .where(t.night.c.entry_id == bindparam("entry"), _OF_MACHINE)
)
_KINDS = {"decision": (t.decision,), "compensation": (t.compensation,)} | {
    "night": (t.night, t.night_record, t.night_parameter, t.night_readings, t.night_estimate)
}
LOOSE = {  # by table: rows that belong to no entry of their kind
    table.name: select(table.c.entry_id)
    .distinct()
    .where(table.c.entry_id.not_in(select(t.entry.c.id).where(t.entry.c.kind == kind)))
    for kind, tables in _KINDS.items()
    for table in tables
}
NOBODYS = select(t.entry.c.machine_id).distinct().where(t.entry.c.machine_id.not_in(select(t.machine.c.id)))
_p = t.night_parameter.c
PARAMETERS = select(_p.name, _p.value, _p.std, _p.unit, _p.start_utc, _p.machine_id).where(_p.entry_id == bindparam("entry"))
DECISIONS = select(t.decision).where(t.decision.c.machine_id == bindparam("machine")).order_by(t.decision.c.entry_id)
MACHINES = select(t.machine.c.name).order_by(t.machine.c.name)
ID = select(t.machine.c.id).where(t.machine.c.name == bindparam("name"))
MACHINE = select(t.machine.c.id).where(t.machine.c.name == bindparam("name")).with_for_update()
LAST = (  # entry of a machine
    select(t.entry.c.number, t.entry.c.hash)
    .where(t.entry.c.machine_id == bindparam("machine"))
    .order_by(t.entry.c.number.desc())
    .limit(1)
)
_numbers = select(t.entry.c.machine_id, func.max(t.entry.c.number).label("number")).group_by(t.entry.c.machine_id).subquery()
NEWEST = (  # entry of every machine
    select(t.machine.c.name, t.entry.c.number, t.entry.c.hash)
    .join(t.machine, t.machine.c.id == t.entry.c.machine_id)
    .join(_numbers, (_numbers.c.machine_id == t.entry.c.machine_id) & (_numbers.c.number == t.entry.c.number))
)
SIMULATED = (  # the canonical text of a record has its members so; in a sentence the quotation marks are escaped
    select(t.night.c.entry_id)
    .join(t.night_record, t.night_record.c.entry_id == t.night.c.entry_id)
    .where(_OF_MACHINE, t.night_record.c.json.like('%,"simulated":true,%'))
)
UNSURE = (  # of a limit: no other member of a record has this name and may be neither
    select(t.night_record.c.entry_id).where(
        t.night_record.c.entry_id.in_(_OF_ENTRIES), t.night_record.c.json.like('%"passed":null%')
    )
)
ADD_ENTRY = insert(t.entry).returning(t.entry.c.id)
ADD: dict[str, Insert] = {
    table.name: insert(table) for table in (t.night, t.night_record, t.night_parameter, t.night_readings, t.night_estimate)
}
