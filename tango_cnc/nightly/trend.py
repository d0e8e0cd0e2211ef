"""What no single night shows: a parameter that goes one way night after night.

A parameter wanders; how fast is known (`State.rates`). Between two nights k days apart it moves by less than
√(rate k + what neither night knows). What moves farther has drifted. Every parameter is tried over every span of the last week
and over some of the last four: a wander grows with the root of time, so a drift as slow as it shows in weeks only. The price of
so many tries is paid (Bonferroni), so that the share of false alarms that drifts have is kept. The rate itself is known from so
many nights only: what moves by it has the tails of Student's t with as many degrees of freedom, and what both nights do not know
has a normal tail; together by Welch and Satterthwaite (GUM, G.4.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy import special

from ..records import Array
from ..report.tonight import is_gone, is_unseen
from ..state import State
from ..texts import joined, say
from .alarms import Known
from .course import (
    Place,
    alone_or_alike,
    followed,
    moved_since,
    name_of,
    names_of,
    now_of,
    on_record,
    only,
    places_of,
    told,
)
from .creep import creeping
from .drift import LEAST, TOLD, Drift, drift_of, first_limit, limited
from .sway import swayed
from .words import one_day, pace_of, what_of

SPANS = (2, 3, 4, 5, 6, 7, 10, 14, 20, 28)  # measured nights that a drift is looked for over
SLOPE = 21  # nights that a rate comes from
UNLEARNED = 1000.0  # degrees of freedom of a first idea of a rate: it is not learned, but on the safe side of what machines do
PAUSE = 3  # measured nights: a drift that comes back within them is the same one
STILL = 4  # measured nights after which a drift can be said to stand
LATELY = 14  # measured nights that give the rate of a drift whose alarm stands
# Standard deviations of two nights from which a change is a sentence while nobody knows yet how far the machine wanders.
PLAIN = 6.0


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
    found = swayed(k, records, after) if found is None else found
    return None if found is None else limited(k, found, after, limits, gone)


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
    return drift_of(k, place, begun, size, std, after, d.sigmas, d.p_value, records, d.alarms)


def looking_ahead(
    k: Known,
    alarm: dict[str, Any],
    records: Sequence[Mapping[str, Any]],
    after: State,
    limits: Sequence[Mapping[str, Any]],
    gone: Array | None = None,
) -> dict[str, Any]:
    """what is known, alarm of another night, records newest first, state after tonight, limits, what the control takes away → the
    same; of a drift that still goes on with `ahead`: when it reaches which limit, from where it is tonight, at its rate of late;
    of one that has come to rest with `stands`: since which night; of one that has hardly moved of late with `slowed`.
    """
    place = next((i for i in followed(k) if name_of(k, i) == alarm["parameter"]), None)
    rate = alarm["rate_per_day"] if alarm.get("steady", True) else None
    since = [r for r in records if r.get("parameters") and r.get("state") and r["night"] >= str(alarm["since"])][:LATELY]
    if place is None or not rate or not since or on_record(k, place, since[-1], after) is None:
        return alarm
    if (still := _still(k, place, float(rate), since, after)) and not (is_gone(alarm["now"]) or is_unseen(alarm["now"])):
        text = say("night.words.stands", since=still)
        return alarm | {"now": joined("; ", (alarm["now"], text)), "stands": still}
    if _slowed(k, place, float(rate), since, after):  # that it goes on so is not what these nights show
        return alarm | {"slowed": True}
    size, std = moved_since(k, place, since[-1], after)
    days = after.day - float(since[-1]["state"]["day"])
    if (
        size * rate <= 0
        or abs(size) < 2 * std
        or days <= 0
        or (first := first_limit(k, place, size / days, after, limits, gone)) is None
    ):
        return alarm
    unit = k.followed.units[places_of(place)[0]]
    words = {
        "rate": pace_of(size / days, unit, alarm.get("alike_by") or {}),
        "what": what_of(first[1]),
        "nights": f"{first[0]:.0f}",
    }
    text = say(f"night.words.ahead{one_day(first[0])}", **words)
    told = {"what": first[1], "days": first[0], "rate_per_day": size / days, "text": text}
    return alarm | {"ahead": told}


def _still(k: Known, place: Place, rate: float, since: Sequence[Mapping[str, Any]], after: State) -> str:
    """what is known, parameter of a drift, its rate a day, records since then, newest first, state after tonight → the night since
    which it has not moved though at its rate that would have been seen; '' while it may go on.
    """
    found = ""
    for record in since[STILL - 1 :]:
        if on_record(k, place, record, after) is None:
            break
        size, std = moved_since(k, place, record, after)
        due = abs(rate) * (after.day - float(record["state"]["day"]))
        if abs(size) < min(max(std, due / 8), due / 4) and due > TOLD * std:
            found = str(record["night"])
    return found


def _slowed(k: Known, place: Place, rate: float, since: Sequence[Mapping[str, Any]], after: State) -> bool:
    """as `_still` → whether over the last nights that can tell it the parameter has gone less than half of what its rate makes."""
    for record in since:
        if on_record(k, place, record, after) is None:
            return False
        size, std = moved_since(k, place, record, after)
        due = rate * (after.day - float(record["state"]["day"]))
        if abs(due) > TOLD * std:
            return size * np.sign(due) < abs(due) / 2
    return False


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
    places = followed(k)
    single = np.array([i for i in places if not isinstance(i, tuple)], dtype=np.int64)
    labels, here, sure = [k.labels[i] for i in single], after.mean[single], after.std[single]
    found: list[tuple[Place, Mapping[str, Any]]] = []
    told_of: list[Array] = []
    for record in [back[span - 1] for span in SPANS if span <= len(back)]:
        days = max(after.day - float(record["state"]["day"]), 0.0)
        rates = np.array(record["state"]["rates"], dtype=float)
        rates = rates if len(rates) == len(k.followed.names) else k.followed.wander
        nights = float(record["state"].get("learned") or 0) or UNLEARNED
        own = [record["parameters"].get(name) for name in labels]
        known = [at for at, p in enumerate(own) if p is not None]
        values, stds = (np.array([own[at][key] for at in known], dtype=float) for key in ("value", "std"))
        found += [(places[at], record) for at in known]
        wandered = rates[single[known]] * days
        told_of.append(np.array([here[known] - values, sure[known] ** 2 + stds**2, wandered, np.full(len(known), nights)]))
        for together in places[len(single) :]:  # the scales
            if (then := on_record(k, together, record, after)) is not None:
                them = list(places_of(together))
                now, rate = now_of(together, after), float(np.sum(rates[them])) / len(them) ** 2
                found.append((together, record))
                told_of.append(np.array([[now[0] - then[0]], [now[1] ** 2 + then[1] ** 2], [rate * days], [nights]]))
    if not found:
        return None
    sizes, knowns, wandered, learned = np.concatenate(told_of, axis=1)
    far = np.abs(sizes) / np.sqrt((knowns + wandered) * max(scale, 1.0))
    chances = by_chance(far, knowns, wandered, learned)
    best = int(np.argmin(chances))
    if far[best] < TOLD:
        return None
    (i, record), size, std = found[best], float(sizes[best]), float(np.sqrt(knowns[best]))
    chance, sigmas, tried = float(chances[best]), float(far[best]), len(found)
    if (other := alone_or_alike(k, i, record, after)) != i:
        i, size, std = other, *moved_since(k, other, record, after)
    if k.worst(only(k, i, size)) < LEAST:
        return None
    return drift_of(k, i, record, size, std, after, sigmas, min(1.0, tried * chance), records)


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
    return drift_of(k, i, last, size, std, after, sigmas, chance, records, alarms=False)


def by_chance(sigmas: Array | float, known: Array | float, wandered: Array | float, nights: Array | float) -> Array:
    """(n,) standard deviations, variance of what two nights do not know and of a wander whose rate is known from so many nights →
    probability that chance moves a parameter as far, either way."""
    freedom = nights * ((known + wandered) / np.maximum(np.maximum(wandered, 1e-3 * known), 1e-30)) ** 2
    return np.asarray(2 * special.stdtr(freedom, -np.asarray(sigmas)))


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
    # What wanders looks like a slope: only one far beyond its own scatter is reported.
    plain = (np.abs(slope) > 6 * spread) & (np.abs(slope) * np.ptp(day) > 4 * std)
    return {n: float(slope[i]) for i, n in enumerate(names) if plain[i]}
