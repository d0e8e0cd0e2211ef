"""Alarms of a machine → what is wrong with it, each cause once and with one size: what has come together since it was well.

A cause that moved in several nights has drifted: its size is the sum, and what is advised is other than after one knock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..loaded import changes
from ..records import Machine
from ..state.changes import change
from ..texts import instead
from .alarm import alarm, size_of
from .compensated import after, as_loaded, dated
from .days import day, local_day
from .plain import plain
from .reach import instead_of
from .texts import Texts
from .together import CLOSED, SAME, closed, together
from .tonight import LENGTHS, by_tonight
from .units import Units, shown
from .words import spoken, subject, unforeseen

if TYPE_CHECKING:
    from ..history import History


def earlier(alarms: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """alarms of earlier nights → the same, read today: "since last night" names the night instead, and a forecast is over."""
    return [{**a, "text": unforeseen(instead(a.get("text") or "", "last night", str(a.get("since"))))} for a in alarms]


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
    to a part, whether or not somebody has it; what is no error of a part comes after that, what somebody ignores after that, what
    is closed last. One order a machine: what was done is not told again.
    """
    known = (before or {}) if record.get("verdict") == "not_measured" else record
    standing = {str(a.get("id")): a for a in known.get("standing") or ()}
    standing |= {str(a["alarm"]): a for key in ("unheard", "gone") for a in known.get(key) or ()}  # what somebody ignores
    tonight = [(a, False) for a in record.get("alarms") or ()]
    older = [(a, True) for a in (*(record.get("standing") or ()), *waiting)]
    before_ = {str(a.get("id")): a for a in waiting}  # as their own nights wrote them
    stale = bool(known.get("end_utc")) and bool(changes(events, str(known["end_utc"])))
    told: dict[str, dict[str, Any]] = {}
    for a, before_tonight in [*tonight, *older]:
        if str(a.get("id")) in standing:
            a = {
                **a,
                **{key: standing[str(a["id"])].get(key) for key in ("total", "now", "stands", "slowed")},
                "confirmed": _confirmed(standing[str(a["id"])], known),
            }
        if not before_tonight:
            a = {**a, "utc": record.get("start_utc")}
        elif (own := before_.get(str(a.get("id")))) is not None:
            a = {**a, **{k: own[k] for k in ("utc", "was") if own.get(k) is not None and a.get(k) is None}}
            a |= {k: own.get(k) for k in ("do", "on_part", "on_part_um")} if a.get("settled") else {}
        if stale:  # what the last night measured was another machine
            a |= {"total": None, "now": ""}
        a |= by_tonight(a) if a.get("cause") in LENGTHS and a.get("now") else {}
        a = as_loaded(a, events)
        one = alarm(a, decisions.get(str(a.get("id"))), u, t, machine, record, today)
        told.setdefault(str(a.get("id") or len(told)), one | {"older": before_tonight})
    repaired = [str(d.utc) for d in decisions.values() if d.action == "repaired" and d.utc]
    causes = together(list(told.values()), u, t, machine, events, repaired, str(known.get("night") or ""), bool(old))
    found = [x | {"whole": "" if old else _whole_error(x, known, u, t, machine, events)} for x in causes]
    for a in record.get("behind") or ():
        a = as_loaded({**a, "utc": record.get("start_utc")}, events)
        sizes = [size_of(x) for x in found if x.get("parameter") == a.get("parameter")]
        if not sizes or max(sizes) < 0.8 * size_of(a):  # an alarm that says the same is not told twice
            asked = next((x for x in found if x.get("parameter") == a.get("parameter") and not closed(x)), None)
            whose = {} if asked is None else {key: asked[key] for key in ("who", "nobody", "owner")}
            found.append(alarm(a, None, u, t, machine, record, today) | {"older": False} | whose)
    drift = next((x for x in found if x["drifts"] and not change(x["cause_key"]).of_the_probe and not closed(x)), None)
    if drift is not None:
        what = subject(str(drift.get("parameter") or drift["cause"]), machine, t)
        found = [
            x | ({"todo": t("morning.after_drift", do=x["todo"], what=what), "alone": x["todo"]} if _entered(x) else {})
            for x in found
        ]
    behind = {x.get("parameter") for x in record.get("behind") or () if record.get("verdict") == "out_of_limits"}
    other = instead_of(record, found)
    whom = {"who": t("morning.nobody_but", other=other), "nobody": False} if other else {}
    found = [x | (whom if x["nobody"] else {}) for x in found]
    return sorted(found, key=lambda a: (closed(a) and a.get("parameter") not in behind, *_urgency(a)))


def _confirmed(a: Mapping[str, Any], known: Mapping[str, Any]) -> bool:
    """alarm of an earlier night, last night that measured → whether a full measurement, that or one before, has found it again."""
    seen = ((known.get("parameters") or {}).get(a.get("parameter")) or {}).get("seen")
    own, total = float(a.get("size") or 0.0), float(a.get("total") or 0.0)
    stays = own != 0.0 and abs(total - own) <= SAME * abs(own)
    tonight = bool(seen) and known.get("kind") == "full" and known.get("status") == "complete"
    return stays and (tonight or bool(a.get("confirmed")))


def for_setting_up(a: Mapping[str, Any]) -> bool:
    """fault → whether parts have it only by what was set up or measured with the probe."""
    return change(a.get("cause_key")).of_the_probe or a.get("cause_key") == "ball"


def all_of_probe(found: Sequence[Mapping[str, Any]]) -> bool:
    """faults → whether something is open, and all of it is of the probe: parts have it only by what was set up with it."""
    listed = still_open(found)
    return bool(listed) and all(for_setting_up(a) for a in listed)


def begun(found: Sequence[Mapping[str, Any]], behind: Sequence[Mapping[str, Any]] = ()) -> str:
    """faults, what stands behind a crossed limit → date of the last night before any of them; '' where none is.

    What this night found counts though it was closed since: parts were made with it.
    """
    dates = [str(a["begun"]) for a in found if a.get("begun") and not a["gone"] and not (closed(a) and a.get("older"))]
    return min([*dates, *(str(a["since"]) for a in behind if a.get("since"))], default="")


def answered(found: Sequence[Mapping[str, Any]], record: Mapping[str, Any]) -> tuple[str, str]:
    """faults, record → date of the first alarm that nobody has answered, '' where it is of tonight; who has another open one that
    has not gone again.
    """
    listed = still_open(found)
    unanswered = [str(a["night"]) for a in listed if a["decision"] is None]
    if unanswered and record.get("alarms"):
        return "", ""
    held = (a for a in listed if a["decision"] is not None and not a["gone"])
    return min(unanswered, default=""), next((str(a["decision"].owner) for a in held), "")


def settled(found: Sequence[Mapping[str, Any]]) -> str:
    """faults → accept, or repaired, where every alarm of the night is closed: by what; '' where one is open or none was."""
    own = [a for a in found if a["id"] and not a["older"]]
    if not own or still_open(found):
        return ""
    return "accept" if {a["decision"].action for a in own} == {"accept"} else "repaired"


def still_open(found: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """faults → those with an alarm that nobody has closed: what every page counts as open alarms."""
    return [a for a in found if a["id"] and not closed(a)]


def unclosed(history: History, machine: str, today: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """history, machine, date → its alarms that nobody has closed, newest first, each as the last night that told it, and the last
    decision about each alarm.

    What was ignored until a date counts as unanswered after that day.
    """
    from ..history.records import merged

    last = {d.alarm: d for d in history.decisions(machine)}
    last = {key: d for key, d in last.items() if d.action != "ignore" or str(d.until or "") >= today}
    newest: dict[str, dict[str, Any]] = {}
    parts: set[str] = set()
    for stored in history.alarmed(machine):
        parts |= merged(stored.record["alarms"])
        for a in stored.record["alarms"]:
            newest.setdefault(a["id"], dated(a, stored.record))  # several nights report one that goes on
    open_ = [a for a in newest.values() if a["id"] not in parts]
    return [a for a in open_ if a["id"] not in last or last[a["id"]].action not in CLOSED], last


def _entered(a: Mapping[str, Any]) -> bool:
    """fault → whether its cure is a number in the control, which waits while the machine drifts."""
    return change(a["cause_key"]).entered and bool(a["todo"]) and not a["drifts"]


def _whole_error(
    a: Mapping[str, Any], known: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None, events: Sequence[Any]
) -> str:
    """fault, last night that measured → what its parameter is in all today beside the change, which nobody may correct by alone.

    Nothing for what is no error of an axis, where nothing is known of it, and of a night that is not to be believed.
    """
    name = str(a.get("parameter"))
    now = (known.get("parameters") or {}).get(name)
    total = a.get("total") if a.get("total") is not None else a.get("size")
    if a["gone"] or not a["id"] or not now or not total or known.get("verdict") == "doubtful" or spoken(name) == name:
        return ""
    if (newer := after(known, events)) is not None:
        words = {"number": newer.number, "target": newer.target, "event": newer.event, "date": day(local_day(newer.utc), t)}
        return t("part.whole_since", **words)
    there = known.get("in_control") or {}
    if there and not there["measured"]:
        return t("part.whole_open", number=there["number"], target=there["target"])
    whole, change_ = float(now["value"]) - float(now.get("in_control") or 0.0), float(total)  # as parts have it
    was = whole - change_ if a.get("was") is None else float(a["was"])  # what that night showed stays what it was
    factor, unit = shown(str(a.get("unit") or "mm"))
    sizes = {"now": f"{whole * factor:+.1f} {unit}", "before": f"{was * factor:+.1f} {unit}"}
    text = plain(t("part.whole", what=spoken(name, machine, t), date=day(known.get("night"), t), **sizes), u, t, machine)
    text += f" {t('part.whole_held')}" if now.get("in_control") else ""
    if a["drifts"]:  # what goes on is not corrected by any number
        return text
    slack = max(2 * float(now.get("std") or 0.0), SAME * abs(change_))
    if a.get("settled"):  # a compensation was entered after it: what is left of it is no order
        return f"{text} {t('part.whole_right')}" if abs(whole) <= slack else text
    right = abs(whole) <= slack and abs(was) > slack
    way = (
        "right" if right else "smaller" if abs(whole) < abs(was) - slack else "larger" if abs(whole) > abs(was) + slack else "same"
    )
    return f"{text} {t(f'part.whole_{way}')}"


def _urgency(a: Mapping[str, Any]) -> tuple[bool, bool, float]:
    ignored = a["decision"] is not None and a["decision"].action == "ignore"
    return ignored, change(a.get("cause")).of_the_probe, -size_of(a)
