"""What nights and alarms mean with what the control holds now, and days on which it got or lost a compensation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any

from ..loaded import AS_SEEN, BACK, HELPS, IN_CONTROL, KEPT, Event, Holds, changes, holds, in_order
from ..texts import LIST, Said, say
from .days import local_day
from .texts import Texts, code

SHOWN = {
    "written": "written",
    KEPT: "kept",
    AS_SEEN: "as_seen",
    "rolled back": "taken_out",
}  # event: key of its words; others change nothing
HELD = {KEPT: "in_control", AS_SEEN: "in_control", "written": "in_control_written"}  # event: key of what the night says of it
ENTERING = ("cause.axis_location.do", "part.square_do", "night.most_do", "night.beyond_do")  # that speak of a compensation
GIVEN, TAKEN_OUT = "changed.after_compensation_given", "changed.after_compensation_taken_out"
ORDERS = {"written": "measure_first", "undecided": "decide", "no help": "take_out"}  # event: key of what to do
_OUR_ORDERS = tuple(f"night.{key}" for key in (*ORDERS.values(), "measure_again"))
WRITES = ("night.most_do", "night.beyond_do")  # that ask for nothing but a compensation, or a repair


def marked(events: Sequence[Any], t: Texts) -> dict[str, str]:
    """events of compensations, newest first, texts → {date: what happened on it}, oldest first."""
    found: dict[str, list[str]] = {}
    for e in reversed(events):
        if e.event in SHOWN:
            said = t(f"trend.compensation_{SHOWN[e.event]}", number=e.number)
            found.setdefault(local_day(e.utc), []).append(said)
    return {day: ", ".join(dict.fromkeys(said)) for day, said in found.items()}


def held(record: Mapping[str, Any], t: Texts, events: Sequence[Any] = ()) -> str:
    """record of a night, texts, events → what to say of a compensation in the control that probing may not see; '' without one."""
    if (newer := after(record, events)) is not None:
        return t("night.in_control_since", **_words(newer))
    if not (known := record.get("in_control")):
        return ""
    event = str(known.get("event") or (KEPT if known["measured"] else "written"))
    words = {key: known[key] for key in ("number", "target", "date")} | {"event": code(event)}
    line = t(f"night.{HELD.get(event, 'in_control_open')}", **words)
    if event in HELPS:
        return line
    beneath = f" {t('night.in_control_beneath', number=known['beneath'])}" if known.get("beneath") else ""
    return f"{line}{beneath} {t(order(event), number=known['number'], target=known['target'], event=code(event))}"


def order(event: str) -> str:
    """event after which nobody knows whether a compensation acts → key of what to do before anything else is entered."""
    return f"night.{ORDERS.get(event, 'measure_again')}"


def placed(marks: Mapping[str, str], first: date, last: date) -> list[tuple[float, str]]:
    """{date: what happened}, first and last day of a curve → (days from the first, what happened) of those between."""
    days = [(date.fromisoformat(day), said) for day, said in marks.items()]
    return [(float((day - first).days), said) for day, said in days if first <= day <= last]


def begins(events: Sequence[Any], starts: Sequence[str]) -> set[int]:
    """events of compensations, moments at which nights began (UTC), oldest first → places of the first night after each event from
    which on nights find, or reckon with, another machine: a night of the same date may have ended before.
    """
    shown = [str(e.utc)[:19] for e in events if e.event in SHOWN]
    found = {next((i for i, utc in enumerate(starts) if utc[:19] >= moment), 0) for moment in shown}
    return found - {0}


def last_written(events: Sequence[Any]) -> str:
    """events of compensations → date on which that was written which the control holds now; '' where it holds none."""
    there = holds(events)
    return "" if there is None else local_day(there.written)


def after(record: Mapping[str, Any], events: Sequence[Any]) -> Event | None:
    """record of a night, events → the last of them that the night did not know, as it came later; None where it knew all."""
    ended = str(record.get("end_utc") or "")
    newer = [e for e in in_order(events) if e.event in (*IN_CONTROL, BACK) and ended and e.utc[:19] > ended[:19]]
    return newer[-1] if newer else None


def known_then(record: Mapping[str, Any], events: Sequence[Any]) -> list[Any]:
    """record of a night that others came after, events → those that it knew."""
    ended = str(record.get("end_utc") or "")
    return [e for e in events if not ended or e.utc[:19] <= ended[:19]]


def born(alarm: Mapping[str, Any]) -> tuple[int, bool] | None:
    """alarm → number of the compensation that came into the control before its night, whether it was taken out; None without."""
    if (known := alarm.get("compensation")) is not None:
        return int(known["number"]), bool(known["taken_out"])
    text = alarm.get("raw_text") or alarm.get("text")
    if isinstance(text, Said) and text.key in (GIVEN, TAKEN_OUT):
        return int(text.values["number"]), text.key == TAKEN_OUT
    return None


def dated(alarm: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """alarm, record of its night → the same with the moment of that night, and what parts had before it as that night knew it."""
    if alarm.get("was") is not None:
        return {**alarm, "utc": record.get("start_utc")}
    own = (record.get("parameters") or {}).get(alarm.get("parameter")) or {}
    step = alarm.get("size") if alarm.get("rate_per_day") or alarm.get("repair") else own.get("change")
    was = None if step is None or "value" not in own else float(own["value"]) - float(step) - float(own.get("in_control") or 0.0)
    return {**alarm, "utc": record.get("start_utc"), "was": was}


def as_loaded(alarm: Mapping[str, Any], events: Sequence[Any]) -> dict[str, Any]:
    """alarm with the moment of its night, events → the same with what to do and what parts have as the control stands now.

    `settled`: a compensation was written after it, or the alarm is of a compensation itself: nobody enters anything by it.
    """
    there, own = holds(events), born(alarm)
    if own is not None:
        return _of_compensation(alarm, *own, there, events)
    moment = str(alarm.get("utc") or "")
    if (done := _done_since(alarm.get("do"), moment, there, events)) is not None:
        key = "night.compensation_out_do" if done.event == BACK else "night.compensation_ready_do"
        return {**alarm, "do": say(key, **_words(done)), "settled": False}
    if there is not None and _asked_then(alarm.get("do"), there):  # what that order asks for was done since
        words = {"number": there.number, "target": there.target, "event": there.event, "date": local_day(there.utc)}
        do = say("night.compensation_measured_do" if there.measured else order(there.event), **words)
        return {**alarm, "do": do, "settled": False}
    if there is None or not moment or there.written[:19] < moment[:19] or not _enters(alarm.get("do")):
        return {**alarm, "settled": False}
    words = {"number": there.number, "target": there.target, "event": code(there.event), "date": local_day(there.utc)}
    do = say("night.compensation_since_do" if there.measured else order(there.event), **words)
    part = say("part.compensation_since", number=there.number, target=there.target, date=local_day(there.written))
    return {**alarm, "do": do, "on_part": part, "on_part_um": None, "confirmed": None, "settled": True}


def _done_since(do: Any, moment: str, there: Holds | None, events: Sequence[Any]) -> Any | None:
    """what to do of a night, when that began (UTC), what the control holds, events → the last event where that is what it asks
    for: the compensation was taken out again, or one was written that waits to be loaded; else None.
    """
    last = next(iter(reversed(in_order(events))), None)
    if last is None or there is not None or not isinstance(do, Said) or not moment or str(last.utc)[:19] < moment[:19]:
        return None
    if do.key in _OUR_ORDERS:
        return last if last.event == BACK and str(do.values.get("number")) == str(last.number) else None
    return last if do.key in WRITES and last.event == "proposed" else None


def _asked_then(do: Any, there: Holds) -> bool:
    """what to do of a night, what the control holds → whether it is an order about that compensation, of before its last event."""
    ours = isinstance(do, Said) and do.key in _OUR_ORDERS and str(do.values.get("number")) == str(there.number)
    return ours and str(do.values.get("event")) != there.event


def _of_compensation(
    alarm: Mapping[str, Any], number: int, taken_out: bool, there: Holds | None, events: Sequence[Any]
) -> dict[str, Any]:
    """alarm of the night after compensation `number` was written or taken out → the same as it stands now."""
    last = next((e for e in reversed(in_order(events)) if e.number == number), None)
    found = {**alarm, "confirmed": None, "settled": True}
    if taken_out or last is None:
        part = "compensation_taken_out" if taken_out else "compensation_given"
        return found | {"on_part": say(f"part.{part}", number=number), "on_part_um": None}
    words, key = _words(last), "night.compensation_given_do"
    if last.event == BACK:
        key = "night.compensation_back_do"
    elif last.event in HELPS:
        key = "night.compensation_kept_do"
    elif last.event != "written":
        key = order(last.event)
    if last.event != BACK and there is not None and there.number != number:  # another one came on top of it
        words = {"number": there.number, "target": there.target, "event": code(there.event), "date": local_day(there.utc)}
        key = "night.compensation_kept_do" if there.measured else order(there.event)
    part = {BACK: "compensation_back", KEPT: "compensation_kept", AS_SEEN: "compensation_kept"}.get(
        last.event, "compensation_given"
    )
    return found | {"do": say(key, **words), "on_part": say(f"part.{part}", number=number), "on_part_um": None}


def _words(e: Event) -> dict[str, Any]:
    return {"number": e.number, "target": e.target, "event": code(e.event), "date": local_day(e.utc)}


def _enters(do: Any) -> bool:
    """what to do about an alarm → whether it speaks of a compensation, or is what was said in place of that."""
    first = do.values.get("0") if isinstance(do, Said) and do.key == LIST else do
    ours = ("night.compensation_since_do", *_OUR_ORDERS)
    return isinstance(first, Said) and first.key in (*ENTERING, *ours)


def broken(events: Sequence[Any], repaired: Sequence[str], since: str, until: str) -> bool:
    """events, moments of repairs, two moments → whether the control got or lost a compensation, or somebody repaired, between."""
    return bool(changes(events, since, until)) or any(since[:19] <= r[:19] < until[:19] for r in repaired)
