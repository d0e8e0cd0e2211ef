"""Plans that begin with the plan of a shorter time: a run that is broken off by then is worth what that plan is.

Theory of operation. A plan is designed for a part of the time. What its touches tell is known to the search for what follows, which
chooses further indexations and touches for the time that is left. Then touches are exchanged everywhere, by what the whole plan is
worth and what its parts are (`weighed.py`). Of the plans found so the best is taken that costs the whole plan no more than allowed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ..plan import attempt
from ..records import Indexation
from . import order
from .broken_off import fitted, stands, worth_when_broken_off
from .enough import promised
from .on_the_way import on_the_way, visits_of
from .problem import Chosen, Problem
from .sequence import FRACTIONS
from .timed import broken_off, judged
from .ways import LONG
from .weighed import weighed
from .whole import SHAKES, at_first, whole

MOST = 4  # touches in a row of the facets that come
WITHIN = 1.3  # times the standard uncertainty of a plan of that time is good enough for a part
FAR = 3.0  # times beyond that are as bad as nothing
DEAR = 0.1  # of the uncertainty of the whole plan: it costs more to begin with the plan of less than the longest part


def with_parts(found: Chosen, again: float, loss: float, search: Callable[[Problem], Chosen | None]) -> Chosen:
    """plan, s of one more touch in a row, what the whole plan may lose, a search → a plan whose parts are worth what they can be.

    It says what plans of these parts of the time would reach, as far as there are any.
    """
    problem = found.problem
    first = worth_when_broken_off(found, again, loss)
    if first is found and (problem.criterion.determinant or problem.choice.twice or problem.senses is None):
        return found
    small = dict[float, Chosen]()
    for part in sorted(FRACTIONS, reverse=True):
        if (made := search(problem.in_a_row(1).of_time(part * problem.seconds))) is None:
            break  # less time does not do either
        small[part] = made
    aims = {part: promised(one) for part, one in small.items()}
    best = first
    for other in _others(found, first, again, loss, small, aims):
        if other.value <= found.value * (1 + loss) ** 2 and stands(other, found):
            best = min(best, other, key=lambda one: (_missed(one, aims), one.value))
    return replace(best, designed=aims)


def _others(
    found: Chosen, first: Chosen, again: float, loss: float, small: Mapping[float, Chosen], aims: Mapping[float, float]
) -> list[Chosen]:
    """plan, the same in another order, s of one more in a row, loss, plans of parts and φ of these → other plans of its time."""
    made = []
    for part, one in small.items():
        begun = [found, first] if part == max(aims) else []
        if part == max(aims) or loss > DEAR:
            grew = (grown(one, found.problem, again, kept) for kept in ((False, True) if part < max(aims) else (False,)))
            begun += [other for other in grew if other is not None]
        made += [weighed(other, again, {p: phi for p, phi in aims.items() if p >= part}) for other in begun]
    return made


def _missed(found: Chosen, aims: Mapping[float, float]) -> float:
    """plan, parts of the time with φ of a plan of each → how far its parts are beyond `WITHIN`, ln φ; `FAR` is lost."""
    if not aims:
        return 0.0
    times = np.log(broken_off(found, list(aims)) / np.array(list(aims.values()))) - 2 * np.log(WITHIN)
    return float(np.clip(times, 0.0, 2 * np.log(FAR)).sum())


def grown(small: Chosen, problem: Problem, again: float, kept: bool = False) -> Chosen | None:
    """plan of a shorter time, problem of a longer one, s of one more touch in a row → plan that begins with it, if any.

    `kept`: so does its first indexation once more, in the middle of the run.
    """
    problem = problem.in_a_row(1)
    begin = list(small.cell.strategy.indexations) if kept else visits_of(small)
    cell = replace(small.cell, strategy=replace(small.cell.strategy, indexations=tuple(begin)))
    planned, faults = attempt(cell, "leave-out", problem.ways.looked)
    if faults:
        return None
    more = _further(judged(problem, cell, planned), problem, again)
    times, _ = order.turns(cell, [begin[-1], *more], problem.feed, (), problem.ways.looked)
    times = np.nan_to_num(times, nan=LONG)
    way = order.improved(list(range(1, len(more) + 1)), lambda way: order.length([0, *way], times))
    visits = [*begin, *(more[i - 1] for i in way)]
    last = small.cell.strategy.indexations[-1]
    if problem.repeats and last.position != begin[0].position:  # a short plan does not repeat its first indexation
        last = replace(begin[0], facets=tuple(dict.fromkeys(begin[0].facets))[: problem.repeats])
    end = [last] if problem.repeats else []
    made = fitted(replace(cell, strategy=replace(cell.strategy, indexations=(*visits, *end))), problem, again, len(begin))
    return None if made is None else on_the_way(made, again, len(begin))


def _further(start: Chosen, problem: Problem, again: float) -> list[Indexation]:
    """plan of a shorter time, problem, s of one more touch in a row → what to visit in the time that is left."""
    facets = len({(t.indexation, t.facet) for t in start.plan.touches})
    touch = (start.costs[0] * len(start.rows) - again * (len(start.rows) - facets)) / facets
    visit = start.costs[1]
    seconds = problem.seconds - start.seconds - (visit + problem.repeats * touch if problem.repeats else 0.0)
    known = replace(problem, choice=replace(problem.choice, held=start.information))
    best, relaxed = None, None
    for times in range(1, MOST + 1):
        price = touch + (times - 1) * again
        if seconds < visit + price:
            break
        reached, light, each, relaxed = at_first(known.in_a_row(times), price, visit, seconds, relaxed)
        if best is None or reached < best[0]:
            best = reached, times, light, each, relaxed
    if best is None:
        return []
    _, times, light, each, relaxed = best
    choice = light.choice
    mask = whole(choice.rows, choice.pose, choice.of_pose, light.held, each, seconds, relaxed, SHAKES)
    legs, found = order.Legs(choice.cell, problem.feed, problem.ways.legs), []
    for j in np.unique(choice.pose[mask]).tolist():
        position = dict(choice.cell.strategy.indexations[j].position)
        names = [choice.facet[i] for i in np.flatnonzero(mask & (choice.pose == j))]
        found.append(Indexation(position, tuple(f for f in legs.way(position, names) for _ in range(times))))
    return found
