"""Alarms of a machine → what is wrong with it, each cause once and with one size: what has come together since it was well.

A cause that moved in several nights has drifted: its size is the sum, and what is advised is other than after one knock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any

from ..loaded import changes
from ..records import Machine
from ..state.changes import change
from ..texts import instead
from ..texts.number import number
from .alarm import alarm, asked_since
from .compensated import after, as_loaded, dated
from .days import day, local_day
from .plain import plain
from .reach import instead_of
from .right import is_right, whole_of, without_compensation, without_full
from .texts import Texts, code
from .together import SAME, closed, signed_of, together
from .tonight import LENGTHS, by_tonight, by_verdict, in_the_past, is_gone, is_unseen, size_of
from .units import Units, shown
from .words import elsewhere, of_its_night, spoken, subject, unforeseen

if TYPE_CHECKING:
    from ..history import History


SWINGS = (
    "text",
    "do",
    "on_part",
    "on_part_um",
    "rate_per_day",
    "steady",
    "confirmed",
    "instead",
    "swing",
)  # of one with the temperature
LATELY = 60  # nights among which one that has measured a repair is looked for
BELIEVED = ("good", "changed", "out_of_limits")  # verdicts of nights that have measured the machine


def earlier(alarms: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """alarms of earlier nights → the same, read today: "since last night" names the night instead, and a forecast is over."""
    return [_earlier(a) for a in alarms]


def _earlier(a: Mapping[str, Any]) -> dict[str, Any]:
    night = str(a.get("id") or a.get("night") or "")[:10]
    found = {**a, "text": unforeseen(instead(a.get("text") or "", "last night", str(a.get("since"))), night)}
    return found | ({"do": unforeseen(a["do"], night)} if a.get("do") else {})


@dataclass(frozen=True)
class _Today:
    """A night and how it is told: record, last night that measured, decisions by alarm, units, texts, chain of axes, date, what
    happened to compensations."""

    record: Mapping[str, Any]
    known: Mapping[str, Any]
    decisions: Mapping[str, Any]
    u: Units
    t: Texts
    machine: Machine | None
    today: str
    events: Sequence[Any]

    @property
    def stale(self) -> bool:
        """→ whether a compensation was written or taken out after the last night that measured."""
        return bool(self.known.get("end_utc")) and bool(changes(self.events, str(self.known["end_utc"])))

    def alarm(self, a: Mapping[str, Any], decision: Any) -> dict[str, Any]:
        """alarm, its decision → what a page shows of it, by what the control held."""
        return alarm(as_loaded(a, self.events), decision, self.u, self.t, self.machine, self.record, self.today)


def faults(
    record: Mapping[str, Any],
    waiting: Sequence[Mapping[str, Any]],
    decisions: Mapping[str, Any],
    u: Units,
    t: Texts,
    machine: Machine | None = None,
    before: Mapping[str, Any] | None = None,
    today: str = "",
    events: Sequence[Any] = (),
    old: int = 0,
) -> list[dict[str, Any]]:
    """record, alarms of earlier nights, decisions by alarm, last night that measured, date, what happened to compensations, nights
    since the machine was measured, where these are too many (then nobody knows what still stands) → what is wrong, by what it does
    to a part by now, whether or not somebody has it; what is no error of a part comes after that, what is closed last. One order a
    machine: what was done is not told again.
    """
    known = (before or {}) if record.get("verdict") == "not_measured" else record
    how = _Today(record, known, decisions, u, t, machine, today, events)
    repaired = [str(d.utc) for d in decisions.values() if d.action == "repaired" and d.utc]
    causes = together(_told(how, waiting), u, t, machine, events, repaired, str(known.get("night") or ""), bool(old))
    found = [x | ({"whole": ""} if old else _whole_error(x, known, u, t, machine, events)) for x in causes]
    found = _after_a_drift(_with_limits(_asked_first(found, how), how), machine, t)
    other = instead_of(record, found)
    whom = {"who": t("morning.nobody_but", other=other), "nobody": False} if other else {}
    found = [x | (whom if x["nobody"] else {}) for x in found]
    todo = {"todo": t("may.repaired_todo"), "office": ""}
    found = [x | (todo if (closed(x) and x["unmeasured"]) or _to_be_seen(x["decision"], known) else {}) for x in found]
    found = [x if x.get("older") else x | {"todo": without_full(x["todo"], x, record, t)} for x in found]
    behind = {x.get("parameter") for x in record.get("behind") or () if record.get("verdict") == "out_of_limits"}
    return sorted(found, key=lambda a: (closed(a) and a.get("parameter") not in behind, *_urgency(a)))


def _to_be_seen(decision: Any, known: Mapping[str, Any]) -> bool:
    """decision, last night that measured → whether somebody says to have repaired it, and no night has measured since."""
    return decision is not None and decision.action == "repaired" and str(decision.utc) >= str(known.get("end_utc") or "~")


def _told(how: _Today, waiting: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """night, alarms of earlier nights → every alarm once as a page tells it, those of the night first."""
    standing = {str(a.get("id")): a for a in how.known.get("standing") or ()}
    standing |= {str(a["alarm"]): a for key in ("unheard", "gone") for a in how.known.get(key) or ()}  # what somebody ignores
    former = {str(a.get("id")): a for a in waiting}  # as their own nights wrote them
    tonight = [(a, False) for a in how.record.get("alarms") or ()]
    helped = {str(x.get("alarm")) for x in how.record.get("repaired") or ()}  # a way back of these is that repair
    older = [
        (a, True) for a in (*(how.record.get("standing") or ()), *waiting, *_to_be_measured(how)) if _undone_by(a) not in helped
    ]
    told: dict[str, dict[str, Any]] = {}
    for a, before_tonight in [*tonight, *older]:
        key = str(a.get("id"))
        a = _as_it_stands(a, standing.get(key), how.known)
        a = _earlier(_as_its_night_wrote(a, former.get(key))) if before_tonight else _of_tonight(a, how)
        if how.stale and not (
            is_unseen(a.get("now")) or is_gone(a.get("now") or "")
        ):  # the last night knows its size, and not whether it is there still
            a |= {"now": ""}
        a = by_verdict(a, how.known.get("verdict"))
        a |= by_tonight(a) if a.get("cause") in LENGTHS and a.get("now") else {}
        decision = how.decisions.get(key)
        waits = bool(former.get(key, {}).get("untried")) or _to_be_seen(decision, how.known)
        beside = {"older": before_tonight, "unmeasured": waits, "let_be": _let_be(decision, how.today)}
        told.setdefault(str(a.get("id") or len(told)), how.alarm(a, decision) | beside)
    return list(told.values())


def _let_be(decision: Any, today: str) -> bool:
    """decision, date → whether somebody wants the alarm to be ignored that day."""
    return decision is not None and decision.action == "ignore" and str(decision.until or "") >= today


def _to_be_measured(how: _Today) -> list[Mapping[str, Any]]:
    """a night that measured nothing and how it is shown → alarms of the last night that measured which somebody has reported as
    repaired since then. The record of this night no longer lists them, and nobody has measured the repair yet.
    """
    if how.known is how.record:
        return []
    every = (*(how.known.get("alarms") or ()), *(how.known.get("standing") or ()))
    return [a for a in every if _to_be_seen(how.decisions.get(str(a.get("id"))), how.known)]


def _of_tonight(a: Mapping[str, Any], how: _Today) -> dict[str, Any]:
    """an alarm of the newest night and how it is shown → the alarm with its moment in UTC. On a later day its text gives the date
    on which the temperature was measured.
    """
    night = str(how.record.get("night") or "")
    told = {**a, "utc": how.record.get("start_utc")}
    if how.today <= night:
        return told
    return told | {key: of_its_night(a[key], night) for key in ("text", "do") if a.get(key)}


def _undone_by(a: Mapping[str, Any]) -> str:
    """alarm → id of the one that it takes back; '' for none."""
    return str((a.get("undoes") or {}).get("alarm") or "")


def _as_it_stands(a: Mapping[str, Any], stands: Mapping[str, Any] | None, known: Mapping[str, Any]) -> dict[str, Any]:
    """alarm, what the last night that measured says of it, that night → the same with what there is of it now."""
    if stands is None:
        return dict(a)
    now = {key: stands.get(key) for key in ("total", "now", "stands", "slowed", "ended", "gone_by", "went_with")}
    swings = {key: stands.get(key) for key in SWINGS} if stands.get("swing") else {}
    return in_the_past({**a, **now, "confirmed": _confirmed(stands, known), **swings})


def _as_its_night_wrote(a: dict[str, Any], own: Mapping[str, Any] | None) -> dict[str, Any]:
    """alarm of an earlier night, as that night wrote it → with its moment; what is settled keeps its own advice."""
    if own is None:
        return a
    a |= {k: own[k] for k in ("utc", "was", "asked_again") if own.get(k) is not None and a.get(k) is None}
    return a | ({k: own.get(k) for k in ("do", "on_part", "on_part_um")} if a.get("settled") else {})


def _asked_first(found: list[dict[str, Any]], how: _Today) -> list[dict[str, Any]]:
    """faults → those that nobody has answered with the date on which their owner was asked first: who has not answered the alarm of
    ten days ago is not the first to call about that of this morning.
    """
    waits = [a for a in still_open(found) if a["decision"] is None and a["owner"] and a["asked"]]
    first = {a["owner"]: min(x["asked"] for x in waits if x["owner"] == a["owner"]) for a in waits}
    deputy = str(how.record.get("deputy") or "")
    today = how.today or str(how.record.get("night") or "")
    asked = {a["id"]: asked_since(a, first[a["owner"]], today, how.t, deputy) for a in waits}
    return [a | asked.get(a["id"], {}) for a in found]


def _with_limits(found: list[dict[str, Any]], how: _Today) -> list[dict[str, Any]]:
    """faults → with what stands behind a crossed limit; an alarm that says the same is not told twice."""
    for a in how.record.get("behind") or ():
        a = {**a, "utc": how.record.get("start_utc")}
        same = [x for x in found if x.get("parameter") == a.get("parameter")]
        if same and max(map(size_of, same)) >= 0.8 * size_of(as_loaded(a, how.events)):
            continue
        asked = next((x for x in same if not closed(x)), None)
        whose = {} if asked is None else {key: asked[key] for key in ("who", "nobody", "owner", "silent", "night", "asked")}
        found = [*found, how.alarm(a, None) | {"older": False} | whose]
    return found


def _after_a_drift(found: list[dict[str, Any]], machine: Machine | None, t: Texts) -> list[dict[str, Any]]:
    """faults → where one of the machine drifts, the numbers that wait until it does not."""
    drift = next((x for x in found if x["drifts"] and not change(x["cause_key"]).of_the_probe and not closed(x)), None)
    if drift is None:
        return found
    what = subject(str(drift.get("parameter") or drift["cause"]), machine, t)

    def waits(x: Mapping[str, Any]) -> dict[str, Any]:
        return {"todo": t("morning.after_drift", do=x["todo"], what=what), "alone": x["todo"]}

    return [x | (waits(x) if _entered(x) else {}) for x in found]


def _confirmed(a: Mapping[str, Any], known: Mapping[str, Any]) -> bool:
    """alarm of an earlier night, last night that measured → whether a full measurement, that or one before, has found it again."""
    seen = ((known.get("parameters") or {}).get(a.get("parameter")) or {}).get("seen")
    own, total = float(a.get("size") or 0.0), float(a.get("total") or 0.0)
    stays = own != 0.0 and abs(total - own) <= SAME * abs(own)
    tonight = bool(seen) and known.get("kind") == "full" and known.get("status") == "complete"
    return stays and (tonight or bool(a.get("confirmed")))


def accepted(a: Mapping[str, Any]) -> bool:
    """fault → whether somebody has accepted the machine as it is."""
    return closed(a) and bool(a["decision"].action == "accept")


def untried(a: Mapping[str, Any]) -> bool:
    """fault → whether it was repaired, and no night has measured since whether it has gone."""
    return bool(a.get("unmeasured")) and not a["gone"]


def for_setting_up(a: Mapping[str, Any]) -> bool:
    """fault → whether parts have it only by what was set up or measured with the probe."""
    return bool(a.get("set_up"))


def of_probe(found: Sequence[Mapping[str, Any]]) -> str:
    """faults → `_probe` where all that is open and that nobody ignores is of the probe: parts have it only by what was set up with
    it; `_beside` where its touches scatter beside something else: then it measures no first part; else ''.
    """
    asked = [a for a in still_open(found) if not a.get("let_be")] or still_open(found)
    if asked and all(for_setting_up(a) for a in asked):
        return "_probe"
    return "_beside" if any(change(a.get("cause_key")).scatters and not a["gone"] for a in asked) else ""


def begun(found: Sequence[Mapping[str, Any]], behind: Sequence[Mapping[str, Any]] = ()) -> str:
    """faults, what stands behind a crossed limit → date of the last night before any of them; '' where none is.

    What this night found counts though it was closed since: parts were made with it. So does what was repaired and not measured
    since.
    """
    dates = [
        str(a["begun"]) for a in found if a.get("begun") and not a["gone"] and (not closed(a) or not a.get("older") or untried(a))
    ]
    return min([*dates, *(str(a["since"]) for a in behind if a.get("since"))], default="")


def answered(found: Sequence[Mapping[str, Any]], record: Mapping[str, Any]) -> tuple[str, str]:
    """faults, record → date of the first alarm that nobody has answered, '' where it is of tonight; who has another open one that
    has not gone again.
    """
    listed = still_open(found)
    unanswered = [str(a["asked"]) for a in listed if a["decision"] is None]
    if unanswered and record.get("alarms"):  # that of tonight waits in no case; nobody has had time for it
        return min((n for n in unanswered if n < str(record.get("night"))), default=""), ""
    held = (a for a in listed if a["decision"] is not None and not a["gone"])
    return min(unanswered, default=""), next((str(a["decision"].owner) for a in held), "")


def settled(found: Sequence[Mapping[str, Any]]) -> str:
    """faults → accept, or repaired, where every alarm of the night, and every one that was accepted or repaired since, is closed:
    by what; '' where one is open or none was. What has gone back, and is to be ignored, asks for no more than what was accepted.
    """
    own = [a for a in found if a["id"] and (not a["older"] or a.get("tonight") or untried(a) or accepted(a))]
    if not own or any(not (a["gone"] and a.get("let_be")) for a in still_open(found)):
        return ""
    return "accept" if {a["decision"].action for a in own} <= {"accept", "ignore"} else "repaired"


def asking(found: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """faults → those that ask for something, in their order: what is to be ignored asks for nothing, and where there is such a
    one, what is closed does not either.
    """
    if not any(a.get("let_be") for a in found):
        return list(found)
    return [a for a in found if not a.get("let_be") and (not closed(a) or untried(a))]


def still_open(found: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """faults → those with an alarm that nobody has closed: what every page counts as open alarms."""
    return [a for a in found if a["id"] and not closed(a)]


def unclosed(history: History, machine: str, today: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """history, machine, date → its alarms that nobody has closed, and those that somebody says to have repaired and no night has
    measured since (`untried`), newest first, each as the last night that told it; the last decision about each alarm.

    What was ignored until a date counts as unanswered after that day.
    """
    from ..history.answers import answers  # databases are slow to load

    nights = {stored.night.entry: stored.record for stored in history.alarmed(machine)}
    known = answers([(entry, record["alarms"]) for entry, record in nights.items()], history.decisions(machine), today)
    back = {_undone_by(a): key for key, (_, a) in known.newest.items() if _undone_by(a)}
    over = {*back, *back.values()}  # the night of the way back has measured it
    tried = {key: d for key, d in known.decided.items() if d.action == "repaired" and key in known.newest.keys() - over}
    waits = tried.keys() - _measured(history, machine, tried) if tried else set()
    listed = [(key, entry, a) for key, (entry, a) in known.newest.items() if not known.closed(key) or key in waits]
    again = _asked_again(history.decisions(machine), today)
    return [
        dated(a, nights[entry]) | ({"untried": True} if key in waits else {}) | again.get(key, {}) for key, entry, a in listed
    ], dict(known.decided)


def _asked_again(decisions: Sequence[Any], today: str) -> dict[str, dict[str, str]]:
    """decisions, date → {alarm: the day since which its owner is asked again}, of those that somebody ignored until then."""
    last = {d.alarm: d for d in decisions}
    over = {key: d.until for key, d in last.items() if d.action == "ignore" and d.until and d.until < today}
    return {key: {"asked_again": (date.fromisoformat(until) + timedelta(days=1)).isoformat()} for key, until in over.items()}


def _measured(history: History, machine: str, repairs: Mapping[str, Any]) -> set[str]:
    """history, machine, {id: repair of that alarm} → those that a night has measured since: one that is believed, and began after
    it or says what became of it. A night in doubt has measured none.
    """
    later = [n for n in history.nights(machine, last=LATELY) if n.verdict in BELIEVED]
    found = {key for key, d in repairs.items() if any(n.entry > d.entry and n.start_utc[:19] >= str(d.utc)[:19] for n in later)}
    open_ = repairs.keys() - found
    meanwhile = [n.entry for n in later if any(n.entry > repairs[key].entry for key in open_)]
    for record in history.records_of(meanwhile).values():
        found |= {str(x["alarm"]) for x in record.get("repaired") or ()}
        found |= {str(a["repair"]["alarm"]) for a in record["alarms"] if a.get("repair")}
    return found


def _entered(a: Mapping[str, Any]) -> bool:
    """fault → whether its cure is a number in the control, which waits while the machine drifts."""
    return change(a["cause_key"]).entered and bool(a["todo"]) and not a["drifts"]


def _whole_error(
    a: Mapping[str, Any], known: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None, events: Sequence[Any]
) -> dict[str, str]:
    """fault, last night that measured → `whole`: what its parameter is in all today beside the change, which nobody may correct by
    alone; where it is nearly right now, also what to do, which then asks for no compensation.

    Nothing for what is no error of an axis, where nothing is known of it, and of a night that is not to be believed.
    """
    name = str(a.get("parameter"))
    now = (known.get("parameters") or {}).get(name)
    total = a.get("total") if a.get("total") is not None else a.get("size")
    if (
        a["gone"]
        or a.get("unseen")
        or a.get("swing")  # nobody corrects what goes and comes
        or not a["id"]
        or not now
        or not total
        or known.get("verdict") == "doubtful"
        or spoken(name) == name
    ):
        return {"whole": ""}
    if (newer := after(known, events)) is not None:
        words = {"number": newer.number, "target": newer.target, "event": code(newer.event), "date": day(local_day(newer.utc), t)}
        return {"whole": t("part.whole_since", **words)}
    there = known.get("in_control") or {}
    if there and not there["measured"]:
        return {"whole": t("part.whole_open", number=there["number"], target=there["target"])}
    whole, was, slack = whole_of(a, now, float(total))
    factor, unit = shown(str(a.get("unit") or "mm"))
    sizes = {"now": number(whole * factor, unit), "before": number(was * factor, unit)}
    text = plain(t("part.whole", what=spoken(name, machine, t), date=day(known.get("night"), t), **sizes), u, t, machine)
    text += f" {t('part.whole_held')}" if now.get("in_control") else ""
    if a["drifts"]:  # what goes on is not corrected by any number
        return {"whole": text}
    if a.get("settled"):  # a compensation was entered after it: what is left of it is no order
        return {"whole": f"{text} {t('part.whole_right')}" if abs(whole) <= slack else text}
    right = is_right(whole, was, slack)
    way = (
        "right" if right else "smaller" if abs(whole) < abs(was) - slack else "larger" if abs(whole) > abs(was) + slack else "same"
    )
    if not right and (others := elsewhere(name, a.get("alike") or (), t, signed_of(a, whole, u, t))):
        text += f" {plain(t('part.whole_else', others=others), u, t, machine)}"
    told = {"whole": f"{text} {t(f'part.whole_{way}')}"}
    return told | {"todo": without_compensation(str(a["todo"]), t)} if right else told


def does_now(a: Mapping[str, Any]) -> float:
    """fault → µm that it does by now, at most; of one that has gone back, what is left of it."""
    own, left = float(a.get("size") or 0.0), a.get("total")
    share = abs(float(left or 0.0) / own) if a["gone"] and own else 1.0
    return size_of(a) * min(share, 1.0)


def _urgency(a: Mapping[str, Any]) -> tuple[bool, bool, float]:
    """fault → its place: what has gone back comes after all that is there, what is no error of a part after what is; else by what
    there is of it now, whoever has it.
    """
    probe = for_setting_up(a) and change(a["cause_key"]).of_the_probe
    return bool(a["gone"]), probe, -does_now(a)
