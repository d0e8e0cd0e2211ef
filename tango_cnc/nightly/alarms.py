"""What changed → an alarm: its text, since when, what it does to parts, what to do, and whether somebody wants to hear of it."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from ..history.records import merged
from ..loaded import Event
from ..records import Array, Cell
from ..report.compensated import as_loaded, dated
from ..report.texts import texts
from ..report.words import unforeseen
from ..state import Frame, Named, State, Tonight
from ..state.changes import change
from ..state.effect import Effect, alike, like_the_stylus, on_parts
from ..state.filter import sigma_of
from ..terms import SCALES
from ..texts import Said, instead, joined, say
from .ports import Past
from .words import LONG, cause_texts, changed, is_gone, on_part, value

LAST_NIGHT = "last night"
NEAR = 1.5  # days within which the night before is last night
EVENING = timedelta(hours=6)  # before midnight: what begins later belongs to the next day
FAR = 1e-6  # p-value of what a story leaves, below which it is not the whole story
MOSTLY = 0.95  # share of what has changed that a story explains for it to be reported as the whole one
SECOND = 1.0 / 86_400  # d: what is on record is cut to the second
TONIGHT = "tonight"  # after every moment on record
LISTED = 60  # nights looked back over for the last one with a result
TURNED = re.compile(r"E[ABC]0([XYZABCS])")


@dataclass(frozen=True)
class Known:
    """What alarms are told by: the cell, what is followed, and (m, 3, p) mm of the volume by unknown."""

    cell: Cell
    followed: Frame
    lever: Array

    def worst(self, moved: Array) -> float:
        """(p,) change of the unknowns → µm at the worst pose of the volume."""
        return float(np.linalg.norm(self.lever @ moved, axis=1).max()) * 1e3

    def spread(self, directions: Array, size: Array, std: Array) -> float:
        """(p, m) directions, (m,) sizes, (m,) their standard deviations → mm, of the error at the pose where it is largest."""
        error = self.lever @ (directions @ size)
        pose = int(np.argmax(np.linalg.norm(error, axis=1)))
        along = (self.lever[pose] @ directions).T @ error[pose] / max(float(np.linalg.norm(error[pose])), 1e-12)
        return float(np.linalg.norm(along * np.where(np.isfinite(std), std, 0.0)))


@dataclass(frozen=True)
class Since:
    """The last night on which the machine was as before: its local date, and in words."""

    date: str
    words: str


def date_of(day: float) -> str:
    """days since 1970-01-01 UTC → 2026-11-23, the date of the night that begins then."""
    return night_of((datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=day)).astimezone())


def night_of(begun: datetime) -> str:
    """moment at which a night begins, with its zone → 2026-11-23, the date of the morning after it.

    It is read on that morning, so a night has this one date on every page: a night from 23:00 to 01:00 is of the second day.
    """
    return (begun + EVENING).strftime("%Y-%m-%d")


def _day(stamp: str) -> float:
    """2026-11-23T02:00:00Z → days since 1970-01-01 UTC."""
    return datetime.fromisoformat(stamp).timestamp() / 86_400


def since(past: Past, machine: str, day: float, every_days: float = 1.0) -> Since:
    """history, machine, day of tonight, days from night to night → the last night that left a result; nights in between without
    one are counted, also those that are not on record one by one.
    """
    found = past.latest_knowledge(machine)
    if found is None:
        return Since("", say("night.alarms.newest_night"))
    last = found[0]
    newer = [n for n in past.nights(machine, last=LISTED) if n.start_utc > last.end_utc]
    newer = [n for n in newer if n.status != "refused" or _day(n.end_utc) < day - SECOND]  # not by tonight, which measures
    if not newer and day - _day(last.start_utc) < NEAR:
        return Since(last.night, say("night.alarms.last_night"))
    what = "not_measured" if all(n.verdict == "not_measured" for n in newer) else "no_result"
    count = max(len(newer), missing(day - _day(last.start_utc), every_days)) if newer else 0
    how_many = "long" if count > LONG else "many" if count > 1 else "one"
    skipped = say(f"night.alarms.{what}_{how_many}", count=count) if newer else ""
    return Since(last.night, joined("", (last.night, skipped)))


def missing(days: float, every_days: float) -> int:
    """days between two nights that measured, days from night to night → nights missing between them."""
    return int(days / every_days + 0.5) - 1


def alarms_of(k: Known, before: Since, ahead: State, tonight: Tonight, named: Named | None) -> list[dict[str, Any]]:
    """what is known, since when, prediction, test of the night, its best story → the alarms of the record: one for each cause, so
    that each is answered by itself, and one for what they do not explain.
    """
    whole = tonight.statistic / tonight.scale
    if named is None or (named.remains < FAR and named.told < 0.5 * whole):
        return [_unnamed(k, before, ahead, tonight, named)]
    found = [of_cause(k, before, one) for one in named.all]
    left = whole - named.told
    plain = bool(named.more) and named.more[0].explained >= 0.5 * (left - tonight.dof)
    if plain or (named.all[-1].remains < FAR and named.told < MOSTLY * whole):
        found.append(_rest(k, before, named, left - tonight.dof))
    return found


def of_cause(k: Known, before: Since, named: Named) -> dict[str, Any]:
    """what is known, since when, a cause with its size → its alarm."""
    h = named.hypothesis
    size, std, text = said_of(k, before, named)
    alarm = _alarm(before, h.cause, h.parameter, text, named.sigmas) | {"size": size, "std": std, "unit": h.unit}
    alarm["instead"] = others(k, h.parameter, named.instead)
    effect, on_part, do = effect_of(k, h.cause, h.parameter, size, h.unit, h.directions @ named.size, before.date)
    if h.cause == "stylus" and (pivot := _pivot(k, named)) is not None:
        name, found = pivot
        (axis, angle), *_ = found.turned.items()
        told = {"axis": axis, "angle": f"{abs(angle):.0f}", "effect": f"{found.worst:.1f} µm", "since": before.date}
        effect, on_part, do = found.worst, texts()("part.pivot_since", **told), texts()("part.pivot_do", axis=axis)
        alarm["instead"] = [name, *(x for x in alarm["instead"] if x != name)]
    return alarm | {"on_part_um": effect, "on_part": on_part, "do": do}


def _alarm(before: Since, cause: str, parameter: str, text: str, sigmas: float) -> dict[str, Any]:
    told: dict[str, Any] = {"id": "", "since": before.date, "rate_per_day": None, "instead": []}
    told |= {"cause": cause, "parameter": parameter}
    return told | {"text": text, "size": 0.0, "std": 0.0, "unit": "", "sigmas": sigmas}


def _unnamed(k: Known, before: Since, ahead: State, tonight: Tonight, named: Named | None) -> dict[str, Any]:
    """→ the alarm of a night that no cause explains: single touches scatter, or the machine is not as it was."""
    if tonight.p_noise < tonight.p_machine:
        dof = max(tonight.noise[1], 1)
        size = float(np.sqrt(tonight.noise[0] / dof))
        sigmas = float(np.sqrt(2 * max(-np.log(max(tonight.p_noise, 1e-300)), 0.0)))
        usual = f"{sigma_of(ahead) * 1e3:.2f} µm"
        text = texts()("changed.noise_level", size=f"{size * 1e3:.2f} µm", usual=usual)
        alarm = _alarm(before, "noise_level", "probe", text, sigmas)
        alarm |= {"size": size, "std": size / float(np.sqrt(2 * dof)), "unit": "mm"}
    else:
        sigmas = float(np.sqrt(max(tonight.statistic / tonight.scale - tonight.dof, 0.0)))
        alarm = _alarm(before, "unknown", "several", texts()("changed.unknown"), sigmas)
        if named is not None:
            alarm["instead"] = [named.hypothesis.parameter, *named.instead]
    nothing = np.zeros(len(k.followed.names))
    told = effect_of(k, alarm["cause"], alarm["parameter"], alarm["size"], alarm["unit"], nothing, before.date)
    return alarm | dict(zip(("on_part_um", "on_part", "do"), told, strict=True))


def _rest(k: Known, before: Since, named: Named, left: float) -> dict[str, Any]:
    """→ the alarm of what the causes of the night leave, above chance: what it looks like, where it looks like anything."""
    alarm = _alarm(before, "unknown", "several", texts()("changed.rest"), float(np.sqrt(max(left, 0.0))))
    if named.more:
        first = named.more[0]
        like = said_of(k, before, first)[2]
        alarm |= {"text": texts()("changed.rest_like", like=like), "instead": [n.hypothesis.parameter for n in named.more]}
    nothing = np.zeros(len(k.followed.names))
    told = effect_of(k, "unknown", "several", 0.0, "", nothing, before.date)
    return alarm | dict(zip(("on_part_um", "on_part", "do"), told, strict=True))


def effect_of(
    k: Known, cause: str, parameter: str, size: float, unit: str, moved: Array, since: str = ""
) -> tuple[float, str, str]:
    """cause, parameter, size in its unit, (p,) change of the unknowns, date of the last night without the change ('': the size is
    the whole error) → µm at most on a part, what that means, what to do.
    """
    t = texts()
    match = TURNED.fullmatch(parameter) if cause == "axis_location" else None
    if match and match[1] in k.cell.machine.linear:
        length = _range(k.cell, match[1], 1000.0)
        effect = abs(size) * length * 1e3
        sizes = {"length": f"{length:.0f}", "effect": f"{effect:.1f} µm"}
        return effect, on_part(_key("square", since), since, axis=match[1], **sizes), t("part.square_do")
    if cause == "axis_location" and (found := on_parts(k.cell, parameter, size)) is not None:
        return found.worst, _turned(found, match[1] if match else "", unit, since), t("cause.axis_location.do")
    effect = abs(size) * 1e3 if unit == "mm" else k.worst(moved)
    return (effect, *cause_texts(cause, effect, since))


def _turned(found: Effect, tilted: str, unit: str, since: str) -> str:
    """effect on a part, tilted rotary axis or '', unit of the error, date of the change or '' → a sentence."""
    size, turned = f"{found.worst:.1f} µm", list(found.turned.items())
    if unit == "mm" and turned:
        (axis, angle), *more = turned
        told = {"axis": axis, "angle": f"{abs(angle):.0f}", "effect": size}
        if not more:
            return on_part(_key("turned", since), since, **told)
        return on_part(_key("turned_both", since), since, **told, other=more[0][0], other_angle=f"{abs(more[0][1]):.0f}")
    if tilted and tilted != "S":
        return on_part(_key("tilted", since), since, axis=tilted, effect=size)
    return cause_texts("axis_location", found.worst, since)[0]


def _key(name: str, since: str) -> str:
    return f"part.{name}_since" if since else f"part.{name}"


def others(k: Known, parameter: str, near: Sequence[str] = ()) -> list[str]:
    """what is known, parameter that is named, stories that fit nearly as well → what else it may be: these, and the locations that
    no touch on this machine tells from it.
    """
    return [name for name in dict.fromkeys((*alike(k.cell.machine, parameter), *near)) if name != parameter]


def _pivot(k: Known, named: Named) -> tuple[str, Effect] | None:
    """what is known, a stylus that has moved → location that no touch tells from it, and what that does to a part; or None."""
    moved, spread = np.zeros(3), np.zeros(3)
    for axis, size, std in zip(named.hypothesis.axes, named.size, named.std, strict=True):
        moved["XYZ".index(axis)], spread["XYZ".index(axis)] = size, std if np.isfinite(std) else 0.0
    for name, direction in like_the_stylus(k.cell.machine).items():
        along = np.array(direction)
        size = float(moved @ along / (along @ along))
        if np.all(np.abs(moved - size * along) <= np.maximum(4 * spread, 0.1 * abs(size))):
            found = on_parts(k.cell, name, size)
            if found is not None and found.turned:
                return name, found
    return None


def _range(cell: Cell, axis: str, endless: float) -> float:
    """cell, axis → mm or rad of its travel; `endless` where none is stated."""
    travel = next((a.travel for a in cell.machine.axes if a.name == axis), None)
    return endless if travel is None else travel[1] - travel[0]


def said_of(k: Known, before: Since, named: Named) -> tuple[float, float, str]:
    """what is known, since when, a cause with its size → size, standard deviation, a sentence without its full stop."""
    h = named.hypothesis
    if h.cause == "temperature":
        worst = k.worst(h.directions @ named.size)
        return worst / 1e3, k.spread(h.directions, named.size, named.std), texts()("changed.temperature", size=f"{worst:.1f} µm")
    if h.cause == "ball" or (len(h.axes) == 3 and h.cause in ("table", "stylus")):
        size = named.length
        towards = ", ".join(f"{a} {v * 1e3:+.1f} µm" for a, v in zip(h.axes, named.size, strict=True))
        finite = named.std[np.isfinite(named.std)]
        name = {"name": _place(h.parameter)} if h.cause == "ball" else {}
        told = texts()(f"changed.{h.cause}", size=f"{size * 1e3:.1f} µm", towards=towards, since=before.words, **name)
        return size, float(finite.max()) if len(finite) else 0.0, told
    size, std = float(named.size[0]), float(named.std[0])
    told = value(size, h.unit, std)
    if h.cause in ("facet", "pretravel", "scales"):
        name = {"name": _place(h.parameter)} if h.cause == "facet" else {}
        return size, std, texts()(f"changed.{h.cause}", size=told, since=before.words, **name)
    return size, std, changed(h.parameter, told, before.words)


def _place(parameter: str) -> str:
    """facet 12, ball 1 → the same as a text."""
    kind, _, name = parameter.partition(" ")
    return say(f"followed.{kind}", name=name)


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
    today, last = date_of(day), {d.alarm: d for d in past.decisions(machine)}
    known, when = (parameters, "") if parameters else _known(past, machine)
    found: list[dict[str, Any]] = []
    measured: tuple[str, str] | None = (today, TONIGHT) if kind == "full" and parameters else None
    seen = set(tonight)
    for stored in past.alarmed(machine, LISTED):
        seen |= merged(stored.record["alarms"])
        for alarm in stored.record["alarms"]:
            if alarm["id"] and alarm["id"] in seen:
                continue
            seen.add(alarm["id"])
            decision = last.get(alarm["id"])
            if decision is not None and decision.action in ("accept", "repaired"):
                continue
            if decision is not None and decision.action == "ignore" and (decision.until or "") >= today:
                continue
            if measured is None:
                measured = _measured(past, machine)
            full = measured[0] if measured[1] > stored.night.start_utc else ""
            told = {key: alarm.get(key) for key in ("id", "cause", "parameter", "text", "since", "size", "std", "unit", "sigmas")}
            told |= {key: alarm.get(key) for key in ("rate_per_day", "steady", "on_part_um", "on_part", "do", "instead", "owner")}
            answered = decision is not None and decision.action == "acknowledge"
            told |= {key: dated(alarm, stored.record)[key] for key in ("utc", "was")}
            told |= {key: alarm[key] for key in ("compensation", "ignored", "again", "follows") if alarm.get(key)}
            told |= {"night": _first_night(alarm, stored.record), "decision": "acknowledge" if answered else None}
            told["text"] = unforeseen(instead(alarm["text"], LAST_NIGHT, str(alarm["since"])))
            now = _was(alarm, stored.record, known, when) if when else _now(alarm, stored.record, parameters, kind)
            told |= {"now": now, "total": _total(alarm, stored.record, known)}
            gone = is_gone(told["now"])
            told["confirmed"] = full if full and told["now"] and not gone else None
            told |= {"do": say("night.gone_do")} if gone else {}
            told |= since_full(told, measured[0] if measured[1] >= stored.night.start_utc else "")  # or by itself
            told = as_loaded(told, events)
            if answered and decision is not None:
                told["owner"] = decision.owner
            found.append(told)
    return sorted((_with_later(a, found) for a in found), key=_urgency)


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
            text = unforeseen(instead(a["text"], LAST_NIGHT, str(a["since"])))
            told |= {"text": text, "now": now, "total": _total(a, stored.record, known)}
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
    told = value(change, now["unit"], math.hypot(now["std"], then["std"]))
    return say("night.alarms.was", told=told, night=when)


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


def _urgency(alarm: Mapping[str, Any]) -> tuple[bool, bool, float]:
    """alarm of another night → its place: unanswered ones first, then by what they do to a part as far as they stand now."""
    grown = abs(alarm["total"] / alarm["size"]) if alarm["total"] is not None and alarm["size"] else 1.0
    answered = alarm["decision"] is not None
    return answered, change(alarm["cause"]).of_the_probe, -abs(alarm["on_part_um"] or 0.0) * grown


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
    slack = max(3 * spread, 0.25 * abs(size))
    if abs(change - size) < slack:
        return say(f"night.alarms.{'confirmed' if kind == 'full' and now.get('seen') else 'still_there'}", told=told)
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
