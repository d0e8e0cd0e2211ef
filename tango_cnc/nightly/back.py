"""What an alarm named goes back: by how much, how much is left, and how much of that tonight's touches can tell from nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..history.answers import of_machine
from ..report.texts import texts
from ..report.words import PLACE, spoken, who_moved
from ..texts import LIST, Said, joined, say
from .moved import Moved
from .ports import Past
from .words import sizes_of, value

OWN = ("pretravel", "scales", "table", "stylus")  # causes with a sentence of their own


def unclosed(past: Past, machine: str, before: Any, like: Mapping[str, Any]) -> Iterator[tuple[Any, Mapping[str, Any]]]:
    """history, machine, the night before which (None: tonight), an alarm → the nights that found the same cause in the same
    parameter, and their alarms, oldest first, as far as nobody has closed them.
    """
    if not past.knows(machine):
        return
    known = of_machine(past, machine)
    for stored in reversed(past.alarmed(machine)):
        if before is not None and stored.night.start_utc >= before.night.start_utc:
            continue
        for a in stored.record["alarms"]:
            if (a["cause"], a["parameter"]) == (like["cause"], like["parameter"]) and not known.closed(a["id"]):
                yield stored, a


def went_back(wrong: Mapping[str, Any], m: Moved, then: float) -> tuple[Said, Said]:
    """alarm, how far what it named is from where it was, size before it went back → the sentence that says by how much it went back
    and what is left; the latter alone.
    """
    parameter = str(wrong["parameter"])
    _, now, std = m.along()
    left = _left(m, then, now, std)
    what = _what(wrong, _size(m, now - then), now - then)
    return joined(": ", (what, left)), say("night.repaired.left", name=parameter, told=value(now, m.unit, std))


def gone(alarm: Mapping[str, Any], m: Moved, then: float) -> Said:
    """alarm of tonight that takes back an older one, how far that is from where it was, its size → the sentence of tonight's."""
    _, now, std = m.along()
    size, spread = float(alarm["size"]), float(alarm["std"])
    what = _what(alarm, _size(m, size, spread), size, spread)
    return say("back.since", what=what, since=_since(alarm), left=_left(m, then, now, std))


def _size(m: Moved, size: float, std: float | None = None) -> str:
    """how far it is, how far it went, standard deviation → the latter with its sign where it is one number, else its length."""
    signed = len(m.then) == 1
    return value(size if signed else abs(size), m.unit, std, signed=signed)


def _left(m: Moved, then: float, now: float, std: float) -> Said:
    """→ what is left of what, and what touches can tell of it."""
    least = value(m.least(), m.unit, signed=False)
    seen = say("back.nothing", least=least) if not m.seen() else say("back.older" if m.apart() else "back.tenth")
    return say("back.left", left=value(now, m.unit, std), before=_size(m, then), seen=seen)


def _since(alarm: Mapping[str, Any]) -> str:
    """alarm of tonight → since when, as its sentence says it."""
    text = alarm["text"]
    found = text.values.get("since") if isinstance(text, Said) and text.key != LIST else None
    return found if isinstance(found, str) else str(alarm["since"])


def _what(a: Mapping[str, Any], size: str, change: float, std: float | None = None) -> Said:
    """alarm, by how much as a text, in its unit, standard deviation → that it went back by so much."""
    cause, parameter, alike = str(a["cause"]), str(a["parameter"]), a.get("alike") or ()
    if cause in OWN:
        return say(f"back.{cause}", size=size)
    kind, _, place = parameter.partition(" ")
    if kind in ("facet", "ball"):
        return say("back.named", what=say(f"followed.{kind}", name=place), size=size)
    if spoken(parameter) == parameter:
        return say("back.named", what=parameter, size=size)
    what, others = who_moved(parameter, alike, texts(), sizes_of(a.get("alike_by") or {}, change, std))
    told = {"what": what, "size": size, "name": parameter} | ({"others": others} if others else {})
    by = "_by" if others else ""
    if match := PLACE.fullmatch(parameter):
        return say(f"back.off{by}", letter=match[1], **told)
    return say(f"back.other{by}", **told)
