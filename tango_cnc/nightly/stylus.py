"""A stylus that works loose: its tip goes one way night after night, by less than one night would show.

Between two nights k days apart the tip wanders by less than √(rate k + what neither night knows). What moves farther, across the
spindle, has crept. Along the spindle a warm machine does the same, so that way is no evidence here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any

import numpy as np
from scipy import special

from ..records import Array
from ..report.texts import texts
from ..state import Hypothesis, Named, State
from .alarms import Known, of_cause
from .course import told
from .dates import Since, date_of
from .words import value

SPANS = (3, 5, 7, 10, 14)  # measured nights that it is looked for over
ACROSS = 2  # coordinates of the tip across the spindle
LEAST = 2e-3  # mm: less is no fault of a stylus


def tip_of(k: Known, after: State) -> dict[str, dict[str, float]]:
    """what is known, state after tonight → {X, Y, Z: `value` and `std` of the stylus tip, mm}; {} where no touch shows it."""
    h = _stylus(k)
    if h is None:
        return {}
    at = h.directions.argmax(axis=0)
    return {axis: {"value": float(after.mean[i]), "std": float(after.std[i])} for axis, i in zip(h.axes, at, strict=True)}


def crept(k: Known, records: Sequence[Mapping[str, Any]], after: State, rate: float) -> dict[str, Any] | None:
    """what is known, records newest first, state after tonight, chance of a false alarm a night → the alarm of a stylus that
    creeps, counted from the night that shows it best; None where it may be chance, and where it does little.

    Looks back to the last night that told a movement of the stylus. Of all spans the price is paid (Bonferroni).
    """
    h, now = _stylus(k), tip_of(k, after)
    if h is None or len(now) < ACROSS:
        return None
    at = h.directions.argmax(axis=0)[:ACROSS]
    tip, know = after.mean[at], after.covariance[np.ix_(at, at)]
    best: tuple[float, Mapping[str, Any] | None] = (rate, None)
    measured = _back(records)
    for record in (measured[n - 1] for n in SPANS if n <= len(measured)):
        then, days = list(record["stylus"].values())[:ACROSS], after.day - float(record["state"]["day"])
        moved = tip - np.array([c["value"] for c in then])
        wander = np.asarray(record["state"]["rates"], dtype=float)[at] * days
        spread = know + np.diag(wander + [c["std"] ** 2 for c in then])
        chance = len(SPANS) * float(special.chdtrc(ACROSS, moved @ np.linalg.solve(spread, moved)))
        if chance < best[0] and float(np.linalg.norm(moved)) >= LEAST:
            best = chance, record
    return None if best[1] is None else _alarm(k, h, best[1], after)


def _back(records: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """records newest first → those with a tip, back to the last that told a movement of it."""
    found = []
    for r in records:
        if not r.get("stylus") or not r.get("state"):
            if r.get("parameters"):
                break  # a version that did not keep it
            continue
        found.append(r)
        if told(r, "stylus"):
            break
    return found


def _alarm(k: Known, h: Hypothesis, record: Mapping[str, Any], after: State) -> dict[str, Any]:
    """→ the alarm of a stylus that has crept since a night."""
    at, then = h.directions.argmax(axis=0), list(record["stylus"].values())
    size: Array = after.mean[at] - np.array([c["value"] for c in then])
    std: Array = np.hypot(after.std[at], np.array([c["std"] for c in then]))
    explained = float(np.sum((size / std)[:ACROSS] ** 2))
    since = str(record["night"])
    whole = of_cause(k, Since(since, since), Named(h, size, std, explained, 0.0, 0.0, ()))
    days = max((date.fromisoformat(date_of(after.day)) - date.fromisoformat(since)).days, 1)
    a_day = float(whole["size"]) / days
    text = texts()("changed.drift", moved=whole["text"], rate=value(a_day, h.unit, signed=False))
    return whole | {"text": text, "rate_per_day": a_day, "steady": True}


def _stylus(k: Known) -> Hypothesis | None:
    """→ the directions of the stylus; None where no touch shows them."""
    return next((h for h in k.tried if h.cause == "stylus"), None)
