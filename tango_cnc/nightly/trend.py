"""What no single night shows: a parameter that goes one way night after night, and which one stands behind a crossed limit.

A parameter wanders; how fast is known (`State.rates`). Between two nights k days apart it moves by less than
√(rate k + what neither night knows). What moves farther has drifted. Every parameter is tried over every span of the last week
and over some of the last four: a wander grows with the root of time, so a drift as slow as it shows in weeks only. The price of
so many tries is paid (Bonferroni), so that the share of false alarms that drifts have is kept. The rate itself is known from so
many nights only: what moves by it has the tails of Student's t with as many degrees of freedom, and what both nights do not know
has a normal tail; together by Welch and Satterthwaite (GUM, G.4.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import special

from ..records import Array
from ..report.texts import texts
from ..state import State
from ..state.naming import SCALES
from ..texts import say
from .alarms import Known, effect_of, others
from .control import reached
from .course import (
    ALIKE,
    Place,
    alone_or_alike,
    cause_of,
    followed,
    is_steady,
    moved_since,
    name_of,
    names_of,
    now_of,
    on_record,
    only,
    places_of,
    told,
)
from .lookback import drifting
from .words import changed, value, what_of

MONTH = 30  # nights that what stands behind a limit is looked for over
SPANS = (2, 3, 4, 5, 6, 7, 10, 14, 20, 28)  # measured nights that a drift is looked for over
LEAST = 2.0  # µm at the worst pose of the volume: a smaller drift is for the trend, not for the morning
SLOPE = 21  # nights that a rate is told from
UNLEARNED = 1000.0  # degrees of freedom of a first idea of a rate: it is not learned, but on the safe side of what machines do
TOLD = 3.5  # standard deviations from which a drift is a sentence, though no alarm yet
WINDOWS = (5, 7, 9, 11, 14, 17, 21, 28, 40)  # measured nights over which steps that go one way are looked for
PAUSE = 3  # measured nights: a drift that comes back within them is the same one
LATELY = 14  # measured nights that give the rate of a drift whose alarm stands
YEAR = 365.0  # d: what reaches a limit later than that is for the table
# Standard deviations of two nights from which a change is a sentence while nobody knows yet how far the machine wanders.
PLAIN = 6.0
SLOW = 12  # measured nights that the likelihood needs before it distinguishes a slow drift from a wander
CREEPS = 1e-3  # chance a night of a sentence about steps that go one way by chance


@dataclass(frozen=True)
class Drift:
    """A parameter that has moved since a night: by how much (its unit), how sure, how fast, what it does."""

    parameter: str
    since: str
    size: float
    std: float
    unit: str
    rate_per_day: float
    sigmas: float
    p_value: float  # of all that was tried
    on_part_um: float
    on_part: str
    do: str
    steady: bool  # night after night; false: most of it in one night
    alarms: bool = True  # where it is sure enough; false: a sentence, however sure
    limit: str = ""  # what reaches its limit if it goes on so
    nights: float | None = None  # in how many days that is

    @property
    def text(self) -> str:
        """→ a sentence without its full stop."""
        size = value(self.size, self.unit, self.std)
        if self.parameter == ALIKE:
            moved = texts()("changed.scales", size=size, since=self.since)
        else:
            moved = changed(self.parameter, size, self.since)
        if not self.steady:
            return moved
        moved = texts()("changed.drift", moved=moved, rate=value(self.rate_per_day, self.unit))
        if self.nights is None:
            return moved
        return texts()("changed.reaches", moved=moved, what=what_of(self.limit), nights=f"{max(self.nights, 1.0):.0f}")


def drift(
    k: Known,
    records: Sequence[Mapping[str, Any]],
    after: State,
    scale: float,
    limits: Sequence[Mapping[str, Any]] = (),
    gone: Array | None = None,
) -> Drift | None:
    """what is known, records newest first, state after tonight, scale of quiet nights' statistic, limits of tonight, (p,) what the
    control takes away from parts → the surest drift, or else what creeps, or else what has plainly moved on a machine that is
    hardly known; a steady one with the limit that it reaches.
    """
    found = _beyond(k, records, after, scale) or creeping(k, records, after, limits, gone)
    found = _young(k, records, after) if found is None else _as_begun(k, found, records, after)
    return None if found is None else _limited(k, found, after, limits, gone)


def _as_begun(k: Known, d: Drift, records: Sequence[Mapping[str, Any]], after: State) -> Drift:
    """what is known, a drift, records newest first, state after tonight → the same, counted from where the night counted it that
    said it first, as long as it goes on: how sure it is, is tonight's.
    """
    place = next(i for i in followed(k) if name_of(k, i) == d.parameter)
    measured = [r for r in records if r.get("parameters") and r.get("state")]
    begun = None
    for record in measured[:PAUSE]:
        if told(record, *names_of(k, place), d.parameter):
            break
        before = record.get("trend") or {}
        if before.get("parameter") == d.parameter and before["size"] * d.size > 0:
            begun = next((r for r in measured if r["night"] == before["since"]), None)
            break
    if begun is None or begun["night"] == d.since or on_record(k, place, begun, after) is None:
        return d
    size, std = moved_since(k, place, begun, after)
    if size * d.size <= 0 or abs(size) < TOLD * std:
        return d
    return _drift(k, place, begun, size, std, after, d.sigmas, d.p_value, records, d.alarms)


def looking_ahead(
    k: Known,
    alarm: dict[str, Any],
    records: Sequence[Mapping[str, Any]],
    after: State,
    limits: Sequence[Mapping[str, Any]],
    gone: Array | None = None,
) -> dict[str, Any]:
    """what is known, alarm of another night, records newest first, state after tonight, limits, what the control takes away → the
    same; of a drift that still goes on with `ahead`: when it reaches which limit, from where it is tonight, at its rate of late.
    """
    place = next((i for i in followed(k) if name_of(k, i) == alarm["parameter"]), None)
    rate = alarm["rate_per_day"] if alarm.get("steady", True) else None
    since = [r for r in records if r.get("parameters") and r.get("state") and r["night"] >= str(alarm["since"])][:LATELY]
    if place is None or not rate or not since or on_record(k, place, since[-1], after) is None:
        return alarm
    size, std = moved_since(k, place, since[-1], after)
    days = after.day - float(since[-1]["state"]["day"])
    if (
        size * rate <= 0
        or abs(size) < 2 * std
        or days <= 0
        or (first := _first(k, place, size / days, after, limits, gone)) is None
    ):
        return alarm
    unit = k.followed.units[places_of(place)[0]]
    words = {"rate": value(size / days, unit), "what": what_of(first[1]), "nights": f"{max(first[0], 1.0):.0f}"}
    told = {"what": first[1], "days": first[0], "rate_per_day": size / days, "text": say("night.words.ahead", **words)}
    return alarm | {"ahead": told}


def _limited(k: Known, d: Drift, after: State, limits: Sequence[Mapping[str, Any]], gone: Array | None) -> Drift:
    """→ the same, with the limit that it reaches first and when; as it is where it reaches none within a year."""
    if not limits or not d.steady:
        return d
    place = next((i for i in followed(k) if name_of(k, i) == d.parameter), None)
    if place is None:
        return d
    first = _first(k, place, d.rate_per_day, after, limits, gone)
    return d if first is None else replace(d, nights=first[0], limit=first[1])


def _first(
    k: Known, i: Place, rate: float, after: State, limits: Sequence[Mapping[str, Any]], gone: Array | None
) -> tuple[float, str] | None:
    """what is known, a parameter, its rate a day, state after tonight, limits, what the control takes away → in how many days it
    reaches the first limit, and which; None where it reaches none within a year.
    """
    a_day, mean = only(k, i, rate), after.mean if gone is None else after.mean - gone
    found = ((reached(k.followed, k.lever, mean, a_day, x), str(x["what"])) for x in limits)
    return min(((float(days), what) for days, what in found if days < YEAR), default=None)


def _beyond(k: Known, records: Sequence[Mapping[str, Any]], after: State, scale: float) -> Drift | None:
    """→ the surest of what has moved farther than it wanders.

    Looks back to the last alarm or repair and no farther, as that alarm has said what came before it. None where nothing has
    moved by `TOLD` and `LEAST`.
    """
    back = []
    for record in records:
        if record.get("parameters") and record.get("state"):
            back.append(record)
        if told(record) or len(back) == SPANS[-1]:
            break
    best: tuple[float, float, Place, Mapping[str, Any], float, float] | None = None
    tried = 0
    for record in [back[span - 1] for span in SPANS if span <= len(back)]:
        days = after.day - float(record["state"]["day"])
        rates = np.array(record["state"]["rates"], dtype=float)
        rates = rates if len(rates) == len(k.followed.names) else k.followed.wander
        nights = float(record["state"].get("learned") or 0) or UNLEARNED
        for i in followed(k):
            then = on_record(k, i, record, after)
            if then is None:
                continue
            tried += 1
            now, sure = now_of(i, after)
            size, known = now - then[0], sure**2 + then[1] ** 2
            rate = float(np.sum(rates[list(i)])) / len(i) ** 2 if isinstance(i, tuple) else float(rates[i])
            wandered = rate * max(days, 0.0)
            sigmas = abs(size) / float(np.sqrt((known + wandered) * max(scale, 1.0)))
            chance = by_chance(sigmas, known, wandered, nights)
            if best is None or chance < best[0]:
                best = (chance, sigmas, i, record, size, float(np.sqrt(known)))
    if best is None or best[1] < TOLD:
        return None
    chance, sigmas, i, record, size, std = best
    if (other := alone_or_alike(k, i, record, after)) != i:
        i, size, std = other, *moved_since(k, other, record, after)
    if k.worst(only(k, i, size)) < LEAST:
        return None
    return _drift(k, i, record, size, std, after, sigmas, min(1.0, tried * chance), records)


def creeping(
    k: Known,
    records: Sequence[Mapping[str, Any]],
    after: State,
    limits: Sequence[Mapping[str, Any]] = (),
    gone: Array | None = None,
) -> Drift | None:
    """what is known, records newest first, state after tonight, limits, what the control takes away → the parameter that goes one
    way night after night, surest first.

    What wanders goes as often one way as the other, however fast it is thought to wander: Student's t of the steps a day, all
    parameters and windows paid for. Looks back to the last alarm about that parameter. None where it may be chance, and where it
    does less than `LEAST` and comes to no limit within a year.
    """
    tried = 0
    best: tuple[float, float, Place, int] = (CREEPS, 0.0, -1, 0)
    back = [r for r in records if r.get("parameters") and r.get("state")][: WINDOWS[-1] - 1]
    for i in followed(k):
        day, values = _course(k, i, after, back)
        for nights in (n for n in WINDOWS if n <= len(day)):
            steps = np.diff(values[:nights]) / np.diff(day[:nights])
            sigmas = abs(steps.mean()) / max(float(steps.std(ddof=1)) / np.sqrt(len(steps)), 1e-15)
            tried += 1
            chance = 2 * float(special.stdtr(len(steps) - 1, -sigmas))
            if (chance, sigmas) < best[:2]:
                best = (chance, float(sigmas), i, nights)
    chance, sigmas, i, nights = best
    if (i == -1 or tried * chance > CREEPS) and (slow := _slow(k, back, after)) is not None:
        tried, (chance, sigmas, i, nights) = len(followed(k)), slow
    if i == -1 or tried * chance > CREEPS:
        return None
    record = back[nights - 2]
    i = alone_or_alike(k, i, record, after)
    size, std = moved_since(k, i, record, after)
    if abs(size) < TOLD * std:
        return None
    found = _drift(k, i, record, size, std, after, sigmas, tried * chance, back, alarms=False)
    if k.worst(only(k, i, size)) >= LEAST:
        return found
    return found if limits and _limited(k, found, after, limits, gone).nights is not None else None


def _slow(k: Known, back: Sequence[Mapping[str, Any]], after: State) -> tuple[float, float, Place, int] | None:
    """what is known, measured nights newest first, state after tonight → what has gone farthest one way against its wander, by
    maximum likelihood over all nights: chance, standard deviations, parameter, nights. It costs more than steps that are counted,
    so it is asked only of what stands out.
    """
    found = []
    for i in followed(k):
        nights = len(_course(k, i, after, back)[0])
        if nights < SLOW:
            continue
        size, std = moved_since(k, i, back[nights - 2], after)
        if abs(size) < TOLD * std:
            continue
        own = {
            n: {"value": v[0], "std": v[1]} for n, j in zip(names_of(k, i), places_of(i), strict=True) if (v := now_of(j, after))
        }
        tonight = {"parameters": own, "state": {"day": after.day}, "alarms": []}
        rates = dict(zip(k.followed.names, after.rates, strict=False))
        found.append((drifting([*back[: nights - 1][::-1], tonight], name_of(k, i), rates), abs(size) / std, i, nights))
    return min(found, key=lambda one: one[:2], default=None)


def _young(k: Known, records: Sequence[Mapping[str, Any]], after: State) -> Drift | None:
    """→ what has moved most since last night, where the rates are a first idea and it moved by far more than touches scatter.

    Within that first idea it is no alarm. That nothing has changed would still be false. The state follows such a step by a part
    only, so half of `LEAST` is enough.
    """
    last = next((r for r in records if r.get("parameters") and r.get("state")), None)
    if last is None or last["state"].get("learned"):
        return None
    found = []
    for i in k.followed.machine:
        if (then := last["parameters"].get(k.followed.selection.label(k.followed.names[i]))) is not None:
            size, std = float(after.mean[i]) - then["value"], float(np.hypot(after.std[i], then["std"]))
            found.append((abs(size) / std, int(i), size, std))
    plain = [one for one in found if one[0] >= PLAIN and k.worst(only(k, one[1], one[2])) >= LEAST / 2]
    if not plain:
        return None
    sigmas, i, size, std = max(plain)
    chance = min(1.0, 2 * len(found) * float(special.ndtr(-sigmas)))
    return _drift(k, i, last, size, std, after, sigmas, chance, records, alarms=False)


def _course(k: Known, i: Place, after: State, back: Sequence[Mapping[str, Any]]) -> tuple[Array, Array]:
    """what is known, a parameter, state after tonight, measured nights newest first → (m,) days, (m,) values, back to its last
    alarm or repair.
    """
    days, values, names = [after.day], [now_of(i, after)[0]], names_of(k, i)
    for r in back:
        if any(name not in r["parameters"] for name in names) or not r["state"]["day"] < days[-1]:
            break
        days.append(float(r["state"]["day"]))
        values.append(float(np.mean([r["parameters"][name]["value"] for name in names])))
        if told(r, *names, *((ALIKE,) if names[0] in SCALES else ())):
            break
    return np.array(days), np.array(values)


def by_chance(sigmas: float, known: float, wandered: float, nights: float) -> float:
    """standard deviations, variance of what two nights do not know and of a wander whose rate is known from so many nights →
    probability that chance moves a parameter as far, either way."""
    freedom = nights * ((known + wandered) / max(wandered, 1e-3 * known, 1e-30)) ** 2
    return 2 * float(special.stdtr(freedom, -sigmas))


def _drift(
    k: Known,
    i: Place,
    record: Mapping[str, Any],
    size: float,
    std: float,
    after: State,
    sigmas: float,
    p_value: float,
    records: Sequence[Mapping[str, Any]],
    alarms: bool = True,
) -> Drift:
    name, one = name_of(k, i), i[0] if isinstance(i, tuple) else i
    unit, cause = k.followed.units[one], cause_of(k, i)
    effect, on_part, do = effect_of(k, cause, name, size, unit, only(k, i, size), record["night"])
    begun = float(record["state"]["day"])
    between = [r for r in records if r.get("state") and r.get("parameters") and r["state"]["day"] >= begun]
    known = [[r["parameters"].get(n, {}).get("value") for n in names_of(k, i)] for r in between]
    steady = is_steady([now_of(i, after)[0], *(float(np.mean(row)) for row in known if None not in row)], size)
    do = texts()("night.drift_do", name=name) if steady and name != ALIKE else do
    rate = size / max(after.day - begun, 1e-3)
    return Drift(name, record["night"], size, std, unit, rate, sigmas, p_value, effect, on_part, do, steady, alarms)


def as_alarm(found: Drift, k: Known) -> dict[str, Any]:
    """drift → the alarm of the record."""
    place = next(i for i in followed(k) if name_of(k, i) == found.parameter)
    return {
        **{"id": "", "since": found.since, "rate_per_day": found.rate_per_day, "steady": found.steady},
        "instead": others(k, found.parameter),
        **{"cause": cause_of(k, place)},
        **{"parameter": found.parameter, "text": found.text, "size": found.size, "std": found.std, "unit": found.unit},
        **{"sigmas": found.sigmas, "on_part_um": found.on_part_um, "on_part": found.on_part, "do": found.do},
    }


def behind(
    k: Known, records: Sequence[Mapping[str, Any]], after: State, limit: Mapping[str, Any], gone: Array | None = None
) -> dict[str, Any] | None:
    """what is known, records newest first, state after tonight, limit that is crossed → the parameter that stands behind it.

    `gone`: (p,) what the control takes away from parts, so that it does not stand behind anything.

    Against the first of the last `MONTH` nights that kept the limit: what has moved most since, by what it does to the volume, and
    the last night on which it had not. Where no night kept it, the parameter that does most, and no date.
    """
    known = [r for r in records[:MONTH] if r.get("parameters") and r.get("state")]
    kept = [r for r in known if any(x["what"] == limit["what"] and x["passed"] is not False for x in r.get("limits") or ())]
    share: list[tuple[float, int, float, float]] = []
    for i in k.followed.machine:
        name = k.followed.selection.label(k.followed.names[i])
        then = kept[-1]["parameters"].get(name) if kept else {"value": 0.0 if gone is None else float(gone[i]), "std": 0.0}
        if limit["what"] not in ("volume", name) or then is None:
            continue
        size, std = float(after.mean[i]) - then["value"], float(np.hypot(after.std[i], then["std"]))
        if abs(size) > 3 * std:
            share.append((k.worst(only(k, int(i), size)), int(i), size, std))
    if not share:
        return None
    worst, i, size, std = max(share)
    name, unit = k.followed.selection.label(k.followed.names[i]), k.followed.units[i]
    told = {"what": limit["what"], "parameter": name, "unit": unit}
    if not kept:
        _, on_part, _ = effect_of(k, cause_of(k, i), name, size, unit, only(k, i, size))
        text = texts()("changed.most", name=name, size=value(size, unit, std), share=f"{worst:.1f} µm")
        return (
            told
            | {"text": text, "since": "", "rate_per_day": None, "size": size, "std": std, "on_part": on_part}
            | {"do": texts()("night.most_do")}
        )
    begun = kept[-1]["parameters"][name]
    still = [
        r for r in known if name in r["parameters"] and abs(r["parameters"][name]["value"] - begun["value"]) < 3 * begun["std"]
    ]
    found = _drift(k, i, still[0], float(after.mean[i]) - still[0]["parameters"][name]["value"], std, after, 0.0, 0.0, known)
    later = [r for r in known if r["night"] > found.since][:-1]  # after the night that found it
    again = [r["night"] for r in later if r.get("kind") == "full" and r["parameters"].get(name, {}).get("seen")]
    return told | {
        **{"cause": cause_of(k, i), "confirmed": again[-1] if again else None},
        **{
            "text": found.text,
            "since": found.since,
            "rate_per_day": found.rate_per_day if found.steady else None,
            "size": found.size,
            "std": found.std,
        },
        **{"on_part": found.on_part, "do": found.do},
    }


def slopes(records: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """records newest first → {parameter: its slope a day over the last nights}, where that is larger than chance."""
    records = [r for r in records[:SLOPE] if r.get("parameters") and r.get("state")]
    recent = []
    for r in records:  # newest first, as far as the last change
        recent.append(r)
        if told(r):
            break
    if len(recent) < 5:
        return {}
    day = np.array([r["state"]["day"] for r in recent])
    names = [n for n in recent[0]["parameters"] if all(n in r["parameters"] for r in recent)]
    values = np.array([[r["parameters"][n]["value"] for n in names] for r in recent]).reshape(len(recent), -1)
    std = np.array([recent[0]["parameters"][n]["std"] for n in names])
    centred = day - day.mean()
    slope = centred @ values / (centred @ centred)
    rest = values - values.mean(axis=0) - np.outer(centred, slope)
    spread = np.sqrt(np.sum(rest**2, axis=0) / max(len(rest) - 2, 1) / (centred @ centred))
    # What wanders looks like a slope: only one that is far beyond its own scatter is told.
    plain = (np.abs(slope) > 6 * spread) & (np.abs(slope) * np.ptp(day) > 4 * std)
    return {n: float(slope[i]) for i, n in enumerate(names) if plain[i]}
