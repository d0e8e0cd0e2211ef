"""Which alarms stand: what was decided about each, and about the one that it belongs to. Every view asks here.

A change and its way back ("has gone back") are one story under two ids: who closes either has closed both.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

from .records import HELD, Decision, merged, over

CLOSED = ("accept", "repaired")  # decisions after which an alarm stands no more


@dataclass(frozen=True)
class Answers:
    """Alarms of a machine, newest first, each as the last night that told it, and what was decided about them as it holds."""

    newest: Mapping[str, tuple[int, Mapping[str, Any]]]  # {id: entry of that night, alarm}, without parts of one that goes on
    parts: Set[str]  # ids of alarms that have turned out to be a part of another one
    decided: Mapping[str, Decision]  # {id: decision}; where that was made about the other end of its story, with this id

    def closed(self, alarm: str) -> bool:
        """id → whether it stands no more: accepted, repaired, or a part of another alarm."""
        return alarm in self.parts or (alarm in self.decided and self.decided[alarm].action in CLOSED)

    def held(self) -> tuple[str, ...]:
        """→ ids of those that somebody has answered and nobody has closed."""
        return tuple(key for key in self.newest if key in self.decided and self.decided[key].action in HELD)

    def unanswered(self) -> tuple[str, ...]:
        """→ ids of those without an answer, a change and its way back once: who answers the former has answered the latter."""
        waits = [key for key in self.newest if key not in self.decided]
        return tuple(key for key in waits if _gone_back(self.newest[key][1]) not in waits)


def answers(nights: Iterable[tuple[int, Sequence[Mapping[str, Any]]]], decisions: Iterable[Decision], today: str = "") -> Answers:
    """(entry, alarms) of nights, newest first, decisions, oldest first, local date ('': none is over) → what holds.

    What was ignored until a date counts as unanswered after that day.
    """
    newest: dict[str, tuple[int, Mapping[str, Any]]] = {}
    parts: set[str] = set()
    for entry, alarms in nights:
        parts |= merged(alarms)
        for a in alarms:
            newest.setdefault(str(a["id"]), (entry, a))  # several nights report one that goes on
    own = {key: d for key, d in {d.alarm: d for d in decisions}.items() if not over(d, today)}
    decided, story = dict(own), {key: a for key, (_, a) in newest.items()}
    for key, (entry, a) in newest.items():
        first = _gone_back(a)
        _passed_on(decided, own.get(key), first)
        if first and not _gone_back(story.get(first, {})) and _of_both(own.get(first), entry):
            _passed_on(decided, own.get(first), key)
    return Answers({key: one for key, one in newest.items() if key not in parts}, parts, decided)


def of_machine(past: Any, machine: str, today: str = "", last: int | None = None) -> Answers:
    """history, machine, local date, how many of its nights with an alarm (None: all) → what holds for its alarms."""
    nights = ((stored.night.entry, stored.record["alarms"]) for stored in past.alarmed(machine, last))
    return answers(nights, past.decisions(machine), today)


def every_decision(past: Any, machine: str) -> tuple[Decision, ...]:
    """history, machine → what was decided about its alarms, oldest first, then what was decided of one by the other end of its
    story: the last one about an alarm holds.
    """
    made = past.decisions(machine)
    return (*made, *(d for d in of_machine(past, machine).decided.values() if d not in made))


def briefly(alarm: Mapping[str, Any]) -> dict[str, Any]:
    """alarm → as much of it as says with which others it is one story."""
    return {"id": str(alarm["id"])} | {key: alarm[key] for key in ("undoes", "goes_on") if alarm.get(key)}


def _gone_back(alarm: Mapping[str, Any]) -> str:
    """alarm → id of the one that it takes back; '' for none."""
    return str((alarm.get("undoes") or {}).get("alarm") or "")


def _of_both(d: Decision | None, entry: int) -> bool:
    """decision about a change, entry of the night that saw it gone back → whether it is about both.

    An answer that is older than this night is about the change alone, as its author did not know of the way back. A repair is about
    both, whenever somebody reports it: it made the change go back.
    """
    return d is not None and (d.action == "repaired" or d.entry > entry)


def _passed_on(decided: dict[str, Decision], d: Decision | None, other: str) -> None:
    """decisions as they hold, one about an end of a story, id of its other end → what closes an end closes the other one, and what
    only answers it answers the other one where that has no answer.
    """
    if d is None or not other:
        return
    known = decided.get(other)
    if known is None or (d.action in CLOSED and known.action not in CLOSED):
        decided[other] = replace(d, alarm=other)
