"""An alarm that goes on: what moves the same way night after night is one alarm with one id, until somebody decides about it.

A step of `KNOCK` is a knock by itself. What comes the night after it may be another knock: it is another alarm, and says so. From
the third night on it is something that goes on: all of it is the alarm of the first night then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any

from ..history import Decision
from ..history.answers import of_machine
from ..records import Array
from ..report.tonight import LENGTHS, is_over, is_unseen
from ..state import Named, State
from ..state.changes import change
from ..texts import say
from .alarms import Known, of_cause
from .answered import BY_SIZE, WITHOUT_SIZE
from .control import Given
from .course import ALIKE, AT_ONCE
from .dates import LISTED, Since, date_of
from .drift import drift_do
from .moved import SURE, Moved, moved
from .ports import Past
from .standing import own_of
from .words import a_day, value

ENDS = ("accept", "repaired", "ignore")  # answers after which what goes on is another alarm
GREW = 0.25  # of its size, by which an alarm has grown by the last night where it goes on without a further alarm
KNOCK = 10.0  # µm that one night moves the tool tip by, from which it may be a knock by itself
PAUSE = 3.5  # days within which the next step of what has gone on before belongs to it
FASTER = 2.0  # times what it made a day, from which tonight's step is a knock on top of it


def going_on(
    past: Past,
    machine: str,
    k: Known,
    after: State,
    alarms: Sequence[dict[str, Any]],
    before: Since,
    given: Sequence[Given] = (),
) -> list[dict[str, Any]]:
    """history, machine, what is known, state after tonight, alarms of tonight, since when, what the control got or lost → the same;
    one that goes on has the id of the alarm that it goes on from, and its date.
    """
    if not alarms or not past.knows(machine):
        return list(alarms)
    last = of_machine(past, machine, last=LISTED).decided
    newest = newest_of(past, machine)
    return [_going_on(past, machine, k, after, a, before, newest, last, given) for a in alarms]


def anew(alarms: Sequence[Mapping[str, Any]]) -> bool:
    """alarms of a night → whether one of them asks for a full run: one that goes on has asked for it on its first night."""
    return any(not a.get("goes_on") for a in alarms)


def newest_of(past: Past, machine: str) -> dict[str, tuple[Any, Mapping[str, Any]]]:
    """history, machine → {id: the newest night that told this alarm, the alarm as it told it}, newest first."""
    found: dict[str, tuple[Any, Mapping[str, Any]]] = {}
    for stored in past.alarmed(machine, LISTED):
        for a in stored.record["alarms"]:
            found.setdefault(a["id"], (stored, a))
    return found


def same_pace(older: Mapping[str, Any], tonight: Mapping[str, Any], days: float) -> bool:
    """alarm of an earlier night, alarm of tonight, days that its step took → whether that is as the steps before it."""
    step, made = abs(float(tonight["size"])), abs(float(older["rate_per_day"] or older["size"]))
    return step <= FASTER * made * max(days, 1.0) + SURE * float(tonight["std"])


def _going_on(
    past: Past,
    machine: str,
    k: Known,
    after: State,
    alarm: dict[str, Any],
    before: Since,
    newest: Mapping[str, tuple[Any, Mapping[str, Any]]],
    last: Mapping[str, Decision],
    given: Sequence[Given],
) -> dict[str, Any]:
    if alarm["cause"] in (*WITHOUT_SIZE, *BY_SIZE) or alarm.get("repair") or alarm.get("undoes"):
        return alarm
    for key, (stored, older) in newest.items():
        answer = last.get(key)
        if (older["cause"], older["parameter"]) != (alarm["cause"], alarm["parameter"]) or ended(answer, date_of(after.day)):
            continue
        days = after.day - float(stored.record["state"]["day"])
        if any(g.utc >= stored.night.start_utc for g in given) or not _moved_last(past, machine, stored, older, alarm, days):
            return alarm
        m = moved(past, machine, k, after, stored, older)
        if m is None or not same_pace(older, alarm, _since_last(past, machine, after, days)) or not _onward(m, alarm):
            return alarm
        if _knocks(k, m, older, alarm):
            return alarm | {"follows": _followed(older, stored)} | _twice(alarm)
        if (begun := _begun(newest, last, older, date_of(after.day))) is not None:
            first_m = moved(past, machine, k, after, *begun)
            if first_m is not None:  # two knocks were one thing that goes on: it is the alarm of the first one
                answer = last.get(begun[1]["id"]) or answer
                told = _told(k, after, alarm, *begun, first_m, before, answer, twice=False)
                told["goes_on"]["with"] = [older["id"]]
                return told
        twice = not older.get("rate_per_day") and not older.get("follows")  # two steps are no course yet
        told = _told(k, after, alarm, stored, older, m, before, answer, twice=twice)
        told["goes_on"] |= {"with": known} if (known := (older.get("goes_on") or {}).get("with")) else {}
        return told
    return alarm


def _begun(
    newest: Mapping[str, tuple[Any, Mapping[str, Any]]], last: Mapping[str, Decision], older: Mapping[str, Any], today: str
) -> tuple[Any, Mapping[str, Any]] | None:
    """→ the night and the alarm before the older one, where the older one might have been a second knock; None where no alarm was
    before it, and where somebody has closed that.
    """
    first = str((older.get("follows") or {}).get("alarm"))
    return None if first not in newest or ended(last.get(first), today) else newest[first]


def ended(answer: Decision | None, today: str) -> bool:
    """last answer to an alarm, date → whether what goes on after it is another alarm."""
    if answer is None or answer.action not in ENDS:
        return False
    return answer.action != "ignore" or (answer.until or "") >= today


def _moved_last(past: Past, machine: str, stored: Any, older: Mapping[str, Any], alarm: Mapping[str, Any], days: float) -> bool:
    """→ whether it moved until the last night that was believed: between two knocks with a quiet night nothing goes on. What has
    gone on before may rest for some nights.
    """
    if alarm.get("rate_per_day"):  # nights together have told it
        return bool(older.get("ignored"))
    known = past.latest_knowledge(machine)
    if known is None or stored.night.entry == known[0].entry:
        return known is not None
    waiting = past.records_of([known[0].entry])[known[0].entry].get("standing") or ()
    last_told = next((x for x in waiting if x["id"] == older["id"]), None)
    if last_told is None or last_told.get("stands") or is_over(last_told) or is_unseen(last_told.get("now")):
        return False
    size, total = float(older["size"]), last_told.get("total")
    grew = total is not None and float(total) * size > 0 and abs(float(total)) > (1 + GREW) * abs(size)
    rests = bool(older.get("goes_on")) and days < PAUSE
    return grew or rests or bool(older.get("rate_per_day") and older.get("steady", True))


def _since_last(past: Past, machine: str, after: State, days: float) -> float:
    """→ days since the last night that was believed, whose state tonight's step was found against; at most those since the alarm,
    which may have waited for weeks.
    """
    known = past.latest_knowledge(machine)
    if known is None:
        return days
    state = past.records_of([known[0].entry])[known[0].entry].get("state") or {}
    return min(days, after.day - float(state.get("day", after.day - days)))


def _onward(m: Moved, alarm: Mapping[str, Any]) -> bool:
    """how far it has moved, alarm of tonight → whether tonight's step takes it farther the same way."""
    then, now, std = m.along()
    if len(m.now) == 1:
        return float(alarm["size"]) * then > 0 and now * then > 0
    return now - then > max(SURE * std, 0.5 * float(alarm["size"]))


def _knocks(k: Known, m: Moved, older: Mapping[str, Any], alarm: Mapping[str, Any]) -> bool:
    """what is known, how far it has moved, alarm of the night before, alarm of tonight → whether the two may be two knocks: both
    came at once, no third one before them, and one of them is as large as a knock.
    """
    if older.get("rate_per_day") or alarm.get("rate_per_day") or older.get("follows"):
        return False
    return max(_tip(k, m.what.directions, a) for a in (older, alarm)) >= KNOCK


def _tip(k: Known, directions: Array, alarm: Mapping[str, Any]) -> float:
    """what is known, (p, m) directions of a cause, its alarm → µm: of a length the length, of an angle or a scale the tool tip."""
    size = abs(float(alarm["size"]))
    return size * 1e3 if alarm["unit"] == "mm" else k.worst(directions[:, 0] * size)


def _twice(alarm: Mapping[str, Any]) -> dict[str, Any]:
    """alarm of tonight → what to do after two nights in which it moved; as for one of a probe, which no compensation moves."""
    return {} if change(alarm["cause"]).of_the_probe else {"do": say("night.goes_on.twice_do")}


def _size(a: Mapping[str, Any]) -> str:
    """alarm → its size with its sign, that of a length without one."""
    return value(float(a["size"]), str(a["unit"]), float(a["std"]), signed=a["cause"] not in LENGTHS)


def _followed(older: Mapping[str, Any], stored: Any) -> dict[str, Any]:
    """alarm of the night before, its night → what tonight's alarm says of it."""
    size, night = _size(older), str(stored.record["night"])
    return {"alarm": older["id"], "night": night, "text": say("night.goes_on.follows", size=size, night=night)}


def _told(
    k: Known,
    after: State,
    alarm: dict[str, Any],
    stored: Any,
    older: Mapping[str, Any],
    m: Moved,
    before: Since,
    answer: Decision | None,
    *,
    twice: bool,
) -> dict[str, Any]:
    """→ the alarm of tonight as the older one that goes on, with all that has come since that one began."""
    since, unit = str(older["since"]), str(alarm["unit"])
    sigmas = abs(m.along()[1]) / max(m.least() / SURE, 1e-15)
    whole = of_cause(k, Since(since, since), Named(m.what, m.now, m.std, sigmas**2, 0.0, 0.0, ()))
    size, step = float(whole["size"]), float(alarm["size"])
    days = (date.fromisoformat(date_of(after.day)) - date.fromisoformat(since)).days
    rate, steady = size / max(days, 1), abs(step) < AT_ONCE * abs(size) and not twice
    if steady and own_of(stored.record.get("parameters") or {}, alarm["parameter"]) is not None:  # a length has no way
        whole["text"] = a_day(whole["text"], rate, unit, whole.get("alike_by") or {})
        whole |= {"do": drift_do(str(alarm["cause"]), str(alarm["parameter"]))} if alarm["parameter"] != ALIKE else {}
    told = value(step, unit, float(alarm["std"]), signed=len(m.now) == 1)
    whole |= _twice(alarm) if twice else {}
    text = say("night.goes_on.text", step=told, since=before.words, night=str(older["id"])[:10])
    whole |= {"id": older["id"], "rate_per_day": rate, "steady": steady, "instead": alarm["instead"]}
    whole["sigmas"] = max(float(whole["sigmas"]), float(alarm["sigmas"]))  # a machine that wanders makes the whole less sure
    held = {"owner": answer.owner, "decision": "acknowledge"} if answer is not None and answer.action == "acknowledge" else {}
    return alarm | whole | held | {"goes_on": {"step": step, "std": float(alarm["std"]), "text": text}}
