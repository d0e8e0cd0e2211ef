"""How far what is followed has gone from one night to another: one error of the machine, or the linear scales together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..records import Array
from ..state import State
from ..state.changes import change_of
from ..state.naming import alike_scales
from ..terms import SCALES
from .alarms import Known

ALIKE = "scales"  # cause and parameter of linear scales that change together
AT_ONCE = 0.7  # share of a change that one night makes: no drift, but a step
MOSTLY_ONE, SEVERAL = 0.5, 3  # the same share where more steps than these were made
ONE_STEP, OTHERS = 0.3, 5.0  # share of a change, and times the usual step, from which one night made a part of it by itself
Place = int | tuple[int, ...]  # of what is followed; several of them: their mean


def told(record: Mapping[str, Any], *names: str) -> bool:
    """record, names of parameters (none: any) → whether the night told a change of them: what came before it is another story."""
    changed = told_of(record)
    return bool(changed) if not names else not changed.isdisjoint(names)


def told_of(record: Mapping[str, Any]) -> frozenset[str]:
    """record → parameters of which the night told a change; '' of an alarm that names none."""
    found = (*(record.get("alarms") or ()), *(record.get("repaired") or ()))
    return frozenset(a.get("parameter") or "" for a in found) if found else frozenset()


def followed(k: Known) -> list[Place]:
    """→ what is looked at: every error of the machine, and the linear scales together where each is known by itself."""
    own = [int(i) for i in k.followed.machine]
    single: list[Place] = [*own]
    scales = tuple(i for i in own if k.followed.names[i] in SCALES and name_of(k, i) in SCALES)
    return [*single, scales] if len(scales) == len(SCALES) else single


def name_of(k: Known, i: Place) -> str:
    """→ what an alarm calls it."""
    return ALIKE if isinstance(i, tuple) else k.labels[i]


def places_of(i: Place) -> tuple[int, ...]:
    """→ the unknowns that it is made of."""
    return i if isinstance(i, tuple) else (i,)


def names_of(k: Known, i: Place) -> tuple[str, ...]:
    """→ the parameters on record that it is made of."""
    return tuple(k.labels[j] for j in i) if isinstance(i, tuple) else (k.labels[i],)


def on_record(k: Known, i: Place, record: Mapping[str, Any], after: State) -> tuple[float, float] | None:
    """→ value and standard deviation of a night; of scales together the latter as their common part is known tonight."""
    own = [record["parameters"].get(name) for name in names_of(k, i)]
    if any(p is None for p in own):
        return None
    if not isinstance(i, tuple):
        return float(own[0]["value"]), float(own[0]["std"])
    std = after.std
    share = sum([float(p["std"] / std[j]) for p, j in zip(own, i, strict=True)]) / len(i)
    return sum([float(p["value"]) for p in own]) / len(i), share * now_of(i, after)[1]


def now_of(i: Place, after: State) -> tuple[float, float]:
    """→ value and standard deviation tonight."""
    if not isinstance(i, tuple):
        return float(after.mean[i]), float(after.std[i])
    return after.mean_of(i)


def alone_or_alike(k: Known, i: Place, record: Mapping[str, Any], after: State) -> Place:
    """what has moved since a night → the same, or the scales together where they explain what the scales did better than one."""
    together = next((j for j in followed(k) if isinstance(j, tuple)), None)
    if together is None or (i != together and i not in together):
        return i
    own = [record["parameters"].get(name) for name in names_of(k, together)]
    if any(p is None for p in own):
        return i
    size = after.mean[list(together)] - np.array([p["value"] for p in own])
    share = np.array([p["std"] for p in own]) / after.std[list(together)]
    know = after.covariance[np.ix_(together, together)]
    best = alike_scales(size, know + know * np.outer(share, share))
    return together if best is None else together[best]


def moved_since(k: Known, i: Place, record: Mapping[str, Any], after: State) -> tuple[float, float]:
    """→ how far it has moved since a night that has it on record, and how sure that is."""
    then, now = on_record(k, i, record, after), now_of(i, after)
    assert then is not None
    return now[0] - then[0], float(np.hypot(now[1], then[1]))


def is_steady(values: Sequence[float], size: float) -> bool:
    """values of the nights, how far it has gone → whether it went night after night, and not a large part of it in one."""
    steps = np.abs(np.diff(values))
    largest = float(np.max(steps, initial=0.0))
    several = len(steps) > SEVERAL
    stands_out = several and largest > OTHERS * float(np.median(steps))
    return largest < (ONE_STEP if stands_out else MOSTLY_ONE if several else AT_ONCE) * abs(size)


def largest_step(values: Sequence[float]) -> tuple[int, float]:
    """values of the nights, newest first → place of the night that made the largest step, and that step."""
    steps = -np.diff(values)
    place = int(np.argmax(np.abs(steps)))
    return place, float(steps[place])


def only(k: Known, i: Place, size: float) -> Array:
    """→ (p,) change of the unknowns where nothing else has gone."""
    moved = np.zeros(len(k.followed.names))
    moved[list(i) if isinstance(i, tuple) else i] = size
    return moved


def cause_of(k: Known, i: Place) -> str:
    """→ the cause under which an alarm has it."""
    return ALIKE if isinstance(i, tuple) else change_of(name_of(k, i), k.followed.families[i])
