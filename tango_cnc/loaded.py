"""What the control holds now: the newest compensation that was not rolled back, whether or not anybody has measured with it.

Messages, pages, alarms, reports and `tango compensate` all ask this one function.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

KEPT, WRITTEN, BACK, NO_HELP = "kept", "written", "rolled back", "no help"
AS_SEEN = "kept as far as seen"  # what the run sees acts; it does not see all of it
HELPS = (KEPT, AS_SEEN)  # a measurement found that it helps
IN_CONTROL = (WRITTEN, *HELPS, "not as promised", "undecided", NO_HELP)  # until a person notes that undo/ is loaded


class Event(Protocol):
    """Something that happened to a compensation, as the history of a machine and the folder of a cell have it."""

    @property
    def utc(self) -> str:
        """→ when."""

    @property
    def number(self) -> int:
        """→ of the compensation."""

    @property
    def target(self) -> str:
        """→ the kind of control."""

    @property
    def event(self) -> str:
        """→ proposed, written, kept, kept as far as seen, not as promised, undecided, no help, rolled back."""


@dataclass(frozen=True)
class Happened:
    """A line of compensations/history.jsonl."""

    utc: str
    number: int
    target: str
    event: str


@dataclass(frozen=True)
class Holds:
    """The compensation that is in the control."""

    number: int
    target: str
    event: str  # the last that happened to it: written, kept, kept as far as seen, undecided, not as promised, no help
    utc: str  # when that was
    written: str  # UTC of the moment at which it was noted as written
    proven: int | None  # the last that was found to help: this one, or one of the same target that it was made on top of

    @property
    def measured(self) -> bool:
        """→ whether it was found to help."""
        return self.event in HELPS


def holds(events: Iterable[Event]) -> Holds | None:
    """events of the compensations of one control, in any order → what it holds now; None where every one was taken out again.

    One is made on top of the one before it, so what that one was proven to take away is still gone; after no help of the newest
    not even that is known (a wrong sign, perhaps).
    """
    ordered = in_order(events)
    last = {e.number: e for e in ordered}
    given: dict[int, str] = {}
    for e in ordered:
        if e.event in IN_CONTROL:
            given.setdefault(e.number, e.utc)
    there = [number for number in given if last[number].event in IN_CONTROL]  # the last that was written comes last
    if not there:
        return None
    newest = last[there[-1]]
    same = [n for n in there if last[n].event in HELPS and last[n].target == newest.target]
    proven = same[-1] if same and newest.event != NO_HELP else None
    return Holds(newest.number, newest.target, newest.event, newest.utc, given[newest.number], proven)


def in_order(events: Iterable[Event]) -> Sequence[Event]:
    """events in either order of time → oldest first; those of one second as they came."""
    found = list(events)
    if len(found) > 1 and found[0].utc > found[-1].utc:
        found.reverse()
    return sorted(found, key=lambda e: e.utc)


def changes(events: Iterable[Event], since: str = "", until: str = "") -> Sequence[Event]:
    """events, after which moment, before which one (UTC; '': any) → those at which the control became another one, oldest first."""
    found = [e for e in in_order(events) if e.event in (WRITTEN, BACK)]
    return [e for e in found if e.utc[:19] >= since[:19] and (not until or e.utc[:19] < until[:19])]
