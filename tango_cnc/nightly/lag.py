"""A state that lags behind a machine: one of its parameters has begun to move faster than it was learned to wander.

A filter that has learned that a parameter hardly moves takes each night for a small part only of what it knows. When the parameter
begins to move, value and interval stay behind, and the touches of one night are no alarm. But what the nights add to a parameter,
divided by the standard deviation that this has on a machine that only wanders, is white (Kailath 1968): over several nights it adds
up to what no chance makes. Then what was learned of the parameter is void: the nights since are followed once more, with it free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from ..records import Array
from ..state import Frame, Seen, State, predicted
from ..state.filter import taken
from .alarms import Known
from .course import moved_since, name_of, on_record, only
from .drift import LEAST, TOLD, Drift, drift_of
from .parts import expected

WINDOWS = (1, 2, 3, 4, 5, 7)  # measured nights that a lag is looked for over
CHANCE = 0.01  # a night, of all that is tried: a state that is opened for nothing has lost some nights of one parameter
BEFORE = 2  # measured nights before the first that shows it: what moves had begun by then
NEARLY = 0.8  # of the surest sum: the longest window that does as well says when it began
AS_BEFORE = 0.8  # of the most that it has moved since any of these nights
FREED = 3.0  # times what the state has followed a day: what it may have moved


class Lag(NamedTuple):
    """A parameter that the state lags behind: its place, from which of the last records on it is followed anew, its freedom."""

    place: int
    back: int  # records newest first: the state after this one is where it begins
    rate: float  # variance a day that it is given


def lagging(followed: Frame, records: Sequence[Mapping[str, Any]], ahead: State, after: State) -> Lag | None:
    """frame, records newest first, state before and after the touches of tonight → what the state lags behind; None: nothing.

    Looks back to the last alarm, repair or opened parameter, and no farther.
    """
    steps, reach = _steps(followed, records, ahead, after)
    sums = {w: np.abs(steps[:w, :, 0].sum(axis=0)) / np.sqrt(w) for w in WINDOWS if w <= min(len(steps), reach + 1)}
    if not sums:
        return None
    least = -float(special.ndtri(CHANCE / 2 / (len(followed.machine) * len(sums))))
    best = max(sums, key=lambda w: float(sums[w].max()))
    worst = int(np.argmax(sums[best]))
    if not float(sums[best][worst]) > least:
        return None
    place = int(followed.machine[worst])
    since = max(w for w in sums if sums[w][worst] > NEARLY * float(sums[best][worst]))
    back = min(since - 1 + BEFORE, reach)
    days = max(after.day - float(records[since - 1]["state"]["day"]), 1.0)
    moved = float(np.abs(steps[:since, worst, 1].sum()))
    return Lag(place, back, max(float(followed.wander[place]), (FREED * moved / days) ** 2))


def _steps(followed: Frame, records: Sequence[Mapping[str, Any]], ahead: State, after: State) -> tuple[Array, int]:
    """→ (n, m, 2) what each night added to each parameter, newest first, in standard deviations of a quiet machine and as it is;
    the place of the oldest record with a state to begin with, -1 for none.
    """
    names = [followed.selection.label(followed.names[i]) for i in followed.machine]
    tonight = [(float(after.mean[i] - ahead.mean[i]), expected(float(ahead.std[i]), float(after.std[i]))) for i in followed.machine]
    rows, reach = [tonight], -1
    for number, record in enumerate(records[: WINDOWS[-1] + BEFORE]):
        if not record.get("parameters") or not record.get("state"):
            break
        reach = number  # the state after it is one to begin with, also where it was opened for what an alarm found
        if any(record.get(key) for key in ("alarms", "ignored", "repaired", "opened")):
            break
        if len(rows) == WINDOWS[-1]:
            continue
        told = [record["parameters"].get(name) for name in names]
        if any(one is None or one.get("change_std") is None for one in told):
            break
        rows.append([(float(one["change"]), float(one["change_std"])) for one in told if one is not None])
    steps = np.array(rows)
    size, std = steps[..., 0], steps[..., 1]
    white = np.where(std > 0, size / np.where(std > 0, std, 1.0), 0.0)
    return np.stack([white, size], axis=-1), reach


def followed_anew(begin: State, lag: Lag, nights: Sequence[tuple[float, Seen]], after: State) -> State:
    """state where it begins, what lags, (day, what was seen) of the nights since, oldest first, state after tonight → what is
    known when these nights are followed with the parameter free. It stays free until rates are learned again; all other rates and
    the scatter of a touch are those of the state after tonight.
    """
    rates = after.rates.copy()
    rates[lag.place] = max(float(rates[lag.place]), lag.rate)
    state = replace(begin, rates=rates, sigma=after.sigma, noise=after.noise, reference=after.reference)
    for day, what in nights:
        state = taken(predicted(state, day), what)
    return replace(after, mean=state.mean, root=state.root, rates=rates)


def sentence(k: Known, lag: Lag | None, records: Sequence[Mapping[str, Any]], after: State) -> Drift | None:
    """what is known, what lags (None: nothing tonight), records newest first, state after tonight → how far it has moved since
    before it began, for a night that is no alarm; on the nights after that, as long as it stays there. None where that is not
    sure, or too little for a part.
    """
    if lag is None:
        begun = _begun(k, records)
        place, back = begun or (0, [])
    else:
        place, back = lag.place, list(records[: lag.back + 1])
    back = [r for r in back if on_record(k, place, r, after) is not None]
    moves = [moved_since(k, place, r, after) for r in back]
    most = max((abs(size) for size, _ in moves), default=0.0)
    number = next((j for j, (size, _) in enumerate(moves) if abs(size) >= AS_BEFORE * most), None)  # the last night as before
    if number is None or abs(moves[number][0]) < TOLD * moves[number][1]:
        return None
    size, std = moves[number]
    found = drift_of(k, place, back[number], size, std, after, abs(size) / std, CHANCE, records, alarms=False)
    return found if max(found.on_part_um, k.worst(only(k, place, size))) >= LEAST else None


def _begun(k: Known, records: Sequence[Mapping[str, Any]]) -> tuple[int, list[Mapping[str, Any]]] | None:
    """what is known, records newest first → parameter of the sentence that a night of the last week began, and the record since
    which it has moved; None where no night began one, or where an alarm or a repair came
    after it.
    """
    measured = [r for r in records if r.get("parameters") and r.get("state")]
    for record in measured[: WINDOWS[-1]]:
        if record.get("alarms") or record.get("repaired"):
            return None
        trend = record.get("trend") or {}
        if trend.get("parameter") in (record.get("opened") or ()):
            place = next((int(i) for i in k.followed.machine if name_of(k, int(i)) == trend["parameter"]), None)
            since = next((r for r in measured if r["night"] == trend["since"]), None)
            return None if place is None or since is None else (place, [since])
    return None
