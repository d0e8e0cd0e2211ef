"""Alarms that belong together: those of one parameter are one fault, told with how far it has come by now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..records import Machine
from ..state.changes import change
from ..texts import Said
from .alarm import sentence, since_when, whole_sentence
from .compensated import born, broken, last_written
from .days import day, days_between
from .plain import amount, office, plain, shop, signed
from .texts import Texts
from .tonight import WARMED, hardly_known, has_grown, is_gone, is_unseen, std_now, with_effect
from .units import Units, shown
from .words import moved, spoken, unit_of

CLOSED = ("accept", "repaired")  # decisions after which a cause acts no more
KNOCK = 3.0  # times what a drift makes a day, from which one night is a knock on top of it
SAME = 0.25  # share of its size by which what stands may differ from what was found, and still be one step


def closed(a: Mapping[str, Any]) -> bool:
    """alarm → whether somebody has accepted or repaired it."""
    return a["decision"] is not None and a["decision"].action in CLOSED


@dataclass(frozen=True)
class _Telling:
    """How a page tells it: units, texts, chain of axes; date of the last night that measured, and whether it is too old."""

    u: Units
    t: Texts
    machine: Machine | None
    known_of: str
    old: bool


@dataclass(frozen=True)
class _Story:
    """Alarms of one parameter, oldest first: size of the oldest, of all (mm or rad), two knocks in words, whether it drifts."""

    same: Sequence[Mapping[str, Any]]
    own: float
    every: float
    knocks: str
    drifts: bool

    @property
    def one_number(self) -> bool:
        """→ whether the parameter is one number, which has a sum; several numbers have none."""
        return spoken(str(self.same[0].get("parameter"))) != self.same[0].get("parameter")

    @property
    def goes_on(self) -> bool:
        """→ whether its steps are not counted by its alarms."""
        return any(a.get("goes_on") for a in self.same)

    @property
    def has_moved_on(self) -> bool:
        """→ whether what stands is another size than the oldest alarm found."""
        return bool(self.own) and (self.drifts or has_grown(self.every, self.own, self.same[0].get("std"), std_now(self.same[0])))


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
    compensation has settled is apart from what came after it, and what has gone back from what came after that.
    """
    how = _Telling(u, t, machine, known_of, old)
    groups: dict[tuple[str, bool, bool, int], list[dict[str, Any]]] = {}
    for a in alarms:
        key = str(a.get("parameter") or a["id"]), bool(a.get("settled")), _on_a_drift(a, alarms), _gone_before(a, alarms)
        groups.setdefault(key, []).append(a)
    written = last_written(events)
    found = []
    for (parameter, settled, knocked, times), same in groups.items():
        same.sort(key=_moment)
        apart = [
            a
            for (other, held, on_a_drift, later), those in groups.items()
            if (other, held) == (parameter, settled) and (on_a_drift > knocked or later > times)
            for a in those
        ]
        story = _story(same, knocked, apart, events, repaired, how)
        found.append(_as_first_unanswered(_one_of(story, written, how), same))
    return found


def _story(
    same: Sequence[dict[str, Any]],
    knocked: bool,
    apart: Sequence[Mapping[str, Any]],
    events: Sequence[Any],
    repaired: Sequence[str],
    how: _Telling,
) -> _Story:
    """alarms of a parameter, whether they are knocks on a drift, later ones of it that are told apart → what came together."""
    first, sizes = same[0], [float(a.get("size") or 0.0) for a in same]
    every = sum(sizes)
    if first.get("total") is not None and not knocked:
        later = [] if first.get("ended") else [a for a in apart if _moment(a) > _moment(first)]  # total ends where it went back
        every = float(first["total"]) - sum(float(a["size"]) for a in later)
    story = _Story(same, sizes[0], every, "", False)
    knocks = _knocks(same, how.known_of, how.u, how.t) if story.one_number else ""
    steady = any(a.get("rate_per_day") and a.get("steady", True) for a in same)
    drifts = not _swings(same) and (steady or (not knocks and _one_way(same, events, repaired)))
    return replace(story, knocks=knocks, drifts=drifts)


def _swings(same: Sequence[Mapping[str, Any]]) -> bool:
    """alarms of a parameter → whether it goes and comes with the temperature: then its steps are no story, and have no sum."""
    return all(a.get("swing") for a in same)


def _one_of(story: _Story, written: str, how: _Telling) -> dict[str, Any]:
    """story, date of the last compensation → the oldest of its alarms, as all of them are told."""
    same = story.same
    open_since = [str(a["since"]) for a in same if a.get("since") and (not closed(a) or a.get("unmeasured"))]
    gone = _gone(same) and (not story.drifts or all(is_gone(a.get("now") or "") for a in same))
    first = {
        **same[0],
        "begun": min(open_since, default=same[0]["begun"]),
        "drifts": story.drifts and not gone,
        "ids": [a["id"] for a in same if a["decision"] is None and a["id"]],
        "total": story.every,
        "typed": [a["id"] for a in same if a["id"] and not closed(a) and not any(_undoes(a, b) and _alike(a, b) for b in same)],
        "held": [a["id"] for a in same if a["decision"] is not None and not closed(a)],
        "unmeasured": any(a.get("unmeasured") for a in same),
        "tonight": any(not a.get("older") for a in same),
        "let_be": any(a.get("let_be") for a in same) and all(a.get("let_be") or closed(a) for a in same),
        "gone": gone,
        "gone_by": next((str(a["first"]) for a in same if gone and _undoes(a, same[0])), str(same[0].get("gone_by") or "")),
    }
    if gone:
        unknown = len(same) == 1 and same[0].get("total") is None and not same[0].get("undoes")
        first |= _gone_back(first, story.own, None if unknown else story.every, how.u, how.t)
    elif same[0].get("older") and is_unseen(same[0].get("now")) and not story.drifts:
        first |= _unseen(first, story.own, story.every, how)
    elif _swings(same):
        first |= {"total": None}
    elif story.has_moved_on and story.one_number:
        first |= _moved_on(first, story, written, how)
    else:
        first |= _as_found(first, story, how)
    if how.old and how.known_of and first["id"] and not closed(first):
        first["text"] = f"{first['text']} {how.t('morning.unknown_now', date=day(how.known_of, how.t))}"
    return first


def _as_first_unanswered(told: Mapping[str, Any], same: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """what is told, its alarms → the same, asked of whom the oldest alarm asks that nobody has answered."""
    unanswered: Mapping[str, Any] = next((a for a in same if a["decision"] is None), {})
    return {
        **told,
        **{k: unanswered[k] for k in ("decision", "decided", "owner", "who", "nobody", "night", "asked", "silent") if unanswered},
    }


def _moved_on(first: Mapping[str, Any], story: _Story, written: str, how: _Telling) -> dict[str, Any]:
    """oldest alarm, story of a number that is another one today, date of the last compensation → how it is told as a whole."""
    same, t, drifts = story.same, how.t, story.drifts
    steady = next((a for a in reversed(same) if a.get("rate_per_day") and a.get("steady", True)), None)
    steps = 1 if story.goes_on or steady is not None else len(same)  # a drift is counted by no alarm
    pace = {} if steady is None else {key: steady.get(key) for key in ("stands", "slowed")}
    told = _whole({**first, **pace}, story.own, story.every, drifts and not how.old, steps, how.u, t, how.machine)
    if story.knocks and not drifts:
        told["text"] += f" {story.knocks}"
    if not (how.old or story.knocks or story.goes_on or drifts) and how.known_of > str(first["first"]):
        told["then"] = _then(first, story.own, how.known_of, how.u, t)
        told["text"] += f" {told['then']}"
    if story.knocks and str(how.known_of) <= str(same[-1]["first"]):
        told["todo"] = same[-1]["todo"]
    if drifts and written and written >= str(same[-1]["night"]):
        told["todo"] = t("morning.drift_written_do", date=day(written, t))
    return told


def _as_found(first: Mapping[str, Any], story: _Story, how: _Telling) -> dict[str, Any]:
    """oldest alarm, story of what is as it was found, or of several numbers, which have no sum → its sentences."""
    same, t = story.same, how.t
    if len(same) == 1 and first.get("goes_on") and not first["older"] and not first.get("steady", True):
        return {"text": f"{first['text']} {t('morning.twice')}"}
    if first["older"] and hardly_known(first) and not how.old:
        still = how.t("morning.hardly_known", date=day(how.known_of, t))
        return {"still": still, "text": f"{first['text']} {still}"}
    if first["older"] and first.get("now") and not how.old:
        now = plain(_confirmed_on(first["now"], how.known_of, t), how.u, t, how.machine)
        dated = bool(how.known_of) and _of_two_nights(first["now"])
        told = t("morning.now_of", told=now, date=day(how.known_of, t)) if dated else now
        still = whole_sentence(sentence(told, Units(), t))
        return {"still": still, "text": f"{first['text']} {still}"}
    if len(same) > 1 and not story.one_number:
        if same[-1]["text"] == first["text"]:  # the same words of two nights: each has its date
            nights = {"date": day(first["first"], t), "other": day(same[-1]["first"], t)}
            return {"text": f"{first['text']} {t('morning.found_twice', **nights)}"}
        return {"text": f"{same[-1]['text']} {t('morning.before_that', text=first['text'])}"}
    return {}


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
    nights = {"date": day(known_of, t), "first": day(str(first["id"])[:10] or first["first"], t)}
    return t("morning.then_of", size=signed(own * factor, unit, u, t), **nights)


def _gone(same: Sequence[Mapping[str, Any]]) -> bool:
    """alarms of a parameter, oldest first → whether it is back where it was before the oldest of them."""
    if same[0]["older"] and is_gone(same[0].get("now") or ""):
        return True
    return any(_undoes(a, same[0]) for a in same)


def _undoes(a: Mapping[str, Any], first: Mapping[str, Any]) -> bool:
    """alarm, the oldest of its parameter → whether it is the way back of that one."""
    return bool((a.get("undoes") or {}).get("alarm") == first["id"])


def _alike(a: Mapping[str, Any], first: Mapping[str, Any]) -> bool:
    """alarm of a way back, the one that it takes back → whether one answer answers both: neither has one, or both do."""
    return not closed(first) and (a["decision"] is None) == (first["decision"] is None)


def _gone_back(first: Mapping[str, Any], own: float, left: float | None, u: Units, t: Texts) -> dict[str, Any]:
    """oldest alarm of a parameter that has gone back, its size, what is left (None: nobody knows) → sentence, effect, advice."""
    factor, unit = shown(str(first.get("unit") or "mm"))
    rest = {} if left is None else {"left": amount(abs(left * factor), unit, u, t)}
    sizes = {**rest, "size": amount(abs(own * factor), unit, u, t)}
    warm = first["cause_key"] == "temperature"
    key = "scatter_gone" if change(first["cause_key"]).scatters else "warm_gone" if warm else "gone_back"
    do = t("night.sensors.warm_gone_do" if warm else "night.gone_do")
    do = t("night.sensors.went_with_do", **first["went_with"]) if first.get("went_with") else do
    key = f"morning.{key}" if rest else f"morning.{key}_only"
    told = {"text": f"{first['text']} {t(key, **sizes) if rest else t(key)}", "todo": shop(do, t), "office": office(do, t)}
    key, until = ("gone_part_by", day(first["gone_by"], t)) if first.get("gone_by") else ("gone_part", "")
    key = "gone_part_probe" if change(first["cause_key"]).scatters else key
    part = t(f"morning.{key}", date=day(first.get("since") or first["first"], t), until=until) if first["on_part"] else ""
    return told | {"on_part": part}


def _unseen(first: Mapping[str, Any], own: float, left: float, how: _Telling) -> dict[str, Any]:
    """oldest alarm of a parameter that no longer shows, its size, what there is of it → its sentence as its night wrote it, and
    that it has gone again, as far as the last night that measured can tell.
    """
    factor, unit = shown(str(first.get("unit") or "mm"))
    words = {"left": amount(abs(left * factor), unit, how.u, how.t), "date": day(how.known_of, how.t)}
    told = how.t("morning.unseen_turned" if left * own < 0 else "morning.unseen", **words)
    return {"text": f"{first['text']} {told}", "unseen": True}


def _on_a_drift(a: Mapping[str, Any], alarms: Sequence[Mapping[str, Any]]) -> bool:
    """alarm, all alarms → whether it is a knock on a parameter that drifts: far more in one night than the drift makes in one."""
    same = [x for x in alarms if x.get("rate_per_day") and x.get("steady", True) and x.get("parameter") == a.get("parameter")]
    rates = [abs(float(x["rate_per_day"])) for x in same]
    return bool(rates) and not a.get("rate_per_day") and abs(float(a.get("size") or 0.0)) > KNOCK * max(rates)


def _gone_before(a: Mapping[str, Any], alarms: Sequence[Mapping[str, Any]]) -> int:
    """alarm, all alarms → how often its parameter had gone back before it: what moves after that is another event."""
    same = [x for x in alarms if (x.get("undoes") or _sound_again(x)) and x.get("parameter") == a.get("parameter")]
    return sum(_moment(x) < _moment(a) for x in same)


def _sound_again(a: Mapping[str, Any]) -> bool:
    """alarm → whether it is of touches that no longer scatter, or of a machine as warm as before: no alarm of its own tells the way
    back.
    """
    by_itself = change(a.get("cause_key")).scatters or a.get("cause_key") == "temperature"
    return by_itself and is_gone(a.get("now") or "")


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


def signed_of(a: Mapping[str, Any], size: float, u: Units, t: Texts) -> dict[str, str]:
    """alarm, how far its parameter has moved or is off, in its unit, units, texts → {location that no touch tells from it and that
    would be so by another size: its own}.
    """
    told = {}
    for name, by in (a.get("alike_by") or {}).items():
        factor, unit = shown(unit_of(name))
        told[str(name)] = signed(size * float(by) * factor, unit, u, t)
    return told


def _whole(
    first: Mapping[str, Any], own: float, every: float, drifts: bool, steps: int, u: Units, t: Texts, machine: Machine | None
) -> dict[str, Any]:
    """oldest alarm of a parameter, its size, that of all, whether it drifts, alarms → sentence, effect, advice as a whole."""
    factor, unit = shown(str(first.get("unit") or "mm"))
    size, when = signed(every * factor, unit, u, t), since_when({**first, "night": first["first"]}, t)
    text = moved(str(first["parameter"]), size, when, t, first.get("alike") or (), signed_of(first, every, u, t))
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
        effect = with_effect(first["raw_part"], small, large)
        whole |= {"on_part_um": large, "on_part": sentence(plain(effect, u, t, machine), Units())}
    return whole
