"""What people have answered to alarms, held against tonight: a repair that has to show, and an alarm that nobody wants to hear.

A repair is believed when it is measured: what an alarm had named is compared with the night before it. What is ignored is what was
seen, with its interval and, of a drift, with its rate; what goes beyond that alarms again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np

from ..history import Decision
from ..history.answers import of_machine
from ..report.repeated import first_night
from ..state import Named, State, reopened
from ..texts import joined, say
from ..texts.number import number
from .alarms import Known, effect_of, said_of
from .back import gone, unclosed, went_back
from .dates import Since, date_of
from .moved import LEFT, SURE, Moved, found_by, hypothesis_of, moved
from .ports import Past
from .words import value

OPEN = 3.0  # times what an alarm found: what a repair may move
MOST_BACK = 0.5  # share of what an alarm found that may be there still where tonight's change takes it back
FASTER = 1.25  # times the rate that was seen: an ignored drift that goes on faster is another one
WITHOUT_SIZE = ("unknown",)  # causes that leave nothing to compare with
BY_SIZE = ("noise_level", "temperature")  # causes whose alarm finds the whole of it anew every time


def repaired(past: Past, machine: str) -> tuple[Decision, ...]:
    """history, machine → repairs since the last night with a result, the last answer to each alarm; oldest first.

    The clock of who answers may be behind: what came into the history after that night is since it. One that came while it measured
    counts unless that night has judged it.
    """
    known = past.latest_knowledge(machine)
    if known is None:
        return ()
    before, last = known[0], {d.alarm: d for d in past.decisions(machine)}
    done = [d for d in last.values() if d.action == "repaired"]
    late = [d for d in done if d.utc >= before.end_utc or d.entry > before.entry]
    meanwhile = [d for d in done if d not in late and d.utc >= before.start_utc]
    judged = _judged(past.records_of([before.entry])[before.entry]) if meanwhile else set()
    return tuple(d for d in done if d in late or (d in meanwhile and d.alarm not in judged))


def _judged(record: Mapping[str, Any]) -> set[str]:
    """record of a night → alarms whose repair it has measured."""
    helped = {str(one["alarm"]) for one in record.get("repaired") or ()}
    return helped | {str(alarm["repair"]["alarm"]) for alarm in record["alarms"] if alarm.get("repair")}


# Repairs ------------------------------------------------------------------------------------------------------------


def expected(past: Past, machine: str) -> tuple[tuple[str, str], ...]:
    """history, machine → (cause, parameter) that somebody says to have repaired since the last night with a result."""
    done = found_by(past, machine, [d.alarm for d in repaired(past, machine)])
    return tuple((a["cause"], a["parameter"]) for _, a in done.values())


def may_have_moved(past: Past, machine: str, k: Known, ahead: State) -> State:
    """history, machine, what is known, predicted state → the same, open for what somebody says to have repaired."""
    for _, wrong in found_by(past, machine, [d.alarm for d in repaired(past, machine)]).values():
        h = hypothesis_of(k, wrong)
        ahead = reopened(ahead, k.followed, None if h is None else h.directions * OPEN * abs(float(wrong["size"])))
    return ahead


def after_repairs(
    past: Past, machine: str, k: Known, after: State, alarms: Sequence[dict[str, Any]]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """history, machine, what is known, state after tonight, alarms of tonight → the alarms with what repairs say to them; repairs
    that have helped, as the record has them.

    An alarm about what was repaired gives way to what is left of it: none where it is back where it was, and else one that says
    how far off it still is. Other alarms of that night say that they come after the repair.
    """
    helped: list[dict[str, Any]] = []
    still: list[dict[str, Any]] = []
    left, done = list(alarms), _judged_by_tonight(past, machine, repaired(past, machine))
    seen = _seen_last(past, machine) if done else {}
    for d, stored, wrong in _meant(past, machine, done):
        if (m := moved(past, machine, k, after, stored, wrong)) is None:
            if wrong["cause"] in WITHOUT_SIZE and not alarms:
                still.append(_nothing_changed(wrong, d))
            continue
        left = [a for a in left if not _same(a, wrong)]
        if not m.apart():
            helped.append(_helped(wrong, d, m))
        elif (found := _and_more(past, machine, k, after, stored, wrong, m)) is not None:
            helped.append(_helped(wrong, d, *found))
        else:
            still.append(_still(k, wrong, d, _as_it_was(m, seen.get(str(wrong["id"])))))
    said = done[-1] if done else None
    what = joined("", (" (", joined(", ", [h["left"] for h in helped]), ")")) if helped else ""
    if said is not None:
        told = {"owner": said.owner, "date": said.utc[:10], "what": what}
        left = [a | {"text": say("changed.after_repair", text=a["text"], **told)} for a in left]
    return [*still, *left], helped


def _seen_last(past: Past, machine: str) -> dict[str, float | None]:
    """history, machine → {alarm of another night: how far it was in the last night with a result, in its unit}."""
    known = past.latest_knowledge(machine)
    record: Mapping[str, Any] = {} if known is None else past.records_of([known[0].entry])[known[0].entry]
    return {str(a["id"]): a.get("total") for a in record.get("standing") or ()}


def _as_it_was(m: Moved, total: float | None) -> Moved:
    """what became of what was repaired, how far it was when it was → the same, held against that: who repairs a drift of 13 µm that
    began with 2.5 µm has made nothing worse.
    """
    return m if total is None or len(m.then) != 1 else replace(m, then=np.array([float(total)]))


def _judged_by_tonight(past: Past, machine: str, done: Sequence[Decision]) -> list[Decision]:
    """history, machine, repairs → those that tonight says something of. Of what had gone back already, and has moved again since,
    the night of the way back has said it: what is there now came after the repair, and has an alarm of its own.
    """
    if not done:
        return []
    decided = of_machine(past, machine).decided
    told = [(stored, a) for stored in past.alarmed(machine) for a in stored.record["alarms"]]
    back = {str(a["undoes"]["alarm"]): (stored, a) for stored, a in told if a.get("undoes")}

    def moved_since(d: Decision) -> bool:
        ends = back.get(d.alarm) or next((one for one in back.values() if one[1]["id"] == d.alarm), None)
        if ends is None:
            return False
        gone_in, way = ends[0].night.start_utc, ends[1]
        later = [a for stored, a in told if stored.night.start_utc > gone_in and _same(a, way) and not a.get("undoes")]
        return any(a["id"] not in decided or decided[a["id"]].action != "repaired" for a in later)

    return [d for d in done if not moved_since(d)]


def _meant(past: Past, machine: str, done: Sequence[Decision]) -> list[tuple[Decision, Any, dict[str, Any]]]:
    """history, machine, repairs → each with the night and the alarm that it is held against, as far as these are on record.

    Who answers `repaired` to a way back has repaired what went back: both ends of one story are one repair.
    """
    origin = found_by(past, machine, [d.alarm for d in done])
    firsts = {d.alarm: str((origin[d.alarm][1].get("undoes") or {}).get("alarm") or d.alarm) for d in done if d.alarm in origin}
    origin |= found_by(past, machine, [first for first in firsts.values() if first not in origin])
    meant: dict[str, tuple[Decision, Any, dict[str, Any]]] = {}
    for d in done:
        first = firsts.get(d.alarm, d.alarm)
        if first in origin:
            meant.setdefault(first, (d, *origin[first]))
    return list(meant.values())


def _same(alarm: Mapping[str, Any], wrong: Mapping[str, Any]) -> bool:
    """alarm of tonight, alarm that was repaired → whether they are of one thing."""
    if alarm["cause"] in WITHOUT_SIZE:
        return False
    names, others = {alarm["parameter"], *alarm.get("instead", ())}, {wrong["parameter"]}
    return bool(names & others) or alarm["parameter"] in (wrong.get("instead") or ())


def _and_more(
    past: Past, machine: str, k: Known, after: State, stored: Any, wrong: Mapping[str, Any], m: Moved
) -> tuple[Moved, Mapping[str, Any], float] | None:
    """→ of a repair that went beyond the night before its alarm: how that compares with the night before an older alarm of the same
    parameter that nobody has closed, that alarm, and what the repair began with; None where it went too far for that as well.
    """
    for older, a in unclosed(past, machine, stored, wrong):
        if len(m.now) != 1 or (first := moved(past, machine, k, after, older, a)) is None or len(first.now) != 1:
            continue
        (now,), (then,), (beyond,) = first.now, m.then, m.now
        if beyond * then < 0 and (not first.apart() or now * first.then[0] > 0):
            return first, a, float(now - beyond + then)
    return None


def _helped(
    wrong: Mapping[str, Any], d: Decision, m: Moved, older: Mapping[str, Any] | None = None, before: float | None = None
) -> dict[str, Any]:
    """→ what the record says of a repair that has put back what the alarm had named; some or all of an older alarm, too."""
    then, now, std = m.along()
    then = then if before is None else before
    told, short = went_back(wrong, m, then)
    key = "helped" if older is None else "helped_part" if m.apart() else "helped_more"
    more = {} if older is None else {"since": str(older["since"])}
    text = say(f"night.repaired.{key}", owner=d.owner, date=d.utc[:10], what=told, **more)
    found = {
        **{"alarm": d.alarm, "cause": wrong["cause"], "parameter": wrong["parameter"], "text": text, "left": short},
        **{"size": now, "std": std, "unit": m.unit, "owner": d.owner, "date": d.utc[:10]},
        **{"size_before": then, "back": now - then, "least": m.least(), "since": str((older or wrong)["since"])},
    }
    return found if older is None else found | {"also": older["id"]}


def _still(k: Known, wrong: Mapping[str, Any], d: Decision, m: Moved) -> dict[str, Any]:
    """→ the alarm of a machine that is not as it was before the alarm that was repaired."""
    then, now, std = m.along()
    since = str(wrong["since"])
    named = Named(m.what, m.now, m.std, 0.0, 0.0, 0.0, ())
    size, spread, what = said_of(k, Since(since, since), named)
    slack = max(SURE * std, LEFT * abs(then))
    way = "same" if abs(now - then) <= slack else "over" if now * then < 0 else "less" if abs(now) < abs(then) else "worse"
    told = {"owner": d.owner, "date": d.utc[:10], "what": what, "before": value(then, m.unit)}
    moved_, was = m.what.directions @ m.now, wrong.get("on_part_um")
    begun = since if way == "same" else d.utc[:10]  # before the repair parts were off by another size
    effect, on_part, _ = effect_of(k, wrong["cause"], wrong["parameter"], size, m.unit, moved_, begun)
    if was is not None and begun != since:
        before = abs(float(was) * then / float(wrong["size"])) if wrong.get("size") and len(m.then) == 1 else float(was)
        on_part = say("night.repaired.over_part", now=on_part, night=since, before=number(before, "µm", signed=False))
    return {
        **{"id": "", "since": since, "rate_per_day": None, "instead": list(wrong.get("instead") or ())},
        **{key: wrong[key] for key in ("alike", "alike_by") if wrong.get(key)},
        **{"cause": wrong["cause"], "parameter": wrong["parameter"], "text": say(f"night.repaired.{way}", **told)},
        **{"size": size, "std": spread, "unit": m.unit, "sigmas": abs(now) / max(std, 1e-15)},
        **{"on_part_um": effect, "on_part": on_part, "do": say("night.repaired.do", owner=d.owner)},
        "repair": {"alarm": d.alarm, "size_before": then, "back": now - then, "found": first_night(wrong, str(wrong["id"])[:10])},
    }


def _nothing_changed(wrong: Mapping[str, Any], d: Decision) -> dict[str, Any]:
    """→ the alarm of a machine of which nobody knew what had changed, and on which nothing has changed since."""
    text = say("night.repaired.nothing", owner=d.owner, date=d.utc[:10], since=wrong["since"])
    kept = {
        key: wrong.get(key) for key in ("cause", "parameter", "since", "size", "std", "unit", "sigmas", "on_part_um", "on_part")
    }
    return kept | {
        **{"id": "", "rate_per_day": None, "instead": list(wrong.get("instead") or ()), "text": text},
        **{
            "do": say("night.repaired.do", owner=d.owner),
            "repair": {"alarm": d.alarm, "size_before": wrong.get("size"), "found": first_night(wrong, str(wrong["id"])[:10])},
        },
    }


def undone(past: Past, machine: str, k: Known, after: State, alarms: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """history, machine, what is known, state after tonight, alarms of tonight → the same; one that takes back an older alarm that
    nobody has closed says so, with what is left.
    """
    return [_undone(past, machine, k, after, a) for a in alarms]


def _undone(past: Past, machine: str, k: Known, after: State, alarm: dict[str, Any]) -> dict[str, Any]:
    if alarm["cause"] in (*WITHOUT_SIZE, *BY_SIZE) or alarm.get("rate_per_day"):
        return alarm
    known = list(unclosed(past, machine, None, alarm))
    back = {str(a["undoes"]["alarm"]) for _, a in known if a.get("undoes")}
    for stored, a in known:
        if a.get("undoes") or a["id"] in back:  # what moves after a change has gone back is another event
            continue
        m = moved(past, machine, k, after, stored, a)
        if m is None or m.apart():
            continue
        then, now, std = m.along()
        if (len(m.then) == 1 and alarm["size"] * then > 0) or abs(now) > MOST_BACK * abs(then):
            continue  # it went on the same way, or half of it is there still: however little that says of a machine that wanders
        told = {"alarm": a["id"], "night": stored.record["night"], "size_before": then, "left": now, "std": std, "least": m.least()}
        text = gone(alarm, m, then)
        return alarm | {"text": text, "do": say("night.gone_do"), "undoes": told}
    return alarm


# What nobody wants to hear ------------------------------------------------------------------------------------------


def split(
    past: Past, machine: str, k: Known, after: State, alarms: Sequence[dict[str, Any]], day: float
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """history, machine, what is known, state after tonight, alarms, day → alarms to be heard, those that somebody ignores as the
    record has them.
    """
    heard, unheard = [], []
    for alarm in alarms:
        found = ignored(past, machine, k, after, alarm, day)
        if found is None:
            heard.append(alarm)
        elif found["beyond"]:
            told = {"owner": found["owner"], "until": found["until"], "seen": found["seen"]}
            if found["whole"] is not None:
                older, m = found["whole"]
                heard.append(_in_all(k, alarm, older, m, told))
                continue
            key = "beyond" if found["seen"] else "beyond_unknown"
            heard.append(alarm | {"text": say(f"night.ignored.{key}", text=alarm["text"], **told), "ignored": told})
        else:
            unheard.append({key: value for key, value in found.items() if key not in ("beyond", "whole")})
    return heard, unheard


def _in_all(k: Known, alarm: dict[str, Any], ignored_: Mapping[str, Any], m: Moved, told: Mapping[str, str]) -> dict[str, Any]:
    """what is known, alarm of tonight, the one it goes beyond, how far that is by now, who ignores it → the alarm with what has
    come together since before that one, which is what parts have.
    """
    then, now, std = m.along()
    now = now if len(m.now) == 1 else float(np.linalg.norm(m.now))
    since = str(ignored_["since"])
    key = "beyond_in_all" if now * then > 0 and abs(now) > abs(then) else "beyond_aside"
    text = say(f"night.ignored.{key}", text=alarm["text"], total=value(now, m.unit, std), since=since, **told)
    effect, on_part, _ = effect_of(k, alarm["cause"], alarm["parameter"], now, m.unit, m.what.directions @ m.now, since)
    whole = {**told, "total": now, "since": since}
    return alarm | {"text": text, "on_part_um": effect, "on_part": on_part, "ignored": whole}


def ignored(past: Past, machine: str, k: Known, after: State, alarm: Mapping[str, Any], day: float) -> dict[str, Any] | None:
    """→ what the record says of an alarm of a cause and parameter that somebody does not want to hear of until a later day, and
    whether it goes `beyond` what was seen then; None where nobody said so.
    """
    if not past.knows(machine):
        return None
    today, last = date_of(day), {d.alarm: d for d in past.decisions(machine)}
    wanted = {key: d for key, d in last.items() if d.action == "ignore" and (d.until or "") >= today}
    same = [
        (wanted[a["id"]], stored, a)
        for stored, a in found_by(past, machine, tuple(wanted)).values()
        if (a["cause"], a["parameter"]) == (alarm["cause"], alarm["parameter"])
    ]
    if not same:
        return None
    told = {key: alarm[key] for key in ("cause", "parameter", "text", "size", "std", "unit")}
    found = []
    for d, stored, a in same:
        beyond = _beyond(past, machine, k, after, alarm, stored, a, day)
        whole = _whole(past, machine, k, after, stored, a) if beyond else None
        found.append(told | {"owner": d.owner, "until": d.until, "seen": seen(a), "beyond": beyond, "whole": whole})
    return next((f for f in found if not f["beyond"]), found[0])


def _whole(
    past: Past, machine: str, k: Known, after: State, stored: Any, ignored_: Mapping[str, Any]
) -> tuple[Mapping[str, Any], Moved] | None:
    """→ the alarm that somebody ignores and how far that is by now, where that came at once; None of a drift, and where nothing
    is left to compare with.
    """
    if ignored_.get("rate_per_day") or ignored_["cause"] in (*WITHOUT_SIZE, *BY_SIZE):
        return None
    m = moved(past, machine, k, after, stored, ignored_)
    return None if m is None else (ignored_, m)


def _beyond(
    past: Past, machine: str, k: Known, after: State, alarm: Mapping[str, Any], stored: Any, ignored_: Mapping[str, Any], day: float
) -> bool:
    """→ whether an alarm of tonight goes beyond one that somebody ignores."""
    if ignored_["cause"] in WITHOUT_SIZE:
        return True
    if ignored_["cause"] in BY_SIZE:
        return bool(alarm["size"] > ignored_["size"] + SURE * float(np.hypot(alarm["std"], ignored_["std"])))
    if (m := moved(past, machine, k, after, stored, ignored_)) is None:
        return bool(abs(alarm["size"]) > abs(ignored_["size"]) + SURE * float(np.hypot(alarm["std"], ignored_["std"])))
    rate = float(ignored_.get("rate_per_day") or 0.0) if ignored_.get("steady", True) else 0.0
    if rate and not alarm.get("rate_per_day"):  # in one night, on top of a drift
        last = past.latest_knowledge(machine)
        waited = 1.0 if last is None else day - datetime.fromisoformat(last[0].start_utc).timestamp() / 86_400
        step, most = float(alarm["size"]) * np.sign(rate), FASTER * abs(rate) * waited
        if not -SURE * alarm["std"] <= step <= most + SURE * alarm["std"]:
            return True
    days = day - datetime.fromisoformat(stored.night.start_utc).timestamp() / 86_400
    size = float(np.linalg.norm(m.then))
    return m.beyond(1.0 + FASTER * abs(rate) * max(days, 0.0) / max(size, 1e-15))


def seen(alarm: Mapping[str, Any]) -> str:
    """alarm → what was seen of it: size with its interval, and the rate of a drift; '' for one that names no cause."""
    if alarm["cause"] in WITHOUT_SIZE:
        return ""
    size = value(float(alarm["size"]), str(alarm["unit"]) or "mm", float(alarm["std"]))
    rate = alarm.get("rate_per_day") if alarm.get("steady", True) else None
    return say("night.ignored.rate", size=size, rate=value(float(rate), str(alarm["unit"]))) if rate else size


def meaning(past: Past, machine: str, d: Decision) -> str:
    """history, machine, a decision about one of its alarms → what follows from it, as sentences."""
    if d.action != "ignore":
        return say(f"cli.history.decided_{d.action}")
    what = seen(found_by(past, machine, [d.alarm])[d.alarm][1])
    return (
        say("cli.history.decided_ignore", until=d.until, seen=what)
        if what
        else say("cli.history.decided_ignore_unknown", until=d.until)
    )
