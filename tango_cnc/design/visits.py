"""Chosen touches and the order of their indexations → the plan of them, timed; without those to which no safe way leads.

Axes may not be free to turn above the last facet of an indexation though they are above another one. So that facet is touched last,
and that one first at the next indexation, between which the turn was found to be possible. Where that does not do, another order is
looked for; and what still has no way is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..plan import attempt
from ..records import Id, Indexation, InputError, Plan, Strategy
from . import order
from .problem import Chosen, Problem
from .proving import beginnings
from .sequence import sequence
from .timed import judged
from .ways import NOWHERE, reason

ROUNDS = 6  # plans until everything that is still in the way is left out
Mask = NDArray[np.bool_]
Turning = tuple[int, int]


class NoWay(InputError):
    """No safe way leads to any indexation."""


def passable(problem: Problem, mask: Mask, visited: Sequence[int], legs: order.Legs) -> tuple[Chosen, list[int]]:
    """chosen touches, order of visits → the plan of those that have a safe way, timed; its visits. What is left out is noted.

    Raises NoWay when none is left.
    """
    visited, same = list(visited), set[Turning]()
    known = problem.ways
    for count in range(ROUNDS + len(visited)):
        mask = mask & ~problem.barred
        visited = [j for j in visited if mask[problem.choice.pose == j].any()]
        if not visited:
            raise NoWay(f"design: no safe way leads to any indexation: {next(iter(known.visits.values()), 'see check')}")
        strategy = _strategy(problem, mask, visited, legs, same)
        cell = replace(problem.choice.cell, strategy=strategy)
        made, faults = attempt(cell, "leave-out", known.looked)
        if not faults:
            return judged(problem, cell, made), visited
        turns, touches = _where(made, faults, visited)
        known.touches |= touches
        if turns.keys() - same and count < ROUNDS:
            same |= turns.keys()
            continue
        known.turns |= turns
        if count >= ROUNDS:
            known.visits |= {other if other != NOWHERE else one: why for (one, other), why in turns.items()}
            known.visits |= {j: why for (j, _), why in touches.items()}
        elif turns:
            mask = mask & ~problem.barred
            visited = sequence(problem, mask, [j for j in visited if mask[problem.choice.pose == j].any()])
    raise AssertionError(visited)


def _where(made: Plan, faults: dict[int, str], visited: Sequence[int]) -> tuple[dict[Turning, str], dict[tuple[int, Id], str]]:
    """plan, its faults, its visits → those of turns from one indexation to another, and of touches; reasons."""
    turns, touches = dict[Turning, str](), dict[tuple[int, Id], str]()
    number = {touch.number: n for n, touch in enumerate(made.touches)}
    again = [*visited, visited[0]]  # the first one comes once more
    for touch, why in faults.items():
        n = number.get(touch)
        if n is None:
            turns[again[made.touches[-1].indexation], NOWHERE] = reason(why)
            continue
        here, before = made.touches[n], made.touches[n - 1] if n else None
        if before is None or before.indexation != here.indexation:
            turns[again[before.indexation] if before else NOWHERE, again[here.indexation]] = reason(why)
        else:
            touches[again[here.indexation], here.facet] = reason(why)
    return turns, touches


def _strategy(problem: Problem, mask: Mask, visited: Sequence[int], legs: order.Legs, same: set[Turning]) -> Strategy:
    """chosen touches, order of visits → strategy; `same`: turns between the facets between which `sequence` has looked at them."""
    choice = problem.choice
    ends, begins = {one for one, _ in same}, {other for _, other in same}
    indexations = []
    for j in visited:
        position = dict(choice.cell.strategy.indexations[j].position)
        facets = [choice.facet[i] for i in np.flatnonzero(mask & (choice.pose == j))]
        way = legs.way(position, facets)
        if j in begins and len(way) > 1:
            way = [facets[0], *(f for f in way if f != facets[0])]
        if j in ends:
            way = [*(f for f in way if f != facets[0]), facets[0]]
        indexations.append(Indexation(position, tuple(way)))
    if problem.repeats and len(indexations) > 1:
        indexations.append(again_at_the_end(problem, mask, visited[0], indexations[0]))
    indexations = [replace(i, facets=tuple(f for f in i.facets for _ in range(problem.times))) for i in indexations]
    return Strategy("design", choice.cell.strategy.approach, tuple(indexations))


def provable(problem: Problem, mask: Mask, visited: list[int]) -> list[int]:
    """chosen touches, order of visits → the same, beginning where the probe is best proven."""
    for one in beginnings(problem.choice, problem.gate):
        where = np.unique(problem.choice.pose[mask & one])
        if (first := next((j for j in visited if j in where), None)) is not None:
            return [first, *(other for other in visited if other != first)]
    return visited


def again_at_the_end(problem: Problem, mask: Mask, first: int, indexation: Indexation) -> Indexation:
    """→ the first indexation once more: of its touches those that tell most of where the table is now."""
    choice = problem.choice
    own = np.flatnonzero(mask & (choice.pose == first))
    artefact = choice.cell.artefact.facets
    normal = np.array([artefact[choice.facet[i]].normal for i in own])
    point = np.array([artefact[choice.facet[i]].point for i in own])
    where = np.hstack([normal, np.cross(point, normal) / 100])
    taken: list[int] = []
    information = 1e-3 * np.eye(6)
    for _ in range(min(problem.repeats, len(own))):
        worth = np.einsum("ij,jk,ik->i", where, np.linalg.inv(information), where)
        worth[taken] = -1
        taken.append(int(np.argmax(worth)))
        information = information + np.outer(where[taken[-1]], where[taken[-1]])
    keep = {choice.facet[own[i]] for i in taken}
    return replace(indexation, facets=tuple(f for f in indexation.facets if f in keep))
