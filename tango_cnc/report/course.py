"""A curve of a trend → one sentence: what it does since when, by how much, and what of the limit.

It is steady or goes to and fro, rises or falls by so much a week, or has jumped. A jump is an alarm of a night, what a repair
of one has put back, or what a compensation has taken away. A drift of an alarm has its words here, from the night before it
on. What has moved since the last one counts from twice and a half what the two ends are known to, or what its steps from
night to night make by chance. Where the last fortnight goes another way than all since then, the sentence is of the
fortnight. No forecast reaches farther ahead than its nights reach back.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import date, timedelta
from typing import Any

import numpy as np

from ..records import Array
from ..state.changes import change
from .days import day
from .pace import RECENT, by_chance, pace
from .texts import Texts
from .tonight import shows
from .units import inches

LEAST = 5  # nights since the last jump before anything is said of how it goes on: what wanders looks like a rate in fewer
SURE = 2.58  # standard deviations of the difference of the ends (99 %)
OTHER = 2.0  # times the rate of the whole stretch at which the sentence takes that of the last fortnight
VARIES = 2.0  # times what a value is known to: what differs by more from night to night is not steady
SEEN = 3.5  # standard deviations that a drift would have moved by, before it can be said to rest
Jump = tuple[int, float]  # place in the series, size in its unit
Known = tuple[Array, Array]  # (n,) values, (n,) standard deviations
Told = tuple[int, int] | None  # places of the night before a drift, and of the first night that told it


def jumps_of(
    alarms: Mapping[int, Sequence[Mapping[str, Any]]],
    entries: Sequence[int],
    name: str,
    factor: float,
    back: Collection[Jump] = (),
) -> list[Jump]:
    """{entry: alarms of that night}, entries of a series, parameter, factor to its unit, what repairs have put back (unit of the
    record) → its jumps, oldest first.
    """
    found, drifts = [(place, size * factor) for place, size in back], _drifts(alarms)
    repaired = {place for place, _ in found}
    for place, entry in enumerate(entries):
        own = [a for a in alarms.get(entry, ()) if a.get("parameter") == name and a.get("size") and _at_once(a, drifts)]
        if own and place and place not in repaired:
            found.append((place, float(own[0]["size"]) * factor))
    return sorted(found)


def by_repairs(
    alarms: Mapping[int, Sequence[Mapping[str, Any]]], decisions: Iterable[Any], starts: Sequence[str], name: str, known: Known
) -> list[Jump]:
    """{entry: alarms of that night}, decisions, moments at which the nights of a series began (UTC), parameter, its (n,) values and
    (n,) standard deviations → how far it went in the first night after each repair of its alarms, where that shows.
    """
    own = {a.get("id") for every in alarms.values() for a in every if a.get("parameter") == name}
    (value, std), found = known, dict[int, float]()
    for d in decisions:
        if d.action != "repaired" or d.alarm not in own:
            continue
        place = next((i for i, utc in enumerate(starts) if utc >= d.utc), 0)
        size = float(value[place] - value[place - 1])
        if place and abs(size) > SURE * float(np.hypot(std[place - 1], std[place])):
            found[place] = size
    return sorted(found.items())


def by_compensations(places: Collection[int], known: Known, back: Collection[Jump] = ()) -> list[Jump]:
    """places of the first nights with another compensation in the control, (n,) values and (n,) standard deviations of a parameter,
    its other jumps that no alarm told → these and how far it went in each of those nights, where that shows.
    """
    (value, std), found = known, dict(back)
    for place in places:
        size = float(value[place] - value[place - 1])
        if place not in found and abs(size) > SURE * float(np.hypot(std[place - 1], std[place])):
            found[place] = size
    return sorted(found.items())


def _at_once(alarm: Mapping[str, Any], drifts: Collection[str]) -> bool:
    """alarm, ids of drifts → whether it moved in its night: a drift did not, nor what a repair has left."""
    return not alarm.get("rate_per_day") and not alarm.get("repair") and str(alarm.get("id")) not in drifts


def _drifts(alarms: Mapping[int, Sequence[Mapping[str, Any]]]) -> set[str]:
    """{entry: alarms of that night} → ids of those that went on night after night: what their first night found was no jump."""
    every = [a for own in alarms.values() for a in own if a.get("rate_per_day") and a.get("steady", True) and a.get("id")]
    return {str(x) for a in every for x in (a["id"], *((a.get("goes_on") or {}).get("with") or ()))}


def jumps_of_tip(
    alarms: Mapping[int, Sequence[Mapping[str, Any]]],
    entries: Sequence[int],
    value: Array,
    std: float,
    begins: Collection[int] = (),
) -> list[Jump]:
    """{entry: alarms of that night}, entries, (n,) error at the tool tip, its standard deviation, places of nights that begin with
    another compensation → its jumps on such nights."""
    found, drifts = [], _drifts(alarms)
    for place, entry in enumerate(entries):
        moved = any(_at_once(a, drifts) and not change(a.get("cause")).of_the_probe for a in alarms.get(entry, ()))
        if (moved or place in begins) and place and abs(float(value[place] - value[place - 1])) > SURE * np.sqrt(2) * std:
            found.append((place, float(value[place] - value[place - 1])))
    return found


def drift_told(alarms: Mapping[int, Sequence[Mapping[str, Any]]], entries: Sequence[int], nights: Sequence[str], name: str) -> Told:
    """{entry: alarms of that night}, entries and dates of a series, parameter ('': any of the machine, for the tool tip) → places
    of the night before its last drift, and of the first night that told it; None for no drift.
    """
    found = None
    for place, entry in enumerate(entries):
        for a in alarms.get(entry, ()):
            begun = str(a.get("since"))
            mine = a.get("parameter") == name if name else not change(a.get("cause")).of_the_probe
            if mine and a.get("rate_per_day") and a.get("steady", True) and begun in nights:
                before = list(nights).index(begun)
                found = found if found is not None and found[0] == before else (before, place)
    return found


def drift_of_tip(
    alarms: Mapping[int, Sequence[Mapping[str, Any]]], entries: Sequence[int], nights: Sequence[str], value: Array, std: float
) -> Told:
    """{entry: alarms of that night}, entries and dates, (n,) error at the tool tip, its standard deviation → places of the drift
    that has made it larger or smaller; None where none has.
    """
    told = drift_told(alarms, entries, nights, "")
    return told if told is not None and abs(float(value[-1] - value[told[0]])) > SURE * np.sqrt(2) * std else None


def _drifted(first: date, days: Array, value: Array, std: Array, told: tuple[int, int], unit: str, t: Texts) -> tuple[str, float]:
    """as `course`, with the places of a drift → its sentence, and its rate a week; of one that has come to rest 0."""
    begin, said = told
    a_day = float((value[said] - value[begin]) / max(days[said] - days[begin], 1e-3))
    end = _rests(days, value, std, said, a_day)
    there = len(value) - 1 if end is None else end
    words = {"first": day(first + timedelta(days=float(days[begin])), t)}
    words["date"] = day(first + timedelta(days=float(days[there])), t)
    if end is not None:
        return t("course.drifted", size=_short(float(value[there] - value[begin]), unit, signed=True), **words), 0.0
    rate = float(np.polyfit(days[begin:] / 7, value[begin:], 1)[0])
    return t(f"course.drift_{'rises' if rate > 0 else 'falls'}", rate=_short(abs(rate), unit), **words), rate


def _rests(days: Array, value: Array, std: Array, said: int, a_day: float) -> int | None:
    """(n,) days, values, standard deviations, first night that told a drift, its rate a day → place of the night since which it has
    not moved, though at its rate that would have been seen; None while it may go on.
    """
    for place in range(said, len(value) - 1):
        due = abs(a_day) * float(days[-1] - days[place])
        if due > SEEN * float(np.hypot(std[place], std[-1])) and abs(float(value[-1] - value[place])) < due / 4:
            return place
    return None


def course(
    first: date,
    days: Array,
    value: Array,
    std: Array,
    jumps: Sequence[Jump],
    limit: float | None,
    unit: str,
    t: Texts,
    drift: Told = None,
) -> str:
    """first day, (n,) days from it, (n,) values, (n,) standard deviations, jumps, limit or None, unit, texts, places of a drift
    that an alarm told → sentence.
    """
    if len(value) < 2:
        return ""
    if drift is not None and drift[0] >= (jumps[-1][0] if jumps else 0):  # the page says of it what its alarm says
        told, rate = _drifted(first, days, value, std, drift, unit, t)
        seen = float(days[-1] - days[drift[0]]) / 7
        return f"{told} {_of_limit(first, days, value, std, (rate, seen), limit, unit, t)}".strip()
    start = jumps[-1][0] if jumps else 0
    weeks = float(days[-1] - days[start]) / 7
    moved = float(value[-1] - value[start])
    few = len(value) - start < LEAST or weeks <= 0
    goes = not few and abs(moved) > SURE * by_chance(value[start:], float(std[start]), float(std[-1]))
    rate = float(np.polyfit(days[start:] / 7, value[start:], 1)[0]) if goes else 0.0
    rate = rate if goes and rate * moved > 0 else 0.0
    begin, lately = pace(days[start:], value[start:], float(np.median(std)))
    of_late = abs(lately) * float(days[-1] - days[start + begin])
    now = 7 * lately if of_late > SURE * by_chance(value[start + begin :], float(std[start + begin]), float(std[-1])) else 0.0
    other = bool(now) and begin > 0 and (rate * now <= 0 or abs(now) > OTHER * abs(rate))
    words = {"first": day(first + timedelta(days=float(days[start + begin if other else 0])), t)}
    words["rate"] = _short(abs(now if other else rate), unit)
    way = _way(now if other else rate, few)
    if way == "steady" and float(np.std(value[start:])) > VARIES * float(np.median(std[start:])):
        way = "varies"  # with a machine that swings with its hall a drift may hide in it
    words |= {
        key: _short(float(end), unit, signed=True) for key, end in (("low", value[start:].min()), ("high", value[start:].max()))
    }
    if jumps:
        jumped = day(first + timedelta(days=float(days[start])), t)
        words |= {"date": jumped, "size": _short(jumps[-1][1], unit, signed=True), "count": str(len(jumps))}
        before = start - 1  # a jump has a night before it
        left = float(value[-1] - value[before])
        gone = (
            way in ("few", "steady", "varies")
            and not other
            and not shows(jumps[-1][1], left, float(np.hypot(std[before], std[-1])))
        )
        words["last"] = day(first + timedelta(days=float(days[-1])), t)
        told = t("course.jumped_back" if gone else "course.jumped_few" if other else f"course.jumped_{way}", **words)
        told = t("course.last_of", text=told, count=len(jumps)) if len(jumps) > 1 else told
        told = f"{told} {t(f'course.{way}', **words)}" if other else told
    else:
        told = t(f"course.{way}", **words)
    seen = float(days[-1] - days[start + begin if other else start]) / 7
    return f"{told} {_of_limit(first, days, value, std, (now or rate, seen), limit, unit, t)}".strip()


def _way(rate: float, few: bool) -> str:
    return "few" if few else "steady" if not rate else "rises" if rate > 0 else "falls"


def _of_limit(
    first: date, days: Array, value: Array, std: Array, paced: tuple[float, float], limit: float | None, unit: str, t: Texts
) -> str:
    """as `course`, with the rate a week and the weeks in which it was seen → where the last value is of its limit, and when that
    changes; nothing without one.
    """
    rate, seen = paced
    if limit is None or limit <= 0:
        return ""
    size, spread = abs(float(value[-1])), 2 * float(std[-1])
    toward = rate * (1.0 if value[-1] >= 0 else -1.0)  # of the size, a week
    where = "beyond" if size - spread > limit else "within" if size + spread <= limit else "close"
    weeks = (limit - size) / toward if toward else -1.0
    words = {"limit": inches(limit) if unit == "in" else f"{limit:g} {unit}"}
    if where != "close" and 0 < weeks < max(seen, RECENT / 7):
        there = first + timedelta(days=round(float(days[-1]) + 7 * weeks))
        return t(f"course.{where}_until", date=day(there, t), **words)
    return t(f"course.{where}", **words)


def _short(number: float, unit: str, signed: bool = False) -> str:
    """number, unit → whole from 10 on, else with one or two decimals, and the unit; of inches as a shop writes them."""
    if unit == "in":
        return inches(number, signed)
    decimals = 0 if abs(number) >= 9.95 else 1 if abs(number) >= 0.95 else 2
    return f"{number:{'+' if signed else ''}.{decimals}f} {unit}".replace("-", "−")
