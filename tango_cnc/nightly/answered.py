"""What people have answered to alarms, held against tonight: a repair that has to show, and an alarm that nobody wants to hear.

A repair is believed when it is measured: what an alarm had named is compared with the night before it. What is ignored is what was
seen, with its interval and, of a drift, with its rate; what goes beyond that alarms again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from ..history import Decision, Knowledge
from ..records import Array
from ..state import Hypothesis, Named, State, hypotheses, reopened
from ..texts import joined, say
from .alarms import LISTED, Known, Since, date_of, effect_of, said_of
from .ports import Past
from .words import value

SURE = 3.0  # standard deviations by which what is left, or what was added, has to stand out
OPEN = 3.0  # times what an alarm found: what a repair may move
LEFT = 0.1  # share of what an alarm found that a repair may leave
FASTER = 1.25  # times the rate that was seen: an ignored drift that goes on faster is another one
WITHOUT_SIZE = ("unknown",)  # causes that leave nothing to compare with
BY_SIZE = ("noise_level", "temperature")  # causes whose alarm finds the whole of it anew every time


@dataclass(frozen=True)
class Moved:
    """How far what an alarm named has gone, along each of its directions, since the night before it: then, and by tonight."""

    then: Array  # (m,) as the night of the alarm found it
    now: Array  # (m,)
    std: Array  # (m,) of the difference to the night before, tonight
    std_then: Array  # (m,)
    wander: Array  # (m,) standard deviation of what a sound machine has moved since
    what: Hypothesis

    @property
    def unit(self) -> str:
        """→ of its sizes."""
        return self.what.unit

    def along(self) -> tuple[float, float, float]:
        """→ size then, size now along the same direction, standard deviation of the latter: signed where it is one number."""
        if len(self.then) == 1:
            return float(self.then[0]), float(self.now[0]), float(self.std[0])
        size: float = float(np.linalg.norm(self.then))
        way: Array = self.then / (size if size > 0 else 1.0)
        return size, float(way @ self.now), float(np.linalg.norm(way * self.std))

    def apart(self) -> bool:
        """→ whether what is left of it stands out: it is not as it was before the alarm."""
        left, whole = float(np.linalg.norm(self.now)), float(np.linalg.norm(self.then))
        return bool(np.any(np.abs(self.now) > SURE * np.hypot(self.std, self.wander))) and left > LEFT * whole

    def beyond(self, grown: float) -> bool:
        """factor that it may have grown by → whether it is farther from where it was, on any way, than what was seen."""
        whole = self.then * max(grown, 1.0)
        share = float(np.clip(self.now @ whole / max(float(whole @ whole), 1e-30), 0.0, 1.0))
        spread = np.hypot(np.hypot(self.std, self.wander), self.std_then * share * max(grown, 1.0))
        return bool(np.any(np.abs(self.now - share * whole) > SURE * spread))


def repaired(past: Past, machine: str) -> tuple[Decision, ...]:
    """history, machine → repairs since the last night with a result, the last answer to each alarm; oldest first."""
    before = past.latest_knowledge(machine)
    if before is None:
        return ()
    last = {d.alarm: d for d in past.decisions(machine)}
    return tuple(d for d in last.values() if d.action == "repaired" and d.utc >= before[0].end_utc)


def found_by(past: Past, machine: str, wanted: Sequence[str]) -> dict[str, tuple[Any, dict[str, Any]]]:
    """history, machine, ids of alarms → {id: the night that found it, the alarm}."""
    if not wanted:
        return {}
    return {a["id"]: (s, a) for s in past.alarmed(machine) for a in s.record["alarms"] if a["id"] in wanted}


def moved(past: Past, machine: str, k: Known, after: State, stored: Any, alarm: Mapping[str, Any]) -> Moved | None:
    """history, machine, what is known, state after tonight, night of an alarm, the alarm → how far it has moved; None where the
    alarm has no direction, and where the history lacks the night before it.
    """
    found, before = past.night(stored.night.entry).knowledge, _before(past, machine, stored, alarm)
    if found is None or before is None or (h := _hypothesis(k, alarm)) is None:
        return None
    names = k.followed.names
    known = [_aligned(one, names) for one in (before[0], found)]
    if known[0] is None or known[1] is None:
        return None
    (was, var_was), (then, var_then) = known[0], known[1]
    day = datetime.fromisoformat(before[1]).timestamp() / 86_400
    onto = np.linalg.pinv(h.directions)
    changed_, now = onto @ (then - was), onto @ (after.mean[: len(names)] - was)
    if alarm.get("repair"):  # what a repair left: its night found it, and did not make it
        changed_ = np.full(len(onto), float(alarm["size"])) if len(onto) == 1 else now
        was = then - h.directions @ changed_
        now = onto @ (after.mean[: len(names)] - was)
    p = len(names)
    std, std_then = (np.sqrt(np.diag(onto @ (var_was + var) @ onto.T)) for var in (after.covariance[:p, :p], var_then))
    wander = np.sqrt(onto**2 @ after.rates[:p] * max(after.day - day, 0.0))
    return Moved(changed_, now, std, std_then, wander, h)


def _hypothesis(k: Known, alarm: Mapping[str, Any]) -> Hypothesis | None:
    """what is known, alarm → the directions that it names; None for one without."""
    tried = hypotheses(k.followed, None)
    return next((h for h in tried if (h.cause, h.parameter) == (alarm["cause"], alarm["parameter"])), None)


def _before(past: Past, machine: str, stored: Any, alarm: Mapping[str, Any]) -> tuple[Knowledge, str] | None:
    """→ what was known before an alarm, and when: of a drift on the night that it is reckoned from, else on the last one before."""
    nights = [n for n in past.nights(machine) if n.start_utc < stored.night.start_utc and n.touches]
    if alarm.get("rate_per_day"):
        nights = [n for n in nights if n.night <= str(alarm["since"])]
    for n in nights[:LISTED]:
        if (known := past.night(n.entry).knowledge) is not None:
            return known, n.start_utc
    return None


def _aligned(known: Knowledge, names: Sequence[str]) -> tuple[Array, Array] | None:
    """unknowns of a night, names that are followed → (p,) values, (p, p) covariance; None where it does not have them all."""
    place = {name: i for i, name in enumerate(known.names)}
    if any(name not in place for name in names):
        return None
    rows = [place[name] for name in names]
    return np.asarray(known.values)[rows], np.asarray(known.covariance)[np.ix_(rows, rows)]


# Repairs ------------------------------------------------------------------------------------------------------------


def expected(past: Past, machine: str) -> tuple[tuple[str, str], ...]:
    """history, machine → (cause, parameter) that somebody says to have repaired since the last night with a result."""
    done = found_by(past, machine, [d.alarm for d in repaired(past, machine)])
    return tuple((a["cause"], a["parameter"]) for _, a in done.values())


def may_have_moved(past: Past, machine: str, k: Known, ahead: State) -> State:
    """history, machine, what is known, predicted state → the same, open for what somebody says to have repaired."""
    for _, wrong in found_by(past, machine, [d.alarm for d in repaired(past, machine)]).values():
        h = _hypothesis(k, wrong)
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
    left, done = list(alarms), repaired(past, machine)
    origin = found_by(past, machine, [d.alarm for d in done])
    for d in done:
        if d.alarm not in origin:
            continue
        stored, wrong = origin[d.alarm]
        if (m := moved(past, machine, k, after, stored, wrong)) is None:
            if wrong["cause"] in WITHOUT_SIZE and not alarms:
                still.append(_nothing_changed(wrong, d))
            continue
        left = [a for a in left if not _same(a, wrong)]
        if m.apart():
            still.append(_still(k, wrong, d, m))
        else:
            helped.append(_helped(wrong, d, m))
    said = done[-1] if done else None
    what = joined("", (" (", joined(", ", [h["left"] for h in helped]), ")")) if helped else ""
    if said is not None:
        told = {"owner": said.owner, "date": said.utc[:10], "what": what}
        left = [a | {"text": say("changed.after_repair", text=a["text"], **told)} for a in left]
    return [*still, *left], helped


def _same(alarm: Mapping[str, Any], wrong: Mapping[str, Any]) -> bool:
    """alarm of tonight, alarm that was repaired → whether they are of one thing."""
    if alarm["cause"] in WITHOUT_SIZE:
        return False
    names, others = {alarm["parameter"], *alarm.get("instead", ())}, {wrong["parameter"]}
    return bool(names & others) or alarm["parameter"] in (wrong.get("instead") or ())


def _helped(wrong: Mapping[str, Any], d: Decision, m: Moved) -> dict[str, Any]:
    _, now, std = m.along()
    told = value(now, m.unit, std)
    left = say("night.repaired.left", name=wrong["parameter"], told=told)
    text = say("night.repaired.helped", owner=d.owner, date=d.utc[:10], left=left)
    return {
        **{"alarm": d.alarm, "cause": wrong["cause"], "parameter": wrong["parameter"], "text": text, "left": left},
        **{"size": now, "std": std, "unit": m.unit, "owner": d.owner, "date": d.utc[:10]},
    }


def _still(k: Known, wrong: Mapping[str, Any], d: Decision, m: Moved) -> dict[str, Any]:
    """→ the alarm of a machine that is not as it was before the alarm that was repaired."""
    then, now, std = m.along()
    since = str(wrong["since"])
    named = Named(m.what, m.now, m.std, 0.0, 0.0, 0.0, ())
    size, spread, what = said_of(k, Since(since, since), named)
    slack = max(SURE * std, LEFT * abs(then))
    way = "same" if abs(now - then) <= slack else "over" if now * then < 0 else "less" if abs(now) < abs(then) else "worse"
    told = {"owner": d.owner, "date": d.utc[:10], "what": what, "before": value(then, m.unit)}
    effect, on_part, _ = effect_of(k, wrong["cause"], wrong["parameter"], size, m.unit, m.what.directions @ m.now, since)
    return {
        **{"id": "", "since": since, "rate_per_day": None, "instead": list(wrong.get("instead") or ())},
        **{"cause": wrong["cause"], "parameter": wrong["parameter"], "text": say(f"night.repaired.{way}", **told)},
        **{"size": size, "std": spread, "unit": m.unit, "sigmas": abs(now) / max(std, 1e-15)},
        **{"on_part_um": effect, "on_part": on_part, "do": say("night.repaired.do", owner=d.owner)},
        "repair": {"alarm": d.alarm, "size_before": then},
    }


def _nothing_changed(wrong: Mapping[str, Any], d: Decision) -> dict[str, Any]:
    """→ the alarm of a machine of which nobody knew what had changed, and on which nothing has changed since."""
    text = say("night.repaired.nothing", owner=d.owner, date=d.utc[:10], since=wrong["since"])
    kept = {
        key: wrong.get(key) for key in ("cause", "parameter", "since", "size", "std", "unit", "sigmas", "on_part_um", "on_part")
    }
    return kept | {
        **{"id": "", "rate_per_day": None, "instead": list(wrong.get("instead") or ()), "text": text},
        **{"do": say("night.repaired.do", owner=d.owner), "repair": {"alarm": d.alarm, "size_before": wrong.get("size")}},
    }


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
            key = "beyond" if found["seen"] else "beyond_unknown"
            heard.append(alarm | {"text": say(f"night.ignored.{key}", text=alarm["text"], **told), "ignored": told})
        else:
            unheard.append({key: value for key, value in found.items() if key != "beyond"})
    return heard, unheard


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
        found.append(told | {"owner": d.owner, "until": d.until, "seen": seen(a), "beyond": beyond})
    return next((f for f in found if not f["beyond"]), found[0])


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
