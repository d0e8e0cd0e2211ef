"""How often each facet of a plan is touched in a row: not all as often, but those more often that tell more.

A facet that is touched once more costs a second, another facet two or three. The search for facets and indexations takes all as
often touched; here touches in a row go from one facet to another, and facets that tell least are given up for them, as long as
that makes the plan better. Seconds are those of the plan; what is really saved the planner says, and `spare.used_up` spends it.
"""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..plan import plan
from ..records import Array, Id, InputError
from .criterion import Criterion, State, parts, value
from .problem import Chosen
from .spare import norm, state_of, with_each
from .timed import judged

MOST = 6  # touches in a row of one facet
POWER = 16.0  # of the norm that stands for the worst of many: a single move rarely makes the worst of all better at once
ROUNDS = 40  # moves at most
LEAST = 12  # touches of which is tried to give them up, those that tell least
GAIN = 2e-3  # of φ: a move that gains less is not made
MARGIN = (0.0, 0.01)  # of the time that is kept back, for ways that get longer when a facet is given up
Key = tuple[int, Id]  # indexation, facet


def shared(found: Chosen, again: float) -> Chosen:
    """plan, s of one more touch of the facet that has just been touched → a plan that is no worse, in the time there is."""
    problem = found.problem
    if again <= 0:
        return found
    for margin in MARGIN:
        counts = _counts(found, again, problem.seconds * (1 - margin) - found.seconds)
        if counts == _touched(found):
            return found
        with suppress(InputError):  # no safe way, or nothing left that proves the probe
            made = _made(found, counts)
            if made.seconds <= problem.seconds:
                return min(made, found, key=lambda each: each.value)
    return found


def _touched(found: Chosen) -> Counter[Key]:
    return Counter((touch.indexation, touch.facet) for touch in found.plan.touches)


def _made(found: Chosen, counts: Counter[Key]) -> Chosen:
    """plan, how often each facet is to be touched at each indexation → the plan of that, with the facets in the order of before."""
    indexations = []
    for number, indexation in enumerate(found.cell.strategy.indexations):
        facets = dict.fromkeys(indexation.facets)
        indexations.append(replace(indexation, facets=tuple(f for f in facets for _ in range(counts[number, f]))))
    cell = replace(found.cell, strategy=replace(found.cell.strategy, indexations=tuple(indexations)))
    return judged(found.problem, cell, plan(cell, "leave-out"))


def _counts(found: Chosen, again: float, spare: float) -> Counter[Key]:
    """plan, s of one more touch in a row, s left over → how often each facet is to be touched at each indexation."""
    problem, counts = found.problem, _touched(found)
    criterion, information = problem.criterion, found.information
    now = smooth(criterion, information)
    place = {(touch.indexation, touch.facet): n for n, touch in enumerate(found.plan.touches)}
    keys = list(counts)
    rows, number = found.rows[[place[key] for key in keys]], np.array([counts[key] for key in keys])
    spent = found.costs[0] / problem.times * len(found.rows)
    facet = max((spent - again * (len(found.rows) - len(keys))) / len(keys), again)  # s of a facet with its way
    kept = np.array([stays(found, key) for key in keys])
    at = np.array([key[0] for key in keys])
    for _ in range(ROUNDS):
        last = np.bincount(at[number > 0], minlength=at.max() + 1)[at] < 2  # an indexation keeps a facet
        few = np.flatnonzero((number > 1) | ((number == 1) & ~kept & ~last))
        state = state_of(criterion, information)
        left = without_each(criterion, state, now, rows[few], POWER)
        best: tuple[float, int, list[int]] | None = None
        for k in np.argsort(left, kind="stable")[:LEAST].tolist():
            i, fewer = int(few[k]), State(state.criterion, state.covariance, state.gain)
            fewer.change(rows[i], -1)
            seconds = spare + (again if number[i] > 1 else facet)
            open_to = (number > 0) & (np.arange(len(keys)) != i)
            room = np.where(open_to, MOST - number, 0)
            reached, added = _filled(criterion, fewer, float(left[k]), rows, room, int(seconds / again + 1e-9))
            if best is None or reached < best[0]:
                best = reached, i, added
        if best is None or best[0] > now - GAIN * (len(information) if criterion.determinant else now):
            break
        now, out, added = best
        spare += (again if number[out] > 1 else facet) - again * len(added)
        for row, sign in ((out, -1), *((k, 1) for k in added)):
            number[row] += sign
            information = information + sign * np.outer(rows[row], rows[row])
    return Counter({key: int(n) for key, n in zip(keys, number, strict=True) if n})


def smooth(criterion: Criterion, information: Array) -> float:
    """→ φ; of the worst of many, the norm of all of them."""
    if criterion.worst is None:
        return value(criterion, information)
    return float(norm(parts(criterion, information)[:, None], POWER)[0])


def stays(found: Chosen, key: Key) -> bool:
    """→ whether a facet is not given up: it may prove the probe, or show drift, or its ball needs it."""
    number, facet = key
    ends = number == 0 or (number == len(found.cell.strategy.indexations) - 1 and found.problem.repeats > 0)
    return ends or found.cell.artefact.facets[facet].ball is not None


def _filled(criterion: Criterion, state: State, now: float, rows: Array, room: Array, count: int) -> tuple[float, list[int]]:
    """criterion, state, its φ, (n, p) touches, how many of each may come, how many in all → φ with the best of these, and which."""
    added: list[int] = []
    for _ in range(count):
        worth = np.where(room > 0, with_each(criterion, state, now, rows, POWER), np.inf)
        best = int(np.argmin(worth))
        if not np.isfinite(worth[best]):
            break
        now = float(worth[best])
        added.append(best)
        room[best] -= 1
        state.change(rows[best], 1)
    return now, added


def without_each(criterion: Criterion, state: State, now: float, rows: Array, power: float = np.inf) -> Array:
    """criterion, state, its φ, (n, p) touches that are in → (n,) φ without each of them; `power`: as of `with_each`."""
    if criterion.worst is None:
        return np.asarray(now + state.loss(*state.seen(rows)))
    aims = criterion.worst @ state.covariance
    variance = np.einsum("kp,kp->k", aims, criterion.worst)
    left = np.maximum(1 - np.einsum("np,np->n", rows @ state.covariance, rows), 1e-12)
    return norm(variance[:, None] + (aims @ rows.T) ** 2 / left, power)
