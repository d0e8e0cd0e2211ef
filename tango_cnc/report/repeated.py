"""What nights said → the same with what was decided since, and without what the night above has said already."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..texts import Said, instead, joined, say
from .days import days_between
from .tonight import OVER, STANDING

LAST_NIGHT = "last night"
BEYOND = "night.words.allowed"
BESIDES = "night.words.besides"
OPEN = "night.words.open_alarm"
MORE = "night.words.more_wait"
DECIDED = {
    "acknowledge": "night.words.has",
    "accept": "night.words.has_accepted",
    "repaired": "night.words.has_repaired",
    "ignore": "night.words.ignores",
}
ROWS = {"night.alarms.confirmed": "row.confirmed", "night.alarms.now": "row.now", "night.alarms.last_night": "row.last_night"}
CLOSED = ("accept", "repaired")


def as_decided(record: Mapping[str, Any], decisions: Sequence[Any]) -> str:
    """record of a night, decisions of its machine, oldest first → its headline; of an alarm that still stood that night it says
    who has answered it since.
    """
    headline = record.get("headline") or ""
    if not isinstance(headline, Said):
        return str(headline)
    alarms: Sequence[Mapping[str, Any]] = record.get("alarms") or ()
    told = _standing(record, headline, decisions)
    if len(alarms) != 1:  # of several nobody knows which one is meant
        return told
    since = [d for d in decisions if d.alarm == alarms[0].get("id") and d.utc >= str(record.get("end_utc") or "")]
    since = [d for d in since if d.action in DECIDED]
    if not since:
        return told
    own, who = alarms[0]["text"], _decided(since[-1])
    placed = _put(told, own, joined("; ", (own, who))) if record.get("standing") else told  # at the end "it" would be another one
    return placed if placed != told else joined("; ", (told, who))


def _decided(d: Any) -> Said:
    """decision → who has answered an alarm, how and when."""
    return say(DECIDED[d.action], owner=d.owner, date=d.utc[:10], until=d.until or "")


def _standing(record: Mapping[str, Any], headline: Said, decisions: Sequence[Any]) -> str:
    """record of a night, its headline, decisions → the same with who has answered an alarm of an earlier night that still stood."""
    if headline.key == BESIDES:
        return str(headline.but(told=_of_besides(record, headline.values["told"], decisions)))
    standing, tonight = record.get("standing") or (), bool(record.get("alarms"))
    helped = {x.get("alarm") for x in record.get("repaired") or ()}  # their ways back stood in nights that did not know of it
    known = {a["id"] for a in standing if (a.get("undoes") or {}).get("alarm") in helped}
    since = [d for d in decisions if d.utc >= str(record.get("end_utc") or "") or d.alarm in known]
    since = [d for d in since if d.action in DECIDED]
    closed = {d.alarm: d.action in CLOSED for d in since}  # the last one counts
    named = named_open(record)
    still = stories([a for a in standing if not closed.get(a["id"], False)])
    others = len(still - stories([*(record.get("alarms") or ()), *named]))
    more = say(MORE, count=others) if others else ""
    last = {d.alarm: _decided(d) for d in since}
    if headline.key == BEYOND:
        who = {key: last[a["id"]] for a in named if a["id"] in last for key in _as_told(a, record)}
        own = _of_night(_answered(headline, more, who), _found_on(record))
        return str(own if tonight else as_found(own, record))
    if headline.key not in STANDING:
        return str(_answered(headline, more, {})) if standing and tonight else str(headline)
    headline = headline.but(more=more)
    return headline.but(who=last[standing[0]["id"]]) if standing and standing[0]["id"] in last else headline


def is_alarm(x: Mapping[str, Any], a: Mapping[str, Any]) -> bool:
    """what stands behind a limit, alarm of another night → whether that is the same change."""
    key = a.get("parameter"), a.get("since")
    return all(key) and (x.get("parameter"), x.get("since")) == key


def open_alarm_of(x: Mapping[str, Any], record: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """what stands behind a limit, record of its night → the alarm of another night that is the same change; None for none."""
    return next((a for a in record.get("standing") or () if is_alarm(x, a)), None)


def named_open(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """record of a night → alarms of other nights that its headline names: the gravest one where it found none itself, and those
    that stand behind the limit that is crossed most. The others are counted there.
    """
    alarms, standing = record.get("alarms") or (), record.get("standing") or ()
    named, beyond = list(standing[: 0 if alarms else 1]), [x for x in record.get("limits") or () if x["passed"] is False]
    if beyond:
        most, own = max(beyond, key=lambda x: x["value"] / x["limit"])["what"], {a.get("parameter") for a in alarms}
        behind = [x for x in record.get("behind") or () if x["what"] == most and x.get("parameter") not in own]
        named += [a for x in behind if (a := open_alarm_of(x, record)) is not None and a not in named]
    return named


def _as_told(a: Mapping[str, Any], record: Mapping[str, Any]) -> list[tuple[str, str]]:
    """alarm that a headline names, record of its night → (its night, its sentence) there: its own, or of what stands behind the
    limit.
    """
    texts = [a["text"], *(x["text"] for x in record.get("behind") or () if is_alarm(x, a))]
    return [(str(a["night"]), str(text)) for text in texts]


def _of_besides(record: Mapping[str, Any], told: Any, decisions: Sequence[Any]) -> str:
    """record of a night, the first of two sentences of its headline, decisions → that with who has answered what it names."""
    return _standing(record, told, decisions) if isinstance(told, Said) else str(told)


def stories(alarms: Sequence[Mapping[str, Any]]) -> set[str]:
    """alarms → what they are about: a change and its way back are one story, which is called as the former."""
    return {str((a.get("undoes") or {}).get("alarm") or a.get("id") or f"{i} of {id(alarms)}") for i, a in enumerate(alarms)}


def said_of_repair(decision: Any) -> str:
    """decision that something was repaired → its remark; without one who has said so, and when."""
    return str(decision.note or f"{decision.owner}, {str(decision.utc)[:10]}")


def first_night(a: Mapping[str, Any], night: str) -> str:
    """alarm, date of the night that tells it → date of the first night that did: its id begins with it. What a repair has left was
    found by the night before that repair.
    """
    if found := before_repair(a):
        return found
    return str(a.get("night") or (str(a.get("id") or "")[:10] if a.get("goes_on") else "") or night)


def before_repair(a: Mapping[str, Any]) -> str:
    """alarm → of what a repair has left: date of the night that found it first; else ''. A record of an earlier version has the
    alarm that was repaired, whose id begins with its night.
    """
    told = a.get("repair") or {}
    return str(told.get("found") or str(told.get("alarm") or "")[:10])


def as_found(headline: Any, record: Mapping[str, Any]) -> Any:
    """headline of a night, its record → the same, to be read on another day: an alarm that the night before was without has the
    date of the night that raised it, as on the page of the machine, and not that of the night before. So has what stands behind a
    crossed limit.
    """
    for a in (x for member in ("alarms", "standing", "ignored", "unheard") for x in record.get(member) or ()):
        since, night = str(a.get("since") or ""), first_night(a, str(record.get("night")))
        if since:
            dated = instead(a["text"], LAST_NIGHT, since)
            next_to = days_between(since, night) == 1
            headline = _put(headline, a["text"], instead(dated, since, say("morning.found", date=night)) if next_to else dated)
    found = _found_on(record)
    return _of_night(headline, found) if found else headline


def on_another_day(headline: Any, record: Mapping[str, Any]) -> Any:
    """headline of a night, its record → the same, to be read on another day: what an alarm has gone on by came since the night
    before that one.
    """
    for a in record.get("alarms") or ():
        if isinstance(told := (a.get("goes_on") or {}).get("text"), Said) and told.values.get("since") == LAST_NIGHT:
            headline = _put(headline, told, told.but(since=say("row.last_night")))
    return headline


def as_dated(record: Mapping[str, Any], decisions: Sequence[Any]) -> str:
    """record of a night, decisions of its machine, oldest first → its headline as it was decided since; an alarm that goes on, and
    what a repair has left, have the date of the night that found them first, as on the page of the machine.
    """
    every = (a for member in ("alarms", "standing") for a in record.get(member) or ())
    older = [a for a in every if a.get("goes_on") or before_repair(a)]
    ignored = [a for member in ("ignored", "unheard") for a in record.get(member) or ()]
    return str(as_found(as_decided(record, decisions), {"night": record.get("night"), "alarms": [*older, *ignored]}))


def _put(text: Any, old: str, new: str) -> Any:
    """sentence, a part of it, what stands there instead → the same with that."""
    if text == old:
        return new
    if not isinstance(text, Said):
        return text.replace(old, new) if isinstance(text, str) else text
    return text.but(**{name: _put(x, old, new) for name, x in text.values.items() if isinstance(x, Said) or x == old})


def _answered(text: Any, more: str, who: Mapping[tuple[str, str], str]) -> Any:
    """sentence with standing alarms, how many more stand by now, {(night, sentence) of one: who has answered it since} → the same
    as it is now.
    """
    if not isinstance(text, Said):
        return text
    if text.key == MORE:
        return more
    values = {name: _answered(x, more, who) for name, x in text.values.items()}
    own = who.get((str(text.values["night"]), str(text.values["text"]))) if text.key == OPEN else None
    return text.but(**values | ({} if own is None else {"who": own}))


def _found_on(record: Mapping[str, Any]) -> dict[str, str]:
    """record of a night → {last night without it: night that found it} of what stands behind a crossed limit."""
    behind = [x for x in record.get("behind") or () if x.get("since") and x.get("night")]
    return {str(x["since"]): str(x["night"]) for x in behind if days_between(x["since"], x["night"]) == 1}


def _of_night(text: Any, found: Mapping[str, str]) -> Any:
    """sentence, {last night without it: night that found it} → the same with the latter date, as on the page of the machine."""
    if not isinstance(text, Said):
        return text
    values = {name: _of_night(x, found) for name, x in text.values.items()}
    if night := found.get(str(values.get("since"))):
        values["since"] = say("morning.found", date=night)
    return text.but(**values)


def shortened(headlines: Sequence[str]) -> list[str]:
    """headlines, newest first → the same; an older one about the same alarm or the same limit keeps only what is its own."""
    above = ["", *headlines]
    return [_short(text) if _same(text, newer) else text for newer, text in zip(above, headlines, strict=False)]


def of_shop(headline: str) -> str:
    """headline → as a list of nights on a page has it: a change that still stands has one date, of the night that found it."""
    if not isinstance(headline, Said) or headline.key not in STANDING:
        return headline
    text, night = headline.values["text"], headline.values["night"]
    dated = _found(text, str(night))
    if dated is None:
        return headline
    key = "morning.still_open" if headline.key == OVER else "morning.still"
    return say(key, text=dated, **{name: headline.values[name] for name in ("now", "who", "more", "part", "gap")})


def _found(text: Any, night: str) -> Said | None:
    """sentence on an alarm, date of the night that found it → the same with that date; None where it has another one: a drift may
    have begun nights before its alarm.
    """
    if not isinstance(text, Said):
        return None
    since, moved = text.values.get("since"), text.values.get("moved")
    if isinstance(since, str) and not isinstance(since, Said):
        return text.but(since=say("morning.found", date=night))
    if not isinstance(moved, Said) or days_between(moved.values.get("since"), night) != 1:
        return None
    dated = _found(moved, night)
    return None if dated is None else text.but(moved=dated)


def in_a_row(text: Any) -> Any:
    """headline of a night → the same for a list of nights, which is read on another day: no tonight, no last night, no now."""
    if not isinstance(text, Said):
        return text
    values = {name: in_a_row(x) for name, x in text.values.items()}
    return say(ROWS[text.key], **values) if text.key in ROWS else text.but(**values)


def _same(text: str, newer: str) -> bool:
    if not isinstance(text, Said) or not isinstance(newer, Said) or text.key != newer.key:
        return False
    if text.key in STANDING:
        return all(text.values.get(name) == newer.values.get(name) for name in ("night", "text"))
    return text.key == BEYOND and text.values["what"] == newer.values["what"] and _cause(text) == _cause(newer)


def _cause(text: Any) -> list[tuple[str, str]]:
    """a crossed limit, or a sentence in it → what stands behind it, without its size: keys of all sentences and their parameters.
    A night that finds a change has another one than the nights after it.
    """
    if not isinstance(text, Said):
        return []
    if text.key == BEYOND:
        return _cause(text.values.get("cause"))
    return [(text.key, str(text.values.get("name", ""))), *(one for x in text.values.values() for one in _cause(x))]


def _short(text: str) -> str:
    assert isinstance(text, Said)
    if text.key == BEYOND:
        return text.but(cause=say("row.same_cause")) if text.values.get("cause") else text
    own = {name: text.values[name] for name in ("night", "now", "part", "gap")}
    return say(f"night.words.still_{'open' if text.key == OVER else 'changed'}_since", **own)
