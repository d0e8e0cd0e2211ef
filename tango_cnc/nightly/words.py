"""The sentence that a telephone shows of a night, and what each cause means."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ..report.repeated import is_alarm, named_open, open_alarm_of, stories
from ..report.texts import texts
from ..report.tonight import is_gone, is_over, moved_on
from ..report.units import shown
from ..report.words import moved, named, unit_of
from ..texts import Said, joined, say
from ..texts.number import Number, number

LONG = 30  # nights without a measurement: a clock that has jumped ahead looks the same


def cause_texts(cause: str, effect_um: float, since: str = "") -> tuple[str, str]:
    """cause, µm that it does at most, date since when or '' → what it means for a part, what to do (tango_cnc/texts/en.toml)."""
    key, t = f"cause.{cause}.on_part", texts()
    key = f"{key}_since" if since and f"{key}_since" in t else key
    return on_part(key, since, effect=number(effect_um, "µm", signed=False)), t(f"cause.{cause}.do")


def on_part(key: str, since: str, **values: str) -> str:
    """key, date since when it is a change ('': it is a whole error), values → what it means for a part."""
    return texts()(key, **({"since": since} if since else {}), **values)


def changed(
    parameter: str, size: str, since: str = "last night", alike: Collection[str] = (), sizes: Mapping[str, str] | None = None
) -> str:
    """name of ISO 230-1 or a facet, size of its change, since when, locations that no touch tells from it, the sizes of those that
    would have moved by another one → a sentence that names the axis before the symbol, and every other one that may have moved.
    """
    return moved(parameter, size, since, alike=tuple(alike), sizes=sizes)


def sizes_of(share: Mapping[str, float], size: float, std: float | None = None) -> dict[str, str]:
    """{location that no touch tells from a parameter: how much of it does the same as 1 mm or 1 rad}, size of the change of that
    parameter, standard deviation → {location: its own size}, of those alone that would have moved by another one.
    """
    other = {name: by for name, by in share.items() if by != 1}
    return {name: value(size * by, unit_of(name), None if std is None else std * abs(by)) for name, by in other.items()}


def as_recorded(share: Mapping[str, float]) -> dict[str, Any]:
    """{location that no touch tells from a parameter: how much of it does the same} → what an alarm has of it in its record."""
    other = {name: by for name, by in share.items() if by != 1}
    return ({"alike": list(share)} if share else {}) | ({"alike_by": other} if other else {})


def value(size: float, unit: str, std: float | None = None, *, signed: bool = True) -> Number:
    """size in mm, rad …, unit, standard deviation, whether a plus is shown → '+19.8 ± 0.4 µm'."""
    factor, name = shown(unit)
    return number(size * factor, name, None if std is None else std * factor, signed=signed)


def pace_of(rate: float, unit: str, share: Mapping[str, float]) -> Number:
    """change a day of a parameter (mm, rad …), its unit, {location that no touch tells from it: how much of it does the same} → the
    same for people; without a sign where another one would go as fast the other way.
    """
    ways = {by for by in share.values() if by != 1}
    return value(abs(rate), unit, signed=False) if ways == {-1} else value(rate, unit)


def a_day(moved: str, rate: float, unit: str, share: Mapping[str, float]) -> str:
    """sentence on what has moved, change a day, its unit, {location that no touch tells from it: how much of it does the same} →
    that it goes on, and how fast; where the others go at another pace, whose that is.
    """
    first = any(abs(by) != 1 for by in share.values())
    return texts()("changed.drift_first" if first else "changed.drift", moved=moved, rate=pace_of(rate, unit, share))


def one_day(days: float) -> str:
    """days to come → ending of the key of the sentence: _one for one day or less, '' for more."""
    return "_one" if round(days) <= 1 else ""


def headline(record: Mapping[str, Any]) -> str:
    """record of a night → one sentence; what somebody changed in the cell comes first where anything is found."""
    told = _headline(record)
    if record.get("edited") and record["alarms"] and record["verdict"] in ("changed", "out_of_limits"):
        return say("night.words.after_edit", edited=record["edited"]["text"], told=told)
    return told


def _headline(record: Mapping[str, Any]) -> str:
    if record["status"] == "missed":
        return say("night.words.no_measurement", why=record["why"])
    if record["status"] == "refused":
        return say("night.words.not_begun_was_not_disturbed", why=record["why"])
    if record["verdict"] == "not_measured":
        return say("night.words.not_measured", why=record["why"])
    alarms, helped = record["alarms"], record.get("repaired") or ()
    put_right = joined("; ", [one["text"] for one in helped]) if helped else None
    if record["verdict"] == "doubtful":
        reasons = (record.get("plausible") or {}).get("reasons") or [record.get("why") or say("night.words.see_report")]
        return say("night.words.readings_not_be_relied_on", reason=reasons[0])
    beyond = [limit for limit in record["limits"] if limit["passed"] is False]
    if alarms and not beyond:
        return joined("", (every(alarms), more)) if (more := _more(record)) else every(alarms)
    part = (
        say("night.words.stopped_after_touches", touches=record["touches"], planned=record["planned"])
        if record["status"] == "partial"
        else ""
    )
    gap = _gap(record)
    if beyond:
        b = max(beyond, key=lambda limit: limit["value"] / limit["limit"])
        behind = [_as_it_stands(x, record) for x in record.get("behind") or () if x["what"] == b["what"]]
        by_alarm = {alarm.get("parameter") for alarm in alarms}
        why = [_of_its_alarm(x, record) for x in behind if x.get("parameter") not in by_alarm]
        own, named_ = [every(alarms)] if alarms else [], named_open(record)
        why = [*own, *why] if behind and behind[0].get("parameter") in by_alarm else [*why, *own]  # what does most comes first
        if not alarms and named_ and not any(is_alarm(x, named_[0]) for x in behind):
            why.append(_open(named_[0], named_[0]["text"]))
        cause = joined("", (": ", joined("; ", why), _more(record, named_))) if why else ""
        crossed = say(
            "night.words.allowed",
            what=what_of(b["what"]),
            value=number(b["value"], signed=False),
            unit=b["unit"],
            limit=f"{b['limit']:g}",
            cause=cause,
            part=part,
            gap=gap,
        )
        crossed = crossed if put_right is None or alarms else say("night.words.besides", told=crossed, text=put_right)
        return _who_ignores(crossed, record, {x.get("parameter") for x in behind})
    if standing := record.get("standing"):
        first = standing[0]
        more = _more(record, standing[:1])
        by_now = joined("; ", (first.get("now"), (first.get("ahead") or {}).get("text")))
        now = joined("", (" (", by_now, ")")) if by_now else ""
        who = _who(first)
        waiting = say(
            f"night.words.{'gone' if is_over(first) else 'changed'}_since_night",
            night=first["night"],
            text=first["text"],
            now=now,
            who=who,
            more=more,
            part=part,
            gap=gap,
        )
        trend = record.get("trend") or {}
        known = {a["parameter"] for a in standing if a.get("rate_per_day")}  # that goes on is what its alarm says
        more_told = put_right or (None if trend.get("parameter") in known else trend.get("text"))
        return waiting if more_told is None else say("night.words.besides", told=waiting, text=more_told)
    nothing = say("night.words.nothing_has_changed")
    if put_right is not None:
        nothing = say("night.words.after_repair", text=put_right)
    elif unheard := record.get("ignored"):
        told = unheard[0]
        nothing = say("night.words.no_alarm_as_ignored", text=told["text"], owner=told["owner"], until=told["until"])
    elif (trend := record.get("trend")) and not _unheard(record):
        nothing = say("night.words.no_alarm_but", text=trend["text"])
    if silent := () if record.get("ignored") else _unheard(record):
        nothing = _beside_unheard(nothing if put_right else None, silent, record.get("trend"))
    first_time = (record.get("change") or {}).get("p_value") is None
    first_word = say("night.words.first_time_renamed" if record.get("former") else "night.words.first_time")
    open_ones = [limit for limit in record["limits"] if limit["passed"] is None]
    if open_ones:
        o = open_ones[0]
        return say(
            "night.words.whether_within_not_certain",
            nothing=first_word if first_time else nothing,
            part=part,
            what=what_of(o["what"]),
            limit=f"{o['limit']:g}",
            unit=o["unit"],
            gap=gap,
        )
    volume = (record.get("volume") or {}).get("worst_um")
    told = "" if volume is None else say("night.words.largest_error_over_volume", volume=number(volume, signed=False))
    old_name = say("night.words.former_waits") if record.get("former") and not first_time else ""
    return joined("", (first_word if first_time else nothing, part, told, gap, old_name))


def _of_its_alarm(x: Mapping[str, Any], record: Mapping[str, Any]) -> Any:
    """what stands behind a limit, record → what the headline says of it: a change that is an open alarm is said once, as that, with
    the size that it has by now where that is another number.
    """
    one = open_alarm_of(x, record)
    return x["text"] if one is None else _open(one, x["text"])


def _as_it_stands(x: Mapping[str, Any], record: Mapping[str, Any]) -> Mapping[str, Any]:
    """what stands behind a limit, record → the same; what an alarm of another night has found has the size of its page: as it was
    found, until what has come together is another number.
    """
    for a in record.get("standing") or ():
        same = x.get("since") and (x.get("parameter"), x["since"]) == (a.get("parameter"), a.get("since"))
        if same and a.get("total") is not None and not moved_on(a):
            return {**x, "text": a["text"]}
    return x


def _open(alarm: Mapping[str, Any], text: Any) -> Said:
    """alarm that stands, its sentence → the sentence with the night of the alarm and who has it."""
    return say("night.words.open_alarm", night=alarm["night"], text=text, who=_who(alarm))


def _who(alarm: Mapping[str, Any]) -> Said:
    """alarm of another night → who has it, or that nobody has answered it."""
    if alarm["decision"]:
        return say("night.words.has", owner=alarm["owner"])
    return say("night.words.nobody_has_answered_alarm", night=alarm["night"])


def _more(record: Mapping[str, Any], named_: Sequence[Mapping[str, Any]] = ()) -> str:
    """record, standing alarms that the headline names → how many more stand; '' for none."""
    count = len(stories(record.get("standing") or ()) - stories([*record["alarms"], *named_]))
    return say("night.words.more_wait", count=count) if count > 0 else ""


def _who_ignores(told: str, record: Mapping[str, Any], behind: Collection[Any]) -> str:
    """sentence of a crossed limit, record, parameters that stand behind it → the same with who ignores what until when."""
    silent = [*(record.get("ignored") or ()), *_unheard(record)]
    if not silent:
        return told
    first = next((a for a in silent if a.get("parameter") in behind), silent[0])
    more = say("night.words.more_ignored", count=len(silent) - 1) if len(silent) > 1 else ""
    name = named(str(first.get("parameter") or first["text"]), texts())
    return say("night.words.beyond_ignored", told=told, owner=first["owner"], until=first["until"], name=name, more=more)


def _unheard(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """record → what somebody ignores and that has not gone again."""
    return [a for a in record.get("unheard") or () if not is_gone(a["now"])]


def _beside_unheard(told: str | None, silent: Sequence[Mapping[str, Any]], trend: Mapping[str, Any] | None) -> Said:
    """what a repair has done (None: nothing), what somebody ignores, a trend → the sentence of a night without an alarm."""
    first = silent[0]
    text = joined("", (first["text"], *((" (", first["now"], ")") if first["now"] else ())))
    more = say("night.words.more_ignored", count=len(silent) - 1) if len(silent) > 1 else ""
    unheard = say("night.words.no_alarm_as_ignored", owner=first["owner"], until=first["until"], text=joined("", (text, more)))
    whole = unheard if told is None else joined("; ", (told, unheard))
    if trend is None or trend.get("parameter") in {a.get("parameter") for a in silent}:
        return whole
    return say("night.words.besides", told=whole, text=trend["text"])


def every(alarms: Sequence[Mapping[str, Any]]) -> str:
    """alarms of a night, one at least → all of them in one sentence."""
    texts_ = [joined("; ", (a["text"], more["text"])) if (more := beside(a)) else a["text"] for a in alarms]
    text = texts_[0]
    for other in texts_[1:]:
        text = say("changed.besides", text=text, other=other)
    return str(text)


def beside(a: Mapping[str, Any]) -> Mapping[str, Any]:
    """alarm of tonight → what its night says of the alarm that it goes on from or follows, with its `text`; {} for none."""
    return a.get("goes_on") or a.get("follows") or {}


def what_of(name: str) -> str:
    """name of a limit → its word; a symbol stays as it is."""
    return say("followed.volume") if name == "volume" else name


def _gap(record: Mapping[str, Any]) -> str:
    """record of a night → what a headline says of the nights before: those that are missing, or one that is dated after it."""
    if record.get("clock_back"):
        return say("night.words.clock_went_back", newest=record["clock_back"])
    count = record.get("unmeasured_count") or len(record.get("unmeasured") or ())
    if not count:
        return ""
    if count == 1:
        return say("night.words.night_before_was_not_measured")
    if count > LONG:
        return say("night.words.long_before_not_measured", count=count)
    return say("night.words.nights_before_were_not_measured", count=count)
