"""How every machine of a history is doing: its last night, what waits for an answer, and whether it is late."""

from __future__ import annotations

from collections import defaultdict
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from sqlalchemy import func, select

from . import _tables as t
from . import _whole
from .answers import answers, briefly
from .records import AHEAD, Decision, Standing, date_of, stamp_of

if TYPE_CHECKING:
    from .store import History


Told = tuple[dict[str, Any], ...]  # alarms of a night, as far as they are counted
MANY = 500  # records that are read at once


def standings(history: History, now_utc: str, late_hours: float, told: dict[int, Told]) -> tuple[Standing, ...]:
    """history, moment, hours after which a machine is late → how every machine is doing, those that need
    somebody first. `told`: {entry: its alarms} as far as they are known; those of new entries are added.
    """
    # A night that lies after now had a wrong clock; it would hide every later one.
    counts_now = t.night.c.start_utc <= stamp_of(datetime.fromisoformat(now_utc) + AHEAD)
    limit = stamp_of(datetime.fromisoformat(now_utc) - timedelta(hours=late_hours))
    # The last one is the one that ended last: a night that was refused began after the one at work, and tells less.
    newest = (
        select(t.night.c.machine_id, func.max(t.night.c.end_utc).label("end"), func.count().label("nights"))
        .where(counts_now)
        .group_by(t.night.c.machine_id)
        .subquery()
    )
    counts = {
        row.name: (row.nights, row.complete)
        for row in history._rows(
            select(
                t.machine.c.name,
                func.count().label("nights"),
                func.max(t.night.c.start_utc).filter(t.night.c.status == "complete").label("complete"),
            )
            .join(t.night, t.night.c.machine_id == t.machine.c.id)
            .where(counts_now)
            .group_by(t.machine.c.name)
        )
    }
    rows = history._rows(
        select(t.machine.c.name, t.night)
        .join(t.machine, t.machine.c.id == t.night.c.machine_id)
        .join(newest, (newest.c.machine_id == t.night.c.machine_id) & (newest.c.end == t.night.c.end_utc))
        .order_by(t.night.c.entry_id)
    )
    last = {row.name: _whole.night(row) for row in rows}
    alarmed = history._rows(
        select(t.machine.c.name, t.night.c.entry_id)
        .join(t.machine, t.machine.c.id == t.night.c.machine_id)
        .where(t.night.c.alarms > 0, counts_now)
        .order_by(t.night.c.start_utc.desc(), t.night.c.entry_id.desc())
    )
    new = [row.entry_id for row in alarmed if row.entry_id not in told]
    for at in range(0, len(new), MANY):
        for entry, record in history.records_of(new[at : at + MANY]).items():
            told[entry] = tuple(briefly(alarm) for alarm in record["alarms"])
    d = t.decision.c
    answered = select(t.machine.c.name, d.alarm, d.action, d.until, d.entry_id)
    answered = answered.join(t.machine, t.machine.c.id == t.decision.c.machine_id).order_by(t.decision.c.entry_id)
    given, nights_of, today = defaultdict(list), defaultdict(list), date_of(now_utc)
    for x in history._rows(answered):
        given[x.name].append(Decision(x.alarm, x.action, "", "", x.until, "", x.name, x.entry_id))
    for row in alarmed:
        if row.entry_id in told:
            nights_of[row.name].append((row.entry_id, told[row.entry_id]))
    known = {name: answers(nights_of[name], given[name], today) for name in {*given, *nights_of}}
    found = []
    for name in history.machines():
        nights, complete = counts.get(name, (0, None))
        late = complete is None or complete < limit
        waiting, held = (len(known[name].unanswered()), len(known[name].held())) if name in known else (0, 0)
        found.append(Standing(name, last.get(name), nights, waiting, late, held))
    return tuple(sorted(found, key=lambda s: (not (s.alarms_open or s.late), s.machine)))
