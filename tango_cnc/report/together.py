"""Alarms that belong together: those of one parameter are one fault, told with how far it has come by now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..records import Machine
from ..texts import Said
from .alarm import sentence, since_when, whole_sentence
from .compensated import born, broken, last_written
from .days import day, days_between
from .plain import amount, office, plain, shop, signed
from .texts import Texts
from .units import Units, shown
from .words import moved, spoken

CLOSED = ("accept", "repaired")  # decisions after which a cause acts no more
WARMED = ("scale", "scales", "temperature")  # causes that no clamp and no bearing explains
KNOCK = 3.0  # times what a drift makes a day, from which one night is a knock on top of it
SAME = 0.25  # share of its size by which what stands may differ from what was found, and still be one step


def closed(a: Mapping[str, Any]) -> bool:
    """alarm → whether somebody has accepted or repaired it."""
    return a["decision"] is not None and a["decision"].action in CLOSED


def together(
    alarms: Sequence[dict[str, Any]],
    u: Units,
    t: Texts,
    machine: Machine | None,
    events: Sequence[Any],
    repaired: Sequence[str],
    known_of: str,
    old: bool = False,
) -> list[dict[str, Any]]:
    """alarms, what happened to compensations, moments of repairs, date of the last night that measured, whether that one is too
    long ago to say what still stands → one for each parameter, with all that has come together since the oldest of them; what a
    compensation has settled is apart from what came after it.
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
        knocks_told = _knocks(same, known_of, u, t) if spoken(parameter) != parameter else ""
        drifts = any(a.get("rate_per_day") and a.get("steady", True) for a in same) or (
            not knocks_told and _one_way(same, events, repaired)
        )
        open_since = [str(a["since"]) for a in same if a.get("since") and not closed(a)]
        first = first | {"begun": min(open_since, default=first["begun"])}
        first = first | {"drifts": drifts, "ids": [a["id"] for a in same if a["decision"] is None and a["id"]], "total": every}
        first |= {"held": [a["id"] for a in same if a["decision"] is not None and not closed(a)]}
        first |= {"gone": _gone(same) and not drifts}
        if first["gone"]:
            first |= _gone_back(first, own, every, u, t)
        elif (
            own and (drifts or abs(every - own) > SAME * abs(own)) and spoken(str(first.get("parameter"))) != first.get("parameter")
        ):
            goes_on = any(a.get("goes_on") for a in same)  # its steps are not counted by its alarms
            first |= _whole(first, own, every, drifts and not old, 1 if goes_on else len(same), u, t, machine)
            first |= {"text": f"{first['text']} {knocks_told}"} if knocks_told and not drifts else {}
            if not (old or knocks_told or goes_on or drifts) and known_of > str(first["first"]):
                first["then"] = _then(first, own, known_of, u, t)
                first["text"] = f"{first['text']} {first['then']}"
            first |= {"todo": same[-1]["todo"]} if knocks_told and str(known_of) <= str(same[-1]["first"]) else {}
            if drifts and written and written >= str(same[-1]["night"]):
                first["todo"] = t("morning.drift_written_do", date=day(written, t))
        elif len(same) == 1 and first.get("goes_on") and not first["older"] and not first.get("steady", True):
            first["text"] = f"{first['text']} {t('morning.twice')}"
        elif first["older"] and first.get("now") and not old:
            now = plain(t.of(_confirmed_on(first["now"], known_of, t)), u, t, machine)
            told = t("morning.now_of", told=now, date=day(known_of, t)) if known_of and _of_two_nights(first["now"]) else now
            first["still"] = whole_sentence(sentence(told, Units()))
            first["text"] = f"{first['text']} {first['still']}"
        elif len(same) > 1 and spoken(str(first.get("parameter"))) == first.get("parameter"):  # several numbers have no sum
            first["text"] = f"{same[-1]['text']} {t('morning.before_that', text=first['text'])}"
        if old and known_of and first["id"] and not closed(first):
            first["text"] = f"{first['text']} {t('morning.unknown_now', date=day(known_of, t))}"
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


def _of_two_nights(now: str) -> bool:
    """what the last night that measured says of an alarm → whether that is a second number of one event, without its date."""
    return isinstance(now, Said) and now.key in ("night.alarms.still_there", "night.alarms.now")


def _then(first: Mapping[str, Any], own: float, known_of: str, u: Units, t: Texts) -> str:
    """oldest alarm of a parameter, its size, date of the last night that measured → which of its two numbers is of which night."""
    factor, unit = shown(str(first.get("unit") or "mm"))
    nights = {"date": day(known_of, t), "first": day(first["first"], t)}
    return t("morning.then_of", size=signed(own * factor, unit, u, t), **nights)


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
    total = steps[0].get("total")
    if total is not None and len(steps) == 2 and abs(float(total) - sizes[1]) < SAME * min(map(abs, sizes)):
        return False  # a wrong clock kept the night of the first from the second: both have found one change
    return not broken(events, repaired, _moment(steps[0]), _moment(steps[-1]))


def _knocks(same: Sequence[Mapping[str, Any]], known_of: str, u: Units, t: Texts) -> str:
    """alarms of a parameter, oldest first, date of the last night that measured → a sentence of two knocks, where it stood still
    between them or they came in two nights one after the other; '' for any other story.

    What a parameter was before the second one says that: it was where the first had left it.
    """
    if len(same) != 2 or any(a.get("rate_per_day") or a.get("was") is None or not a.get("size") for a in same):
        return ""
    one, other = same
    least = min(abs(float(a["size"])) for a in same)
    if abs(float(other["was"]) - float(one["was"]) - float(one["size"])) > SAME * least:
        return ""
    key = "knocks"
    if days_between(one["first"], other["first"]) < 2:
        key = "knocks_tonight" if str(known_of) <= str(other["first"]) else "knocks_over"
        moved_on = None if one.get("total") is None else float(one["total"]) - sum(float(a["size"]) for a in same)
        if not other.get("follows") or (moved_on is not None and abs(moved_on) > SAME * least):
            return ""
    factor, unit = shown(str(one.get("unit") or "mm"))
    words = {"date": day(one["first"], t), "other_date": day(other["first"], t)}
    words |= {"size": signed(float(one["size"]) * factor, unit, u, t), "other": signed(float(other["size"]) * factor, unit, u, t)}
    return t(f"morning.{key}", **words)


def _whole(
    first: Mapping[str, Any], own: float, every: float, drifts: bool, steps: int, u: Units, t: Texts, machine: Machine | None
) -> dict[str, Any]:
    """oldest alarm of a parameter, its size, that of all, whether it drifts, alarms → sentence, effect, advice as a whole."""
    factor, unit = shown(str(first.get("unit") or "mm"))
    size = signed(every * factor, unit, u, t)
    text = moved(str(first["parameter"]), size, since_when({**first, "night": first["first"]}, t), t, first.get("alike") or ())
    whole: dict[str, Any] = {"text": whole_sentence(sentence(plain(text, u, t, machine), Units()))}
    if drifts:
        stands = first.get("stands")
        on = (
            t("morning.drift_stands", since=day(str(stands), t))
            if stands
            else t(f"morning.drift{'_slowed' if first.get('slowed') else 's_on'}")
        )
        whole["text"] += f" {t('morning.drifts', steps=steps) if steps > 1 else on}"
        whole |= {} if first["cause_key"] in WARMED else {"todo": t("morning.drift_stood_do" if stands else "morning.drift_do")}
    if first.get("on_part_um") is not None:
        small = float(first["on_part_um"])
        counted = float((first.get("ignored") or {}).get("total") or own)  # what its effect on a part is of
        large = abs(small * (counted + every - own) / counted)
        effect = str(first["raw_part"]).replace(f"{small:.1f} µm", f"{large:.1f} µm", 1)
        whole |= {"on_part_um": large, "on_part": sentence(plain(effect, u, t, machine), Units())}
    return whole
