"""What goes into a history and what comes out of it; frozen, plain data inside."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from ..records import Array

ACTIONS = ("accept", "acknowledge", "repaired", "ignore")
HELD = ("acknowledge", "ignore")  # after these an alarm is answered and not closed
AHEAD = timedelta(hours=1)  # by which a clock may go back without a word: nights further in the future are left out


@dataclass(frozen=True)
class Knowledge:
    """All unknowns after a night: p names, values and their covariance (mm, rad, mm/mm …)."""

    names: tuple[str, ...]
    values: Array  # (p,)
    covariance: Array  # (p, p)


@dataclass(frozen=True)
class Night:
    """One night in a list: the columns of a table, without what was measured."""

    entry: int  # unique in the history
    machine: str
    night: str  # local date of the morning after it, 2026-11-23
    start_utc: str
    end_utc: str
    kind: str  # full, check, none
    status: str  # complete, partial, failed, missed
    verdict: str
    headline: str
    alarms: int
    p_value: float | None
    touches: int
    rms_um: float | None
    volume_um: float | None  # None also of a night in doubt
    duration_s: float


@dataclass(frozen=True)
class Stored:
    """One night whole."""

    night: Night
    record: Mapping[str, Any]  # tango-night/1
    readings: str | None  # text of readings.csv
    knowledge: Knowledge | None


@dataclass(frozen=True)
class Trend:
    """One parameter over the nights that estimated it, oldest first."""

    machine: str
    name: str
    unit: str
    entries: tuple[int, ...]
    start_utc: tuple[str, ...]
    nights: tuple[str, ...]  # their dates
    value: Array  # (n,)
    std: Array  # (n,)


@dataclass(frozen=True)
class Decision:
    """What somebody decided about an alarm: accept, acknowledge, repaired, or ignore until a date."""

    alarm: str  # its id, e.g. 2026-11-23-1
    action: str
    owner: str
    note: str = ""
    until: str | None = None  # local date, of ignore
    utc: str = ""
    machine: str = ""
    entry: int = field(default=0, compare=False)  # its number in the history: nights after it have larger ones, whatever clocks say

    @staticmethod
    def last_ignored(today: str) -> str:
        """local date → the last day until which an alarm may be ignored from then on: who mistypes a year hears of it again."""
        return (datetime.fromisoformat(today) + timedelta(days=366)).strftime("%Y-%m-%d")


def over(d: Any, today: str) -> bool:
    """decision, local date → whether it ignored its alarm until a day that is over: nobody has answered it any more."""
    return d.action == "ignore" and str(d.until or "") < today


@dataclass(frozen=True)
class Compensation:
    """One event of a compensation; µm are rms over the volume that it was made for."""

    entry: int  # unique in the history
    utc: str
    number: int  # of the compensation within its cell
    target: str
    event: str  # proposed, written, kept, kept as far as seen, not as promised, undecided, no help, rolled back
    text: str  # the reason, empty where the event says all
    before_um: float | None
    promised_um: float | None
    measured_um: float | None


NOT_IN_ORDER = ("out_of_limits", "doubtful", "not_measured")  # a change is in order once its alarm is answered


@dataclass(frozen=True)
class Standing:
    """One machine of a fleet: its last night, and what is late."""

    machine: str
    last: Night | None
    nights: int
    alarms_open: int  # alarms without a decision
    late: bool  # no complete night for longer than asked for
    alarms_held: int = 0  # alarms that somebody has answered without closing them

    @property
    def wants_somebody(self) -> bool:
        """→ whether somebody has to look: it is late, an alarm has no answer, or its last night is not in order."""
        return self.last is None or self.late or self.alarms_open > 0 or self.last.verdict in NOT_IN_ORDER


def merged(alarms: Iterable[Mapping[str, Any]]) -> set[str]:
    """alarms of a record → ids of alarms that have turned out to be a part of one of these, which goes on."""
    return {str(one) for a in alarms for one in (a.get("goes_on") or {}).get("with") or ()}


def date_of(stamp: str) -> str:
    """moment in UTC → its local date."""
    return datetime.fromisoformat(stamp).astimezone().strftime("%Y-%m-%d")


def stamp_of(moment: datetime) -> str:
    """moment → 2026-11-23T02:00:00Z."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
