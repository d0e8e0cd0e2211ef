"""What nights before have left behind: a mark of one that was cut off, a result that the history did not take, nights that never
began.

The night that has the lock puts them on record. One that has not, or whose history refuses, names them.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from ..files.readjson import parse_json
from ..files.shape import misfit
from ..history import FORMAT, Knowledge
from ..history.records import stamp_of
from ..records import InputError
from ..report.texts import texts
from ..texts import carried, joined, say
from .dates import date_at, missing, night_of
from .ports import Disk, Ports
from .words import headline

MISSED = 7  # nights that were missed and are put on record one by one
LOOKED = 30  # nights on record that a mark is looked for among
KEPT = {"record": {}, "readings?": str, "knowledge?": {"names": [str], "values": [float], "covariance": [[float]]}}
UNKEPT = "unkept.json"  # file of a night that the history did not take


@dataclass(frozen=True)
class LeftNight:
    """A night before that the history does not have."""

    started: str  # UTC
    night: str  # its date
    status: str  # failed: it left a mark; missed: it never began
    why: str
    stamp: str = ""  # of its mark
    waits: bool = False  # it measured, and its result waits on the disk

    @property
    def text(self) -> str:
        """→ 2026-11-23: why."""
        return joined("", (f"{self.night}: ", self.why))

    def record(self, machine: str, cell: str) -> dict[str, Any]:
        """machine, folder of its cell → the record of a night of which there is nothing else."""
        record = {
            **{"format": FORMAT, "machine": machine, "cell": cell, "night": self.night, "start_utc": self.started},
            **{"end_utc": self.started, "duration_s": 0.0, "kind": "none", "status": self.status, "why": self.why},
            **{"verdict": "not_measured", "preflight": [], "touches": 0, "planned": 0, "machine_time_s": 0.0},
            **{"alarms": [], "limits": []},
        }
        if self.stamp:
            record["artefacts"] = {"folder": f"nights/{self.stamp}"}
        return record | {"headline": headline(record)}


def put_on_record(machine: str, cell: str, world: Ports, every_days: float, now: datetime) -> list[str]:
    """machine, folder of its cell, the world, days from night to night, now → sentences on nights that were begun and never ended,
    and on those that never began; they are on record when it returns. Who calls it has the lock: no mark is of a night at work.

    Raises LinkError and OSError where the history or the disk refuses.
    """
    said: list[str] = []
    for one in left_nights(machine, world, every_days, now):
        if one.stamp and added(world, one.stamp):
            said.append(say("night.night.its_result_was_kept_nights", started=one.night, stamp=one.stamp))
        else:
            world.past.add_night(one.record(machine, cell))
            said.append(one.text)
        if one.stamp:
            world.disk.ended(one.stamp)
    for stamp, _ in world.disk.unfinished():  # on record already
        world.disk.ended(stamp)
    return said


def left_nights(machine: str, world: Ports, every_days: float, now: datetime, own: str = "") -> list[LeftNight]:
    """machine, the world, days from night to night, now, stamp of tonight → nights before that are not on record, oldest first.

    Raises LinkError and OSError where the history or the disk cannot be read.
    """
    known = {n.start_utc: n.status for n in world.past.nights(machine, last=LOOKED)} if world.past.knows(machine) else {}
    found: dict[str, LeftNight] = {}
    for stamp, started in world.disk.unfinished():
        if stamp != own and started not in known and started not in found:  # a refused one may be of the same second
            found[started] = _of_mark(world, stamp, started, now)
    marked = found.keys() | {started for started, status in known.items() if status == "refused"}
    on_record = [s for s in known if s not in marked] or list(known) or [s for s in found if _moment(s) is not None]
    never = _never_began(on_record, marked, every_days, now)
    return sorted([*found.values(), *never], key=lambda one: one.started)


def with_left(
    before: Mapping[str, Any], machine: str, world: Ports, every_days: float, now: datetime, own: str, locked: bool
) -> dict[str, Any]:
    """what is known of the nights before, machine, the world, days from night to night, now, stamp of tonight, whether tonight has
    the lock → the same with those that are not on record (`left_behind`); those that measured nothing are in `unmeasured`, too.

    Without the lock a mark may be that of the night at work, so that one of tonight's date is left out.
    """
    left = [one for one in left_nights(machine, world, every_days, now, own) if locked or one.night != night_of(now)]
    if not left:
        return dict(before)
    said = [one.text if locked or not one.stamp or one.waits else _may_be_at_work(one) for one in left]
    gone = [text for one, text in zip(left, said, strict=True) if not one.waits]
    unmeasured = sorted([*before.get("unmeasured", ()), *gone], key=lambda text: text[:10])[-MISSED:]
    return {**before, **({"unmeasured": unmeasured} if unmeasured else {}), "left_behind": said}


def _may_be_at_work(one: LeftNight) -> str:
    return joined("", (f"{one.night}: ", say("night.night.mark_of_whom")))


def _of_mark(world: Ports, stamp: str, started: str, now: datetime) -> LeftNight:
    """the world, stamp and start of a night that left a mark, now → what became of it."""
    date, waits = date_at(started, now), unkept(world.disk, stamp)
    if waits is not None and waits[0].get("touches"):
        return LeftNight(started, date, "failed", say("night.night.its_result_waits", stamp=stamp), stamp, True)
    why = str(waits[0].get("headline") or "") if waits is not None else ""
    return LeftNight(started, date, "failed", why or _lost(world, stamp), stamp)


def _never_began(known: Collection[str], marked: Collection[str], every_days: float, now: datetime) -> list[LeftNight]:
    """starts of nights on record, of those that were refused or have only left a mark, days from night to night, now → nights that
    never began since the last one on record, `MISSED` at most.

    A refused night puts nothing on record, and neither does one that the history refuses: what is missing before it is still
    missing after it.
    """
    if not known:
        return []
    last, period = max(known), timedelta(days=every_days)
    between = [moment for text in marked if (moment := _moment(text)) is not None and text > last]
    there = {int((now - moment) / period + 0.5) for moment in between}
    count = missing((now - datetime.fromisoformat(last)) / timedelta(days=1), every_days)
    free = [back for back in range(1, min(count, MISSED + len(there)) + 1) if back not in there][:MISSED]
    missed = count - sum(1 <= back <= count for back in there)
    found = []
    for back in reversed(free):
        when, why = now - period * back, say("night.night.no_night_began")
        if missed > MISSED and back == free[-1]:
            why = say("night.night.no_night_began_nights_missing", missed=missed, last=date_at(last, now))
        found.append(LeftNight(stamp_of(when), night_of(when), "missed", why))
    return found


def _moment(started: str) -> datetime | None:
    try:
        return datetime.fromisoformat(started)
    except ValueError:
        return None


def _lost(world: Ports, stamp: str) -> str:
    """the world, stamp of a night that left only its mark → what became of it, as far as the disk shows it."""
    t = texts()
    try:
        waits = any(old == stamp for old, _ in world.disk.unsent())
        whole = world.disk.read(stamp, "readings.csv") is not None
        kept = whole or world.disk.read(stamp, "readings.partial.csv") is not None
    except OSError:
        waits = kept = whole = False
    why = t("night.cut_off") if waits or kept else t("night.cut_off_silent")
    if whole:
        return joined("", (why, t("night.readings_whole", file=f"nights/{stamp}/readings.csv")))
    return joined("", (why, t("night.readings_left", folder=f"nights/{stamp}") if kept else ""))


def packed(record: dict[str, Any], readings: str | None, knowledge: Knowledge | None) -> str:
    """record, readings, unknowns of a night that the history did not take → the text that keeps them until it does."""
    state = None
    if knowledge is not None:
        state = {"names": knowledge.names, "values": knowledge.values.tolist(), "covariance": knowledge.covariance.tolist()}
    return json.dumps({"record": carried(record), "readings": readings, "knowledge": state}, ensure_ascii=False) + "\n"


def unkept(disk: Disk, stamp: str) -> tuple[dict[str, Any], str | None, Knowledge | None] | None:
    """disk, stamp → record, readings and unknowns of a night that the history refused; None where the file is missing or damaged.

    Raises OSError.
    """
    text = disk.read(stamp, UNKEPT)
    if text is None:
        return None
    try:
        kept = parse_json(text)
        state = kept["knowledge"]
        if misfit(kept, KEPT):
            return None
        known = None
        if state is not None:
            p, values, covariance = len(state["names"]), np.array(state["values"], float), np.array(state["covariance"], float)
            if values.shape != (p,) or covariance.shape != (p, p):
                return None
            known = Knowledge(tuple(state["names"]), values, covariance)
    except (ValueError, KeyError, TypeError, OverflowError, InputError):  # not whole: the night counts as cut off, its files stay
        return None
    return kept["record"], kept["readings"], known


def added(world: Ports, stamp: str) -> bool:
    """→ whether the history has now taken a night that it refused when it was measured. Raises LinkError where it still refuses."""
    if (kept := unkept(world.disk, stamp)) is None:
        return False
    try:
        world.past.add_night(*kept)
    except (ValueError, KeyError, TypeError, OverflowError, InputError):
        return False
    return True
