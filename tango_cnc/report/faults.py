"""Alarms of a machine → what is wrong with it, each cause once and with one size: what has come together since it was well.

A cause that moved in several nights has drifted: its size is the sum, and what is advised is other than after one knock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..loaded import changes
from ..records import Machine
from ..state.changes import change
from ..texts import Said, instead
from .compensated import after, as_loaded, born, broken, dated, last_written
from .days import day, days_between, local_day
from .plain import amount, office, plain, shop, signed
from .texts import Texts, texts
from .units import Units, shown
from .words import moved, named, spoken, unforeseen

if TYPE_CHECKING:
    from ..history import History

CLOSED = ("accept", "repaired")  # decisions after which a cause acts no more
WARMED = ("scale", "scales", "temperature")  # causes that no clamp and no bearing explains
KNOCK = 3.0  # times what a drift makes a day, from which one night is a knock on top of it
SAME = 0.25  # share of its size by which what stands may differ from what was found, and still be one step


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
) -> list[dict[str, Any]]:
    """record, alarms of earlier nights, decisions by alarm, last night that measured, date, what happened to compensations → what
    is wrong, by what it does to a part, whether or not somebody has it; what is no error of a part comes after that, what somebody
    ignores after that, what is closed last. One order a machine: what was done is not told again.
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
                **{key: standing[str(a["id"])].get(key) for key in ("total", "now")},
                "confirmed": _confirmed(standing[str(a["id"])], known),
            }
        if not before_tonight:
            a = {**a, "utc": record.get("start_utc")}
        elif (own := before_.get(str(a.get("id")))) is not None:
            a = {**a, **{k: own[k] for k in ("utc", "was") if own.get(k) is not None and a.get(k) is None}}
            a |= {k: own.get(k) for k in ("do", "on_part", "on_part_um")} if a.get("settled") else {}
        if stale:  # what the last night measured was another machine
            a |= {"total": None, "now": ""}
        a = as_loaded(a, events)
        one = alarm(a, decisions.get(str(a.get("id"))), u, t, machine, record, today)
        told.setdefault(str(a.get("id") or len(told)), one | {"older": before_tonight})
    repaired = [str(d.utc) for d in decisions.values() if d.action == "repaired" and d.utc]
    together = _together(list(told.values()), u, t, machine, events, repaired, str(known.get("night") or ""))
    found = [x | {"whole": _whole_error(x, known, u, t, machine, events)} for x in together]
    for a in record.get("behind") or ():
        a = as_loaded({**a, "utc": record.get("start_utc")}, events)
        sizes = [size_of(x) for x in found if x.get("parameter") == a.get("parameter")]
        if not sizes or max(sizes) < 0.8 * size_of(a):  # an alarm that says the same is not told twice
            asked = next((x for x in found if x.get("parameter") == a.get("parameter") and not _closed(x)), None)
            whose = {} if asked is None else {key: asked[key] for key in ("who", "nobody", "owner")}
            found.append(alarm(a, None, u, t, machine, record, today) | {"older": False} | whose)
    if any(x["drifts"] and not change(x["cause_key"]).of_the_probe and not _closed(x) for x in found):
        found = [x | ({"todo": t("morning.after_drift", do=x["todo"])} if _entered(x) else {}) for x in found]
    behind = {x.get("parameter") for x in record.get("behind") or () if record.get("verdict") == "out_of_limits"}
    return sorted(found, key=lambda a: (_closed(a) and a.get("parameter") not in behind, *_urgency(a)))


def _confirmed(a: Mapping[str, Any], known: Mapping[str, Any]) -> bool:
    """alarm of an earlier night, last night that measured → whether a full measurement, that or one before, has found it again."""
    seen = ((known.get("parameters") or {}).get(a.get("parameter")) or {}).get("seen")
    own, total = float(a.get("size") or 0.0), float(a.get("total") or 0.0)
    stays = own != 0.0 and abs(total - own) <= SAME * abs(own)
    tonight = bool(seen) and known.get("kind") == "full" and known.get("status") == "complete"
    return stays and (tonight or bool(a.get("confirmed")))


def begun(found: Sequence[Mapping[str, Any]], behind: Sequence[Mapping[str, Any]] = ()) -> str:
    """faults, what stands behind a crossed limit → date of the last night before any of them; '' where none is.

    What this night found counts though it was closed since: parts were made with it.
    """
    dates = [str(a["begun"]) for a in found if a.get("begun") and not a["gone"] and not (_closed(a) and a.get("older"))]
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
    return [a for a in found if a["id"] and not _closed(a)]


def unclosed(history: History, machine: str, today: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """history, machine, date → its alarms that nobody has closed, newest first, and the last decision about each alarm.

    What was ignored until a date counts as unanswered after that day.
    """
    last = {d.alarm: d for d in history.decisions(machine)}
    last = {key: d for key, d in last.items() if d.action != "ignore" or str(d.until or "") >= today}
    every = [dated(a, stored.record) for stored in history.alarmed(machine) for a in stored.record["alarms"]]
    return [a for a in every if a["id"] not in last or last[a["id"]].action not in CLOSED], last


def _entered(a: Mapping[str, Any]) -> bool:
    """fault → whether its cure is a number in the control, which waits while the machine drifts."""
    return change(a["cause_key"]).entered and bool(a["todo"]) and not a["drifts"]


def _closed(a: Mapping[str, Any]) -> bool:
    return a["decision"] is not None and a["decision"].action in CLOSED


def _together(
    alarms: Sequence[dict[str, Any]],
    u: Units,
    t: Texts,
    machine: Machine | None,
    events: Sequence[Any],
    repaired: Sequence[str],
    known_of: str,
) -> list[dict[str, Any]]:
    """alarms, what happened to compensations, moments of repairs, date of the last night that measured → one for each parameter,
    with all that has come together since the oldest of them; what a compensation has settled is apart from what came after it.
    """
    groups: dict[tuple[str, bool, bool], list[dict[str, Any]]] = {}
    for a in alarms:
        groups.setdefault((str(a.get("parameter") or a["id"]), bool(a.get("settled")), _on_a_drift(a, alarms)), []).append(a)
    found, written = [], last_written(events)
    for (parameter, settled, knocked), same in groups.items():
        same.sort(key=_moment)
        first, sizes = same[0], [float(a.get("size") or 0.0) for a in same]
        own, every = sizes[0], sum(sizes)
        if first.get("total") is not None and not knocked:
            knocks = groups.get((parameter, settled, True), ())
            every = float(first["total"]) - sum(float(a["size"]) for a in knocks if _moment(a) > _moment(first))
        drifts = any(a.get("rate_per_day") for a in same) or _one_way(same, events, repaired)
        open_since = [str(a["since"]) for a in same if a.get("since") and not _closed(a)]
        first = first | {"begun": min(open_since, default=first["begun"])}
        first = first | {"drifts": drifts, "ids": [a["id"] for a in same if a["decision"] is None and a["id"]], "total": every}
        first |= {"held": [a["id"] for a in same if a["decision"] is not None and not _closed(a)]}
        first |= {"gone": _gone(same) and not drifts}
        if first["gone"]:
            first |= _gone_back(first, own, every, u, t)
        elif (
            own and (drifts or abs(every - own) > SAME * abs(own)) and spoken(str(first.get("parameter"))) != first.get("parameter")
        ):
            first |= _whole(first, own, every, drifts, len(same), u, t, machine)
            if drifts and written and written >= str(same[-1]["night"]):
                first["todo"] = t("morning.drift_written_do", date=day(written, t))
        elif first["older"] and first.get("now"):
            now = plain(t.of(_confirmed_on(first["now"], known_of, t)), u, t, machine)
            first["text"] = f"{first['text']} {whole_sentence(sentence(now, Units()))}"
        elif len(same) > 1 and spoken(str(first.get("parameter"))) == first.get("parameter"):  # several numbers have no sum
            first["text"] = f"{same[-1]['text']} {t('morning.before_that', text=first['text'])}"
        unanswered = next((a for a in same if a["decision"] is None), None)
        found.append(
            first if unanswered is None else first | {k: unanswered[k] for k in ("decision", "decided", "who", "nobody", "night")}
        )
    return found


def _confirmed_on(now: str, night: str, t: Texts) -> str:
    """what the last night that measured says of an alarm, its date → the same; what "tonight" has confirmed is dated."""
    if isinstance(now, Said) and now.key == "night.alarms.confirmed" and night:
        return t("morning.confirmed_on", told=now.values["told"], date=day(night, t))
    return now


def _gone(same: Sequence[Mapping[str, Any]]) -> bool:
    """alarms of a parameter, oldest first → whether it is back where it was before the oldest of them."""
    if same[0]["older"] and isinstance(now := same[0].get("now"), Said) and now.key == "night.alarms.gone_again_left":
        return True
    return any((a.get("undoes") or {}).get("alarm") == same[0]["id"] for a in same)


def _gone_back(first: Mapping[str, Any], own: float, left: float, u: Units, t: Texts) -> dict[str, Any]:
    """oldest alarm of a parameter that has gone back, its size, what is left → sentence, effect, advice."""
    factor, unit = shown(str(first.get("unit") or "mm"))
    sizes = {"left": amount(abs(left * factor), unit, u, t), "size": amount(abs(own * factor), unit, u, t)}
    told = {"text": f"{first['text']} {t('morning.gone_back', **sizes)}", "todo": shop(t("night.gone_do"), t)}
    told |= {"office": office(t("night.gone_do"), t)}
    part = t("morning.gone_part", date=day(first["first"], t)) if first["on_part"] else ""
    return told | {"on_part": part}


def _on_a_drift(a: Mapping[str, Any], alarms: Sequence[Mapping[str, Any]]) -> bool:
    """alarm, all alarms → whether it is a knock on a parameter that drifts: far more in one night than the drift makes in one."""
    same = [x for x in alarms if x.get("rate_per_day") and x.get("steady", True) and x.get("parameter") == a.get("parameter")]
    rates = [abs(float(x["rate_per_day"])) for x in same]
    return bool(rates) and not a.get("rate_per_day") and abs(float(a.get("size") or 0.0)) > KNOCK * max(rates)


def _moment(a: Mapping[str, Any]) -> str:
    """alarm with its night → when it was found: its moment where that is on record, else its date."""
    return str(a.get("utc") or a["night"])


def _one_way(same: Sequence[Mapping[str, Any]], events: Sequence[Any], repaired: Sequence[str]) -> bool:
    """alarms of a parameter, oldest first → whether it moved several times the same way by itself.

    What a compensation moved is no step of the machine; where one was written or taken out, or somebody repaired, between two
    steps, they are two stories.
    """
    steps = [a for a in same if born(a) is None]
    sizes = [float(a.get("size") or 0.0) for a in steps]
    if len(steps) < 2 or not (min(sizes) > 0 or max(sizes) < 0):
        return False
    return not broken(events, repaired, _moment(steps[0]), _moment(steps[-1]))


def _whole(
    first: Mapping[str, Any], own: float, every: float, drifts: bool, steps: int, u: Units, t: Texts, machine: Machine | None
) -> dict[str, Any]:
    """oldest alarm of a parameter, its size, that of all, whether it drifts, alarms → sentence, effect, advice as a whole."""
    factor, unit = shown(str(first.get("unit") or "mm"))
    size = signed(every * factor, unit, u, t)
    text = moved(str(first["parameter"]), size, _since({**first, "night": first["first"]}, t), t)
    whole: dict[str, Any] = {"text": whole_sentence(sentence(plain(text, u, t, machine), Units()))}
    if drifts:
        whole["text"] += f" {t('morning.drifts', steps=steps) if steps > 1 else t('morning.drifts_on')}"
        whole |= {} if first["cause_key"] in WARMED else {"todo": t("morning.drift_do")}
    if first.get("on_part_um") is not None:
        small = float(first["on_part_um"])
        counted = float((first.get("ignored") or {}).get("total") or own)  # what its effect on a part is of
        large = abs(small * (counted + every - own) / counted)
        effect = str(first["raw_part"]).replace(f"{small:.1f} µm", f"{large:.1f} µm", 1)
        whole |= {"on_part_um": large, "on_part": sentence(plain(effect, u, t, machine), Units())}
    return whole


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
    text = plain(t("part.whole", what=spoken(name, machine, t), **sizes), u, t, machine)
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


def size_of(a: Mapping[str, Any]) -> float:
    """fault → µm that it does, at most where that is on record, else the size that was found (of a tilt over 300 mm)."""
    if a.get("on_part_um") is not None:
        return abs(float(a["on_part_um"]))
    return abs(float(a.get("size") or 0.0)) * (1e3 if a.get("unit") == "mm" else 3e5)


def alarm(
    a: Mapping[str, Any],
    decision: Any,
    u: Units,
    t: Texts,
    machine: Machine | None = None,
    record: Mapping[str, Any] | None = None,
    today: str = "",
) -> dict[str, Any]:
    """alarm of a record, its decision, units, texts, chain of axes, record, date → what a page shows of it."""
    raw = a.get("text") or ""
    size, record, asked = _amount(a, u), record or {}, str(a.get("id") or "")[:10]
    owner = (decision.owner if decision is not None else None) or a.get("owner") or record.get("owner")
    told = {**a, "night": asked}
    part = _part(told, u, t)
    return {
        **a,
        "raw_text": raw,
        "id": str(a.get("id") or ""),
        "text": whole_sentence(sentence(plain(t.of(_dated(told, raw, t)), u, t, machine), Units())),
        "recorded": sentence(t.of(raw), u),
        "night": asked,
        "first": asked,  # date of the first night on which it was seen
        "cause": _named(f"cause_name.{a.get('cause')}", a.get("cause"), t),
        "cause_key": str(a.get("cause") or ""),
        "begun": str(a.get("since") or ""),
        "amount": "" if " ± " in raw else size,  # for the engineer, where the sentence does not say it already
        "on_part": sentence(plain(part, u, t, machine), Units()),
        "raw_part": part,
        "whole": "",
        "todo": shop(sentence(plain(_todo(a, u, t), u, t, machine), Units()), t),
        "office": office(_todo(a, u, t), t),
        "instead": [named(str(x), t, machine) for x in a.get("instead") or ()],
        "owner": owner,
        "nobody": not owner and decision is None,
        "who": _who(owner, decision, asked, today or str(record.get("night") or ""), t),
        "decision": decision,
        "drifts": False,
        "gone": False,
        "ids": [str(a["id"])] if a.get("id") and decision is None else [],
        "held": [],
        "decided": "" if decision is None else t(f"decision.{decision.action}"),
    }


def _who(owner: Any, decision: Any, asked: str, today: str, t: Texts) -> str:
    """owner, decision, date on which an answer was asked for or '', date, texts → who has it, as a sentence."""
    if decision is not None:
        told = t("morning.has", owner=owner, decided=t(f"decision.{decision.action}"))
        told += t("morning.has_since", date=day(local_day(decision.utc), t)) if decision.utc else ""
        return f"{told} {t('morning.has_until', date=day(decision.until, t))}" if decision.until else told
    if not owner:
        return t("morning.nobody")
    if not asked:
        return t("morning.call", owner=owner)
    days = days_between(asked, today)
    if days < 1:
        return t("morning.asked", owner=owner)
    return t("morning.asked_since", owner=owner, date=day(asked, t), days=days)


def _dated(a: Mapping[str, Any], raw: str, t: Texts) -> str:
    """alarm, its sentence, texts → the sentence with one date: of the night that found it where the one before was without it."""
    since = str(a.get("since") or "")
    if not since:
        return raw
    told = instead(raw, "last night", since)
    return instead(told, since, _since(a, t)) if _at_once(a) else told


def _at_once(a: Mapping[str, Any]) -> bool:
    """alarm with its night → whether it came from one night to the next, so that its night says since when."""
    return not a.get("rate_per_day") and days_between(a.get("since") or a["night"], a["night"]) == 1


def _since(a: Mapping[str, Any], t: Texts) -> str:
    """alarm with its night, texts → since when, in words."""
    return t("morning.found", date=day(a["night"], t)) if _at_once(a) else day(a.get("since"), t)


def sentence(text: Any, u: Units) -> str:
    """text of a record, units → the same as a sentence: a capital in front, lengths in these units."""
    found = u.sentence(str(text or ""))
    return found[:1].upper() + found[1:]


def whole_sentence(text: str) -> str:
    """sentence → the same with its full stop; nothing stays nothing."""
    return text if not text or text.endswith((".", "?", "!", "…")) else f"{text}."


def _todo(a: Mapping[str, Any], u: Units, t: Texts) -> str:
    """→ what to do; no full measurement is asked for where one has found the cause again."""
    own = _told(a, "do", u, t)
    key = "confirmed.square" if own in (t("part.square_do"), texts()("part.square_do")) else f"confirmed.{a.get('cause')}"
    drifts = a.get("rate_per_day") and a.get("steady", True)  # who was at the machine that night has not made it
    return t(key) if a.get("confirmed") and key in t and not drifts else own


def _part(a: Mapping[str, Any], u: Units, t: Texts) -> str:
    """alarm with its night → what it means for a part: it speaks of the change, also where an old record states the whole error."""
    own = a.get("on_part")
    key = f"{own.key.removesuffix('_since')}_since" if isinstance(own, Said) else ""
    if not a.get("since") or key not in t or not isinstance(own, Said):
        return _told(a, "on_part", u, t)
    whole = (a.get("ignored") or {}).get("since")  # its effect is that of all since before what somebody ignores
    return t(key, **{**own.values, "since": day(whole, t) if whole else _since(a, t)})


def _told(a: Mapping[str, Any], member: str, u: Units, t: Texts) -> str:
    """→ the shop's text where the record has the program's own; what the record says otherwise."""
    key, effect = f"cause.{a.get('cause')}.{member}", f"{float(a.get('on_part_um') or 0.0):.1f} µm"
    own = str(a.get(member) or "")
    return t(key, effect=effect) if key in t and own == texts()(key, effect=effect) else t.of(a.get(member) or "")


def _named(key: str, name: Any, t: Texts) -> str:
    """key of its text, name of a cause or of what is followed, texts → its word."""
    return t(key, name=str(name).partition(" ")[2]) if key in t else t.of(name or "").replace("_", " ")


def _amount(a: Mapping[str, Any], u: Units) -> str:
    """→ '+20.3 ± 0.5 µm'; without ± where no uncertainty is on record."""
    if not a.get("size"):
        return ""
    factor, unit = u.coefficient(str(a.get("unit") or "mm"))
    value, std = float(a["size"]) * factor, abs(float(a.get("std") or 0.0) * factor)
    decimals = 0 if std >= 10 else 1 if std >= 0.095 or not std else 2
    number = f"{value:+.{decimals}f}".replace("-", "−")
    return f"{number} ± {std:.{decimals}f} {unit}" if std else f"{number} {unit}"
