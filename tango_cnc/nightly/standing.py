"""Alarms of other nights that nobody has closed: how large they are by tonight, and who has them."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ..history.answers import of_machine
from ..loaded import Event
from ..report.compensated import as_loaded, dated
from ..report.tonight import UNSURE, is_gone, is_over, is_unseen, only_set_up, shows, size_of
from ..report.words import unforeseen
from ..state.changes import change
from ..terms import SCALES
from ..texts import Said, instead, joined, say
from .dates import LISTED, date_of
from .ports import Past
from .words import value

LAST_NIGHT = "last night"
# What some alarms have:
BESIDE = ("alike", "alike_by", "compensation", "ignored", "again", "follows", "undoes", "repair", "warmer")
TONIGHT = "tonight"  # after every moment on record


def standing(
    past: Past,
    machine: str,
    day: float,
    parameters: Mapping[str, Any],
    kind: str,
    events: Sequence[Event] = (),
    tonight: Collection[str] = (),
) -> list[dict[str, Any]]:
    """history, machine, day, what is known tonight, kind of night, what happened to compensations, ids of alarms that go on tonight
    → alarms of other nights that nobody has closed, each as the last night that told it.

    Unanswered ones come first, and what does more to a part before what does less.

    Closed is accept, repaired, and ignore until its date has passed; who acknowledged one is named with it.
    """
    if not past.knows(machine):
        return []
    today = date_of(day)
    held = of_machine(past, machine, today, LISTED)
    known, when = (parameters, "") if parameters else _known(past, machine)
    found: list[dict[str, Any]] = []
    measured: tuple[str, str] | None = (today, TONIGHT) if kind == "full" and parameters else None
    seen = {*tonight, *held.parts}
    for stored in past.alarmed(machine, LISTED):
        for alarm in stored.record["alarms"]:
            if alarm["id"] and alarm["id"] in seen:
                continue
            seen.add(alarm["id"])
            decision = held.decided.get(alarm["id"])
            if held.closed(alarm["id"]) or (decision is not None and decision.action == "ignore"):
                continue
            if measured is None:
                measured = _measured(past, machine)
            full = measured[0] if measured[1] > stored.night.start_utc else ""
            told = {key: alarm.get(key) for key in ("id", "cause", "parameter", "text", "since", "size", "std", "unit", "sigmas")}
            told |= {key: alarm.get(key) for key in ("rate_per_day", "steady", "on_part_um", "on_part", "do", "instead", "owner")}
            answered = decision is not None and decision.action == "acknowledge"
            told |= {key: dated(alarm, stored.record)[key] for key in ("utc", "was")}
            told |= {key: alarm[key] for key in BESIDE if alarm.get(key)}
            told |= {"night": _first_night(alarm, stored.record), "decision": "acknowledge" if answered else None}
            told["text"] = unforeseen(instead(alarm["text"], LAST_NIGHT, str(alarm["since"])), told["night"])
            told["do"] = unforeseen(alarm["do"], told["night"]) if alarm.get("do") else alarm.get("do")
            now = _was(alarm, stored.record, known, when) if when else _now(alarm, stored.record, parameters, kind)
            told |= {"now": now, "total": _total(alarm, stored.record, known)}
            gone = is_gone(told["now"])
            told["confirmed"] = full if full and told["now"] and not gone and not is_unseen(told["now"]) else None
            told |= {"do": say("night.gone_do")} if gone else {}
            told |= since_full(told, measured[0] if measured[1] >= stored.night.start_utc else "")  # or by itself
            told = as_loaded(told, events)
            if answered and decision is not None:
                told["owner"] = decision.owner
            found.append(told)
    return by_urgency([_with_later(a, found) for a in _as_ended(found)])


def by_urgency(alarms: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """alarms of other nights → the same: unanswered ones first, then by what they do to a part; after them what has gone back."""
    return sorted(alarms, key=_urgency)


def _as_ended(found: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """alarms of other nights → the same; one that went back, and its way back, keep what the night saw that found it gone.

    What moved after that night is another event, with an alarm of its own.
    """
    back = {str(a["undoes"]["alarm"]): a["undoes"] | {"gone_by": str(a["id"])[:10]} for a in found if a.get("undoes")}

    def told(a: dict[str, Any]) -> dict[str, Any]:
        if a.get("undoes"):
            return a | {"now": "", "total": a["size"], "confirmed": None, "ended": True}
        if (u := back.get(str(a["id"]))) is None or u.get("left") is None or u.get("std") is None:
            return a
        then = say("night.alarms.of_night", told=value(float(u["left"]), str(a["unit"]), float(u["std"])), night=u["gone_by"])
        left = say("night.alarms.gone_again_left", told=then)
        return a | {
            "now": left,
            "total": float(u["left"]),
            "confirmed": None,
            "do": say("night.gone_do"),
            "ended": True,
            "gone_by": u["gone_by"],
        }

    return [told(a) for a in found]


def _first_night(alarm: Mapping[str, Any], record: Mapping[str, Any]) -> str:
    """alarm, the last night that told it → date of the first one: an id begins with it."""
    return str(alarm["id"])[:10] if alarm.get("goes_on") else str(record["night"])


def _with_later(alarm: dict[str, Any], every: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """alarm of another night, all of them → the same; with what it is now is said what later alarms of its parameter have added."""
    same = [a for a in every if (a["cause"], a["parameter"]) == (alarm["cause"], alarm["parameter"])]
    later = [a for a in same if a["night"] > alarm["night"] and a["size"] and not a["rate_per_day"]]
    if not later or not isinstance(alarm["now"], Said) or alarm["now"].key != "night.alarms.now":
        return alarm
    came = [
        say("night.alarms.came", size=value(a["size"], a["unit"], a["std"]), night=a["night"])
        for a in sorted(later, key=lambda a: str(a["night"]))
    ]
    return alarm | {"now": joined("; ", (alarm["now"], *came))}


def unheard(past: Past, machine: str, day: float, parameters: Mapping[str, Any], kind: str) -> list[dict[str, Any]]:
    """history, machine, day, what is known tonight, kind of night → alarms that somebody ignores until a day that is not over
    (`standing` has no such), what does more to a part first, with what they are by now.
    """
    if not past.knows(machine):
        return []
    today, last = date_of(day), {d.alarm: d for d in past.decisions(machine)}
    wanted = {key: d for key, d in last.items() if d.action == "ignore" and (d.until or "") >= today}
    if not wanted:
        return []
    known, when = (parameters, "") if parameters else _known(past, machine)
    found = []
    for stored in past.alarmed(machine, LISTED):
        for a in stored.record["alarms"]:
            if (d := wanted.pop(a["id"], None)) is None:  # each as the last night that told it
                continue
            now = _was(a, stored.record, known, when) if when else _now(a, stored.record, parameters, kind)
            told = {key: a.get(key) for key in ("cause", "parameter", "since", "size", "std", "unit", "on_part_um")}
            text = unforeseen(instead(a["text"], LAST_NIGHT, str(a["since"])), _first_night(a, stored.record))
            told |= {"text": text, "now": now, "total": _total(a, stored.record, known)}
            told |= {key: a[key] for key in ("repair", "warmer") if a.get(key)}
            found.append({"alarm": a["id"], "night": _first_night(a, stored.record), "owner": d.owner, "until": d.until} | told)
    return sorted(found, key=lambda a: -abs(a["on_part_um"] or 0.0))


def _known(past: Past, machine: str) -> tuple[Mapping[str, Any], str]:
    """history, machine → what its last believed night knew of its parameters, and the date of it; nothing, '' for none.

    A night that is in doubt, or did not measure, knows nothing of its own: an alarm stays as large as it was seen last.
    """
    night = next((n for n in past.nights(machine, last=LISTED) if n.verdict not in ("doubtful", "not_measured")), None)
    return ({}, "") if night is None else (past.night(night.entry).record.get("parameters") or {}, night.night)


def _was(alarm: Mapping[str, Any], record: Mapping[str, Any], parameters: Mapping[str, Any], when: str) -> str:
    """alarm, its night, what is known since and from when → what moved as far as it was seen then; '' for what is no parameter."""
    then, now = own_of(record.get("parameters") or {}, alarm["parameter"]), own_of(parameters, alarm["parameter"])
    change = _total(alarm, record, parameters)
    if change is None or then is None or now is None:
        return ""
    spread = math.hypot(now["std"], then["std"])
    told, size = value(change, now["unit"], spread), float(alarm.get("size") or 0.0)
    return say(f"night.alarms.{'was' if shows(size, change, spread) else 'unseen_then'}", told=told, night=when)


def _measured(past: Past, machine: str) -> tuple[str, str]:
    """history, machine → date and start (UTC) of its last whole full measurement that was believed; '', '' for none."""
    nights = past.nights(machine, last=LISTED)
    good = (n for n in nights if n.kind == "full" and n.status == "complete" and n.verdict not in ("doubtful", "not_measured"))
    return next(((n.night, n.start_utc) for n in good), ("", ""))


def since_full(alarm: Mapping[str, Any], full: str) -> dict[str, str]:
    """alarm, date of a full measurement after the change ('': none yet) → what it then means for a part and what to do, where the
    alarm asks for that measurement because nothing names a cause.
    """
    if not full or alarm["cause"] != "unknown":
        return {}
    return {"on_part": say("cause.unknown.on_part_full", night=full), "do": say("cause.unknown.do_full", night=full)}


def _urgency(alarm: Mapping[str, Any]) -> tuple[bool, bool, bool, bool, float]:
    """alarm of another night → its place: what has gone back after what stands, and its way back after it; unanswered ones first,
    then by what they do to a part as far as they stand now.
    """
    grown = abs(alarm["total"] / alarm["size"]) if alarm["total"] is not None and alarm["size"] else 1.0
    answered = alarm["decision"] is not None
    over = is_over(alarm), bool(alarm.get("undoes"))
    probe = only_set_up(alarm) and change(alarm["cause"]).of_the_probe
    return *over, answered, probe, -size_of(alarm) * grown


def _now(alarm: Mapping[str, Any], record: Mapping[str, Any], parameters: Mapping[str, Any], kind: str) -> str:
    """alarm, its night, what is known tonight → whether what moved is still where it went; '' for what is no one parameter."""
    then, now = own_of(record.get("parameters") or {}, alarm["parameter"]), own_of(parameters, alarm["parameter"])
    change = _total(alarm, record, parameters)
    if change is None or then is None or now is None:
        return ""
    size = float(alarm["size"])
    if (whole := (alarm.get("ignored") or {}).get("total")) is not None:  # its text says how far it is in all
        change, size = change + float(whole) - size, float(whole)
    spread = math.hypot(now["std"], then["std"])
    told = value(change, now["unit"], spread)
    return still(size, change, spread, told, confirmed=kind == "full" and bool(now.get("seen")))


def still(size: float, change: float, std: float, told: str, *, confirmed: bool) -> Said:
    """size of an alarm, change tonight, its standard deviation, the change as a text, whether a full measurement has seen it →
    whether what moved is still where it went; gone again, as far as tonight can tell, where it no longer shows, though it is not
    sure to be elsewhere.
    """
    slack = max(3 * std, 0.25 * abs(size))
    if abs(change - size) < slack:
        if not shows(size, change, std):
            return say("night.alarms.unseen", told=told)
        return say(f"night.alarms.{'confirmed' if confirmed and abs(change) > UNSURE * std else 'still_there'}", told=told)
    return say("night.alarms.gone_again_left", told=told) if abs(change) < slack else say("night.alarms.now", told=told)


def own_of(parameters: Mapping[str, Any], name: str) -> Mapping[str, Any] | None:
    """what a night knows, parameter of an alarm → what it knows of that: of scales that change alike their mean; None of others."""
    if name != "scales":
        return parameters.get(name)
    scales = [parameters[n] for n in SCALES if n in parameters]
    if len(scales) < len(SCALES):
        return None
    numbers = {key: [p.get(key) for p in scales] for key in ("value", "std", "change")}
    told = {key: None if None in values else float(np.mean(values)) for key, values in numbers.items()}
    return told | {"unit": scales[0]["unit"], "seen": all(p.get("seen") for p in scales)}


def _total(alarm: Mapping[str, Any], record: Mapping[str, Any], parameters: Mapping[str, Any]) -> float | None:
    """alarm, its night, what is known tonight → change since before the alarm, in its unit; None for what is no one parameter."""
    then, now = own_of(record.get("parameters") or {}, alarm["parameter"]), own_of(parameters, alarm["parameter"])
    if then is None or now is None or then.get("change") is None:
        return None
    made_before = alarm.get("rate_per_day") or alarm.get("repair")  # a drift, or what a repair left, was not made in its night
    step = alarm["size"] if made_before else then["change"]
    return float(now["value"] - (then["value"] - step))
