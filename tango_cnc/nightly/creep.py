"""Steps from night to night that go one way: a sentence of the morning, and never an alarm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..records import Array
from ..state import State
from ..state.naming import SCALES
from .alarms import Known
from .course import (
    ALIKE,
    Place,
    alone_or_alike,
    followed,
    moved_since,
    name_of,
    names_of,
    now_of,
    only,
    places_of,
    told_of,
)
from .drift import LEAST, TOLD, Drift, drift_of, limited
from .lookback import drifting

WINDOWS = (5, 7, 9, 11, 14, 17, 21, 28, 40)  # measured nights over which steps that go one way are looked for
SLOW = 12  # measured nights that the likelihood needs before it distinguishes a slow drift from a wander
ROUNDED = 0.9  # of a limit: what is nearer to it is reckoned exactly
CREEPS = 1e-3  # chance a night of a sentence about steps that go one way by chance


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
    said = [told_of(r) for r in back]
    places = followed(k)
    steps, reach = _courses(k, places, after, back, said)
    far = _far(steps)
    for column, i in enumerate(places):
        windows = [n for n in WINDOWS if n <= reach[column]]
        tried += len(windows)
        if far[: len(windows), column].any():
            chances, farthest = _one_way(steps[: reach[column] - 1, column].copy(), windows)
            own = [(float(c), float(s), i, n) for c, s, n in zip(chances, farthest, windows, strict=True)]
            best = min(best, *own, key=lambda one: one[:2])
    chance, sigmas, i, nights = best
    if (i == -1 or tried * chance > CREEPS) and (slow := _slow(k, back, after, dict(zip(places, reach, strict=True)))) is not None:
        tried, (chance, sigmas, i, nights) = len(places), slow
    if i == -1 or tried * chance > CREEPS:
        return None
    record = back[nights - 2]
    i = alone_or_alike(k, i, record, after)
    size, std = moved_since(k, i, record, after)
    if abs(size) < TOLD * std:
        return None
    found = drift_of(k, i, record, size, std, after, sigmas, tried * chance, back, alarms=False)
    if k.worst(only(k, i, size)) >= LEAST:
        return found
    return found if limits and limited(k, found, after, limits, gone).nights is not None else None


def _slow(
    k: Known, back: Sequence[Mapping[str, Any]], after: State, courses: Mapping[Place, int]
) -> tuple[float, float, Place, int] | None:
    """what is known, measured nights newest first, state after tonight, nights of each parameter → what has gone farthest one way
    against its wander, by maximum likelihood over all nights: chance, standard deviations, parameter, nights. It costs more than
    steps that are counted, so it is asked only of what stands out.
    """
    found = []
    for i, nights in courses.items():
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


def _one_way(steps: Array, windows: Sequence[int]) -> tuple[Array, Array]:
    """(m,) steps a day, newest first, nights of each window → of each: chance that what wanders goes as far one way, and how many
    standard deviations that is.
    """
    inside = np.arange(len(steps)) < np.array(windows)[:, None] - 1
    many = inside.sum(axis=1)
    mean = inside @ steps / many
    spread = np.sqrt(np.sum(inside * (steps - mean[:, None]) ** 2, axis=1) / (many - 1))
    sigmas = np.abs(mean) / np.maximum(spread / np.sqrt(many), 1e-15)
    return 2 * special.stdtr(many - 1, -sigmas), sigmas


def _far(steps: Array) -> NDArray[np.bool_]:
    """(n, m) steps a day of each parameter, newest first → (windows that fit, m) whether they may go one way by more than chance
    does (`CREEPS`): from sums of all parameters at once, with room for how these are rounded. Nearly none does, any night.
    """
    windows = [w for w in WINDOWS if w <= len(steps) + 1]
    many = np.array(windows)[:, None] - 1.0
    last = np.array(windows, dtype=np.int64) - 2
    total, squares = np.cumsum(steps, axis=0)[last], np.cumsum(steps**2, axis=0)[last]
    spread = np.maximum(squares - total**2 / many, 0.0) / (many - 1)
    return np.asarray(~(total**2 / many < (ROUNDED * special.stdtrit(many - 1, CREEPS / 2)) ** 2 * spread))


def _courses(
    k: Known, places: Sequence[Place], after: State, back: Sequence[Mapping[str, Any]], said: Sequence[frozenset[str]]
) -> tuple[Array, list[int]]:
    """what is known, m parameters, state after tonight, measured nights newest first, what each told a change of → (n, m) steps a
    day, newest first; nights of each, back to its last alarm or repair.
    """
    days = [after.day]
    for r in back:
        if not (day := float(r["state"]["day"])) < days[-1]:
            break
        days.append(day)
    single = {j: at for at, j in enumerate(dict.fromkeys(j for i in places for j in places_of(i)))}
    labels = [k.labels[j] for j in single]
    nights = np.empty((len(days), len(single)))
    nights[0] = after.mean[list(single)]
    for row, r in zip(nights[1:], back, strict=False):
        known = [r["parameters"].get(name) for name in labels]
        row[:] = [np.nan if p is None else p["value"] for p in known]
    values = np.empty((len(days), len(places)))
    reach = []
    for column, i in enumerate(places):
        own = [nights[:, single[j]] for j in places_of(i)]
        values[:, column] = sum(own[1:], own[0]) / len(own) if len(own) > 1 else own[0]
        values[0, column] = now_of(i, after)[0]
        gaps = np.flatnonzero(np.isnan(values[1:, column]))
        reach.append(1 + (int(gaps[0]) if len(gaps) else len(days) - 1))
    for night, changed in enumerate(said[: len(days) - 1], 1) if any(said) else ():
        for column, i in enumerate(places if changed else ()):
            names = names_of(k, i)
            ends = {*names, ALIKE} if names[0] in SCALES else {*names}
            if night < reach[column] and not changed.isdisjoint(ends):
                reach[column] = night + 1
    return np.diff(values, axis=0) / np.diff(np.array(days))[:, None], reach
