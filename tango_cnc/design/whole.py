"""Whole touches: from too many to what the time allows, then exchanged until no exchange makes the plan better.

Backward elimination from what the relaxed design visits; a greedy start from nothing gets stuck (Atkinson, Donev and Tobias 2007,
chapter 12). The relaxed design visits many indexations for a fraction of a turn each, which no plan can. So elimination begins with
all of these, and with fewer and fewer that tell most together. What follows is exchanged, and visits are given up for others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from .criterion import value
from .exchange import Draft
from .problem import Problem, lighter
from .relaxed import Costs, Relaxed, Rows, relax
from .worst import worst_first

PROMISING, ENOUGH = 100, 2500  # indexations that are looked at, with as many touches, at least
STARTS = (0.4, 0.3, 0.25, 0.2, 0.15)  # of the visits that there is time for: with how many elimination begins
SUPPORT, SUPPORT_TOUCHES = 60, 300  # indexations that elimination begins with, with as many touches, at least
SHAKES = 40_000  # times that some visits are given up at random, for each candidate less
LEAST_SHAKES, MOST_SHAKES = 6, 200


def at_first(
    problem: Problem, touch: float, visit: float, seconds: float, before: Relaxed | None
) -> tuple[float, Problem, Costs, Relaxed]:
    """problem, s of a touch and a visit, s, relaxed design to begin with → φ of a first plan, lighter problem, costs, relaxed."""
    light = lighter(problem)
    choice = light.choice
    costs = Costs(np.full(len(choice.rows), touch), np.full(len(choice.of_pose), visit))
    relaxed = relax(choice.rows, choice.of_pose, light.held, costs, seconds, light.criterion, before)
    mask = whole(choice.rows, choice.pose, choice.of_pose, light.held, costs, seconds, relaxed, 0)
    return value(light.criterion, light.held + choice.rows[mask].T @ choice.rows[mask]), light, costs, relaxed


def whole(
    rows: Array,
    pose: Rows,
    of_pose: Sequence[Rows],
    held: Array,
    costs: Costs,
    seconds: float,
    relaxed: Relaxed,
    shakes: int = SHAKES,
) -> NDArray[np.bool_]:
    """candidates, costs, s, relaxed design → (n,) mask of the touches to make; without shakes a first one, quickly.

    Indexations that tell least for their time, where the relaxed design is, are left aside.
    """
    if relaxed.ratio is not None:
        best_first = np.argsort(-relaxed.ratio, kind="stable")
        enough = int(np.searchsorted(np.cumsum([len(of_pose[j]) for j in best_first]), ENOUGH)) + 1
        near = np.sort(best_first[: max(PROMISING, enough)])
        some = np.flatnonzero(np.isin(pose, near))
        place = np.full(len(rows), -1)
        place[some] = np.arange(len(some))
        fewer = replace(relaxed, weights=relaxed.weights[some], visits=relaxed.visits[near], ratio=None)
        few = Costs(costs.touch[some], costs.visit[near])
        number = np.searchsorted(near, pose[some])
        found = np.zeros(len(rows), dtype=np.bool_)
        found[some] = whole(rows[some], number, [place[of_pose[j]] for j in near], held, few, seconds, fewer, shakes)
        return found
    many = relaxed.criterion if relaxed.criterion.worst is not None else None
    draft = Draft(rows, pose, of_pose, held, costs, relaxed, np.zeros(len(rows), dtype=np.bool_))
    best: tuple[float, NDArray[np.bool_]] | None = None
    begins = _beginnings(rows, pose, of_pose, held, costs, seconds, relaxed)
    for begin in begins:
        draft.chosen = begin.copy()
        draft.renew()
        draft.eliminate(seconds)
        draft.fill(seconds)
        draft.swap(seconds)
        reached = draft.value if many is None else value(many, draft.information)
        if best is None or reached < best[0]:
            best = reached, draft.chosen.copy()
    assert best is not None
    draft.chosen = best[1]
    draft.renew()
    if shakes:
        draft.revisit(seconds)
        if len(np.unique(draft.pose[draft.chosen])) > 1:
            draft.shake(seconds, max(LEAST_SHAKES, min(MOST_SHAKES, shakes // len(rows))))
    if many is None:
        return draft.chosen
    # What is best by the mean may be far from it by the worst: both ways lead on, from before and after the shakes.
    ways = [worst_first(draft, seconds, many, bool(shakes))]
    if shakes:
        draft.criterion, draft.chosen = relaxed.criterion, best[1].copy()
        draft.renew()
        draft.eliminate(seconds)
        ways.append(worst_first(draft, seconds, many, True))
    return min(ways, key=lambda mask: value(many, held + rows[mask].T @ rows[mask]))


def _beginnings(
    rows: Array, pose: Rows, of_pose: Sequence[Rows], held: Array, costs: Costs, seconds: float, relaxed: Relaxed
) -> list[NDArray[np.bool_]]:
    """→ (n,) masks to eliminate from: every touch at many indexations, and at fewer and fewer that tell most together."""
    chance = np.random.default_rng(1).permutation(len(of_pose))  # between indexations that the relaxed design likes as much
    support = np.lexsort((chance, -relaxed.visits))
    support = support[: max(SUPPORT, int(np.searchsorted(np.cumsum([len(of_pose[j]) for j in support]), SUPPORT_TOUCHES)) + 1)]
    visits = support[relaxed.visits[support] > 0]
    draft = Draft(rows, pose, of_pose, held, costs, relaxed, np.isin(pose, visits))
    found, left = [draft.chosen.copy()], len(visits)
    # With fewer visits all the time that is not spent on turns goes into touches.
    most = float(seconds / (costs.visit[visits].mean() + costs.touch.mean()))
    for share in STARTS:
        while left > max(2, share * most):
            draft.leave(draft.least_visit(np.flatnonzero(draft.chosen))[0])
            left -= 1
        if not (draft.chosen == found[-1]).all():
            found.append(draft.chosen.copy())
    return found
