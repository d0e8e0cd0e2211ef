"""Many nights at once: what a parameter follows beside its own wandering, and what is known of the past today.

    value of a night = level + steps at its alarms + causes + what it wanders + what the night does not know

A cause is the season, the temperature, wear since the last alarm, a drift over all nights, or one that a night has told: from the
night that reported it, to the night on which it came to rest. How fast the parameter wanders is estimated with
and without it (maximum likelihood), so that a machine that wanders is not taken for one that drifts; the price of all tries is
paid (Bonferroni). What a night has by itself is taken out of the state of that night first: the states of two nights share what
both know.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import Any

import numpy as np
from scipy import special

from ..history import History, Stored, Trend
from ..records import Array, InputError
from ..state.filter import restored
from ..state.smooth import Filtered, smoothed
from ..terms import SCALES
from .sensors import TEMPERATURE, celsius_of
from .standing import own_of

NIGHTS = 400  # looked back over
LEAST = 12  # nights that tell anything
YEAR = 365.25  # d
SEASON = 240.0  # d of nights before a season is tried
STIRRED = 0.3  # K, standard deviation of the temperature before it is tried
AFTER = 8  # nights since an alarm before wear is tried
RARE = 0.01  # chance that a history without any cause gets one named, all tries together
TWICE = 3.0  # of the logarithm of the likelihood: what is nearer than that fits nearly as well
ALIKE = "scales"  # the linear scales together
CHOSEN = 2  # numbers of a told drift that the nights have chosen beside its size: its first night and its last
RESTS = 2.0  # of the logarithm of the likelihood, by which a drift that came to rest has to fit better than one that goes on
TELLS = 1e-9  # of the largest singular value of what may explain a series: what is less says nothing new
LOG_RATES = np.linspace(-9.0, 14.0, 24)  # logarithms of rates of wandering that are tried, against `_Series.wander`
FINER = np.linspace(-1.0, 1.0, 9)  # steps of the rates tried around the best of them
FAINT = 0.02  # of the variance: a night that took out less knows nothing by itself


@dataclass(frozen=True)
class Followed:
    """What a parameter follows: its size (a day, a K, or the amplitude of a year) in its unit, how sure, and when."""

    parameter: str
    cause: str  # season, temperature, wear, drift
    size: float
    std: float
    unit: str
    p_value: float
    since: str = ""  # wear: date of the alarm; season: date of the largest value; drift: of the night before it, '' for all nights
    instead: tuple[str, ...] = ()
    until: str = ""  # drift: date of the night on which it came to rest; '' for one that goes on


@dataclass(frozen=True)
class _Tried:
    """A cause: (n, k) what it would do, numbers that were chosen by the nights beside its size, from when to when."""

    cause: str
    columns: Array
    chosen: int = 0
    since: str = ""
    until: str = ""
    wandered: float = 0.0  # standard deviation of its size by what the parameter wanders in this time


@dataclass(frozen=True)
class _Series:
    day: Array  # (n,)
    value: Array  # (n,) of each night by itself
    variance: Array  # (n,)
    steps: Array  # (n, k) 0 before, 1 after each alarm of this parameter

    @property
    def wander(self) -> float:
        """→ variance a day of a parameter that wanders over all nights as far as one of them knows it."""
        return max(float(np.median(self.variance)), 1e-300) / max(float(np.ptp(self.day)), 1.0)

    @cached_property
    def apart(self) -> tuple[Array, Array]:
        """→ (n,) variance of what wanders, against what a night does not know, (n, n) mixtures of nights that have it and are
        independent at every rate of wandering: so that no rate that is tried costs more than a few sums.
        """
        scale = 1 / np.sqrt(self.variance)
        shared = self.wander * np.minimum.outer(self.day - self.day[0], self.day - self.day[0])
        ratio, mixed = np.linalg.eigh(shared * np.outer(scale, scale))
        return np.clip(ratio, 0.0, None), mixed.T * scale


def looked_back(history: History, machine: str) -> tuple[Followed, ...]:
    """history, machine → what its parameters follow, the surest first. Raises InputError for too few nights."""
    records = [r for r in history.records(machine, NIGHTS) if r.get("parameters") and r.get("state")][::-1]
    if len(records) < LEAST:
        raise InputError(f"history: {machine} has {len(records)} measured nights; allowed: {LEAST} or more to look back over")
    names = history.parameters(machine)
    rates = _rates(history, machine, records[-1])
    day = np.array([float(r["state"]["day"]) for r in records])
    warmth = _temperature(records)
    alarms = [day[i] for i, r in enumerate(records) if any(_at_once(a) for a in r["alarms"])]
    found: list[Followed] = []
    together = (ALIKE,) if set(SCALES) <= set(names) else ()
    series = {name: s for name in (*names, *together) if (s := _series(records, day, name, rates)) is not None}
    causes = {
        name: _causes(s.day, _at(s.day, day, warmth), alarms) | _told(s, records, day, name, list(rates))
        for name, s in series.items()
    }
    tries = sum(len(own) for own in causes.values())
    for name, s in series.items():
        unit = next(own["unit"] for r in records if (own := own_of(r["parameters"], name)) is not None)
        found += _explained(name, unit, s, causes[name], RARE / max(tries, 1))
    return tuple(sorted(_one_or_alike(found, series, causes), key=lambda f: f.p_value))


def _one_or_alike(
    found: Sequence[Followed], series: Mapping[str, _Series], causes: Mapping[str, Mapping[str, _Tried]]
) -> list[Followed]:
    """what is followed, nights of each parameter, causes that they can tell → the same; where the linear scales follow a cause
    together and each of them as much, that is one story, and else none of them together.
    """
    whole = [f for f in found if f.parameter == ALIKE]
    kept = [f for f in found if f.parameter != ALIKE]
    for f in whole:
        own = [_size(series[n], causes[n][f.cause].columns) for n in SCALES if n in series and f.cause in causes[n]]
        if len(own) == len(SCALES) and all(abs(size - f.size) < 3 * np.hypot(std, f.std) for size, std in own):
            kept = [f, *(x for x in kept if (x.parameter, x.cause) not in {(n, f.cause) for n in SCALES})]
    return kept


def _size(s: _Series, columns: Array) -> tuple[float, float]:
    """nights of a parameter, (n, 1) what a cause would do → its size and standard deviation; infinite of a cause of several."""
    if columns.shape[1] > 1:
        return np.inf, 0.0
    _, size, spread = _fitted(s, np.column_stack([np.ones(len(s.day)), s.steps, columns]))
    return float(size[-1]), float(np.sqrt(spread[-1, -1]))


def drifting(records: Sequence[Mapping[str, Any]], name: str, rates: Mapping[str, float]) -> float:
    """records oldest first, parameter, {unknown: variance a day} → probability that a parameter which only wanders goes as far one
    way as this one; 1 where these nights tell nothing.
    """
    s = _series(records, np.array([float(r["state"]["day"]) for r in records]), name, rates)
    if s is None:
        return 1.0
    base = np.column_stack([np.ones(len(s.day)), s.steps])
    gain = _likeliest(s, np.column_stack([base, s.day - s.day.mean()]))[0] - _likeliest(s, base)[0]
    return float(special.chdtrc(1, max(2 * gain, 0.0)))


def warmth(history: History, machine: str) -> Trend:
    """history, machine → °C that counted in each night that has one. Raises InputError where none has."""
    found = [(r, c) for r in reversed(history.records(machine)) if (c := celsius_of(r)) is not None]
    if not found:
        raise InputError(f"history: no night of {machine} has a temperature; allowed: nights with sensors.yaml (docs/link.md)")
    start, night = (tuple(str(r[key]) for r, _ in found) for key in ("start_utc", "night"))
    return Trend(machine, TEMPERATURE, "°C", (), start, night, np.array([c for _, c in found]), np.zeros(len(found)))


def smooth(history: History, machine: str, name: str) -> Trend:
    """history, machine, parameter → what is known today of its past nights. Nothing is carried back over an alarm.

    Raises InputError for a parameter that no state has by this name.
    """
    plain = history.trend(machine, name)
    stored = [history.night(entry) for entry in plain.entries[-NIGHTS:]]
    stored = [s for s in stored if s.knowledge is not None and "state" in s.record]
    if not stored:
        raise InputError(f"history: {machine} has no state to smooth; allowed: nights of this version")
    names = stored[-1].knowledge.names  # type: ignore[union-attr]
    own = _raw(name, names)
    if own is None:
        raise InputError(f"history: {name!r} is no unknown of the state; allowed: {', '.join(names[:12])} …")
    stored = [s for s in stored if s.knowledge is not None and s.knowledge.names == names]
    nights = [_filtered(s) for s in stored]
    past = smoothed(nights, np.array(stored[-1].record["state"]["rates"]), [i for i, s in enumerate(stored) if s.night.alarms])
    place = names.index(own)
    return Trend(
        machine,
        name,
        plain.unit,
        tuple(s.night.entry for s in stored),
        tuple(s.night.start_utc for s in stored),
        tuple(s.night.night for s in stored),
        np.array([p.mean[place] for p in past]),
        np.sqrt([p.covariance[place, place] for p in past]),
    )


def _filtered(stored: Stored) -> Filtered:
    known = stored.knowledge
    assert known is not None
    state = restored(known.names, known.values, known.covariance, stored.record["state"])
    return Filtered(state.mean, state.covariance, state.day)


def _raw(label: str, names: Sequence[str]) -> str | None:
    """label of a parameter (EYY1-EXX1) → its unknown in the state (EYY1), or None when the state does not contain it."""
    return next((n for n in (label, re.split(r"[-+]", label)[0]) if n in names), None)


def _rates(history: History, machine: str, last: Mapping[str, Any]) -> dict[str, float]:
    """→ {name of an unknown: variance a day}, as the newest night has them."""
    newest = history.latest_knowledge(machine)
    return {} if newest is None else dict(zip(newest[1].names, last["state"]["rates"], strict=False))


def _temperature(records: Sequence[Mapping[str, Any]]) -> Array | None:
    """records → (n,) °C of each night: that which counted; None where a night has none."""
    values = [celsius_of(r) for r in records]
    return None if None in values else np.array(values)


def _at(some: Array, day: Array, warmth: Array | None) -> Array | None:
    return None if warmth is None else warmth[np.isin(day, some)]


def _series(records: Sequence[Mapping[str, Any]], day: Array, name: str, rates: Mapping[str, float]) -> _Series | None:
    """→ what each night by itself says of a parameter; None for one that too few nights have seen."""
    rate = _rate(name, rates)
    rows: list[tuple[float, float, float]] = []
    stepped: list[float] = []
    before: tuple[float, float, float] | None = None
    for when, record in zip(day, records, strict=True):
        told = own_of(record["parameters"], name)
        if told is None:
            continue
        value, variance = float(told["value"]), float(told["std"]) ** 2
        if any(a["parameter"] == name and _at_once(a) for a in record["alarms"]):
            stepped.append(when)
        if before is None or any(record.get(key) for key in ("alarms", "opened")):  # a state that was opened has forgotten
            rows.append((when, value, variance))
        else:
            ahead = before[2] + rate * max(when - before[0], 0.0)
            gain = 1 - variance / ahead if ahead > 0 else 0.0
            if gain > FAINT:
                rows.append((when, before[1] + (value - before[1]) / gain, variance / gain))
        before = (when, value, variance)
    if len(rows) < LEAST:
        return None
    days, values, variances = (np.array(column) for column in zip(*rows, strict=True))
    return _Series(days, values, variances, np.column_stack([np.zeros((len(days), 0)), *((days >= s) * 1.0 for s in stepped)]))


def _rate(name: str, rates: Mapping[str, float]) -> float:
    """parameter, {unknown: variance a day} → its variance a day."""
    if name == ALIKE:
        return float(np.mean([rates.get(n, 0.0) for n in SCALES]))
    return rates.get(_raw(name, list(rates)) or "", 0.0)


def _at_once(alarm: Mapping[str, Any]) -> bool:
    """alarm → whether one night made it: a step, and no drift."""
    return not alarm.get("rate_per_day") or not alarm.get("steady", True)


def _causes(day: Array, warmth: Array | None, alarms: Sequence[float]) -> dict[str, _Tried]:
    """→ {cause: what it would do}, of those that these nights can tell."""
    found = {"drift": _Tried("drift", (day - day.mean())[:, None])}
    if np.ptp(day) >= SEASON:
        turn = 2 * np.pi * day / YEAR
        found["season"] = _Tried("season", np.column_stack([np.cos(turn), np.sin(turn)]))
    if warmth is not None and float(np.std(warmth)) > STIRRED:
        found["temperature"] = _Tried("temperature", (warmth - warmth.mean())[:, None])
    last = max(alarms, default=None)
    if last is not None and int(np.sum(day > last)) >= AFTER and int(np.sum(day < last)) >= 3:
        found["wear"] = _Tried("wear", np.maximum(day - last, 0.0)[:, None], since=_date(last))
    return found


def _told(s: _Series, records: Sequence[Mapping[str, Any]], day: Array, name: str, unknowns: Sequence[str]) -> dict[str, _Tried]:
    """nights of a parameter, records oldest first, their days, unknowns → {name of a cause: a drift that the nights have told}.

    Where it came to rest is looked for from the night on that told it: the best of all nights since.
    """
    begun: dict[str, float] = {}
    for when, record in zip(day, records, strict=True):
        for a in (*record["alarms"], *([record["trend"]] if record.get("trend") else ())):
            if a["parameter"] == name and not _at_once(a):
                begun.setdefault(str(a["since"]), when)
    dates = {str(r["night"]): when for when, r in zip(day, records, strict=True)}
    base, found = np.column_stack([np.ones(len(s.day)), s.steps]), {}
    for since, said in begun.items():
        if since not in dates:
            continue
        ends = [when for when in s.day if when >= said]
        ways = [np.clip(s.day, dates[since], end)[:, None] - dates[since] for end in ends]
        fits = [_fitted(s, np.column_stack([base, way]))[0] for way in ways]
        if fits:
            best = int(np.argmax(fits))
            until = "" if best == len(fits) - 1 or fits[best] - fits[-1] < RESTS else _night(records, day, ends[best])
            own = ways[best] if until else ways[-1]
            before = next(r for r in records if str(r["night"]) == since)
            wandered = np.sqrt(_rate(name, dict(zip(unknowns, before["state"]["rates"], strict=False))) / float(own.max()))
            found[f"drift since {since}"] = _Tried("drift", own, CHOSEN, since, until, float(wandered))
    return found


def _night(records: Sequence[Mapping[str, Any]], day: Array, when: float) -> str:
    """records, their days, one of these → the date of its night."""
    return str(records[int(np.flatnonzero(day == when)[0])]["night"])


def _explained(name: str, unit: str, s: _Series, causes: Mapping[str, _Tried], rare: float) -> list[Followed]:
    """→ causes that the nights of a parameter need, one after the other."""
    base = np.column_stack([np.ones(len(s.day)), s.steps])
    left, found = dict(causes), []
    now = _fitted(s, base)[0]
    while left:
        tried = {key: _fitted(s, np.column_stack([base, one.columns])) for key, one in left.items()}
        gains = {key: tried[key][0] - now - 0.5 * (left[key].columns.shape[1] - 1 + left[key].chosen) for key in tried}
        best = max(gains, key=lambda key: gains[key])
        one, (_, size, spread) = left[best], tried[best]
        width = one.columns.shape[1]
        p = float(special.chdtrc(width + one.chosen, max(2 * (tried[best][0] - now), 0.0)))
        if p >= rare:
            break
        own, std = size[-width:], np.sqrt(np.diag(spread)[-width:])
        near = [key for key in left if key != best and gains[best] - gains[key] < TWICE]
        amount = float(own[0]) if width == 1 else float(np.hypot(*own))
        since = _largest(own, s.day) if one.cause == "season" else one.since
        also = tuple(dict.fromkeys(left[key].cause for key in near if left[key].cause != one.cause))
        found.append(Followed(name, one.cause, amount, max(float(std.max()), one.wandered), unit, p, since, also, one.until))
        base, now = np.column_stack([base, left.pop(best).columns]), tried[best][0]
        for key in near:  # the sentence of the best cause names those that fit nearly as well; they get no sentence of their own
            left.pop(key, None)
    return found


def _largest(own: Array, day: Array) -> str:
    """(2,) cosine and sine of a year, days of the nights → date of its last largest value."""
    largest = float(np.arctan2(own[1], own[0])) / (2 * np.pi) * YEAR
    return _date(largest + YEAR * np.floor((day[-1] - largest) / YEAR))


def _date(day: float) -> str:
    return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=float(day))).strftime("%Y-%m-%d")


def _likeliest(s: _Series, columns: Array) -> tuple[float, float]:
    """series, (n, k) what may explain it → log likelihood at the best rate of wandering, logarithm of that rate."""
    ratio, mixed = s.apart
    across, long, _ = np.linalg.svd(columns, full_matrices=False)
    apart = mixed @ np.column_stack([across[:, long > TELLS * long[0]], s.value])  # columns that say the same are one

    def at(logs: Array) -> Array:
        variance = 1 + np.exp(logs)[:, None] * ratio
        white = apart / np.sqrt(variance)[:, :, None]
        rows, value = white[:, :, :-1], white[:, :, -1:]
        along = rows.transpose(0, 2, 1)
        rest = (value - rows @ np.linalg.solve(along @ rows, along @ value))[:, :, 0]
        return np.asarray(-0.5 * (np.sum(rest**2, axis=1) + np.sum(np.log(variance * s.variance), axis=1)))

    found, rate, step = at(LOG_RATES), 0.0, 1.0
    tried = LOG_RATES
    for _ in range(2):  # all rates at once, and then those around the best one closer together
        rate = float(tried[int(np.argmax(found))])
        tried = np.clip(rate + step * FINER, LOG_RATES[0], LOG_RATES[-1])
        found, step = at(tried), step * float(FINER[1] - FINER[0])
    best = int(np.argmax(found))
    return float(found[best]), float(tried[best])


def _fitted(s: _Series, columns: Array) -> tuple[float, Array, Array]:
    """series, (n, k) what may explain it → log likelihood at the best rate of wandering, (k,) sizes, (k, k) covariance."""
    found, rate = _likeliest(s, columns)
    ratio, mixed = s.apart
    white = mixed / np.sqrt(1 + np.exp(rate) * ratio)[:, None]
    rows = white @ columns
    spread = np.linalg.pinv(rows.T @ rows, hermitian=True)
    return found, spread @ rows.T @ (white @ s.value), spread
