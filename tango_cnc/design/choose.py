"""Machine, artefact and goal → the plan that tells most in the time there is, and how near it is to the best that any plan could.

Costs of a touch and of a turn come from the motion model: a first choice is planned and timed, and what its touches and turns
take is what the next choice is made with, until the time is met.
"""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..duration import proof
from ..records import InputError
from . import least, order
from .balls import needed
from .broken_off import LOSS, worth_when_broken_off
from .criterion import parts
from .early import in_vain
from .enough import believed, serves
from .exchange import Draft
from .here import certified_here, most_in_a_row
from .in_a_row import shared
from .nested import with_parts
from .on_the_way import on_the_way
from .problem import Chosen, Problem, lighter
from .proving import proving
from .relaxed import THOROUGH, Costs, Relaxed, efficiency, relax
from .senses import senses_of
from .sequence import sequence
from .spare import used_up
from .visits import NoWay, passable, provable
from .ways import Ways
from .whole import SHAKES, at_first, whole
from .worst import FEWER, sharpened

MOST = 4  # touches in a row at each facet: each further one tells as much and takes a third of the time
SHARE = 0.75  # of the time that goes into touches at most
ENOUGH = 0.8  # facets for each unknown; with fewer, touching them again is not looked at
CLOSE = 0.015  # of the time
TRIMS = 12
WORSE = 4  # plans in a row that are no better than the best so far
PART = 0.8  # of the time left over that is used at once
FIRST = 3  # times that a first plan is looked for where all of one had no safe way
OFTEN = 3  # times that a check is searched again: of its three or four turns each plan has others, and the search ends elsewhere
LONG = 36_000.0  # s, longer than any plan
TRIED = 3  # indexations of a plan that says what a touch takes
SHARP = 3.0  # power of each variance by which the worst of many counts more
Mask = NDArray[np.bool_]


class NoTime(InputError):
    """The time does not do for any plan."""


class TooShort(NoTime):
    """The same, where a plan was found: even the shortest one takes longer."""

    def __init__(self, found: Chosen) -> None:
        super().__init__(f"--minutes: found {found.problem.seconds / 60:.3g}; allow more time: even the shortest plan takes longer")
        self.found = found


class TooFew(NoTime):
    """There is time for fewer touches than the goal has unknowns."""

    def __init__(self, found: Chosen, touches: int, unknowns: int) -> None:
        self.found = found
        half = (30.0 * n for n in itertools.count(math.ceil(found.problem.seconds / 30)))
        self.seconds = next(s for s in half if s > LONG or least.most_told(found.problem, costs_of(found), s)[0] >= unknowns)
        self.why = f"there is time for about {touches} touches, and the goal has {unknowns} unknowns besides those of the facets"
        super().__init__(f"--minutes: found {found.problem.seconds / 60:.3g}; {self.why}; allow more time")


class Undetermined(NoTime):
    """Neither a first plan determines what it is for, nor a quick choice of a little more time."""

    def __init__(self, found: Chosen) -> None:
        super().__init__(f"--minutes: found {found.problem.seconds / 60:.3g}; allow more time: no plan determines the goal")
        self.found = found


def chosen(problem: Problem, early: bool = False, loss: float = LOSS) -> Chosen:
    """problem, whether to give up early, what the whole may lose for parts → plan. Raises InputError when time is too short."""
    problem = replace(problem, senses=senses_of(problem.choice)) if problem.senses is None else problem
    again = order.again(problem.choice.cell, problem.feed)
    made, relaxed = _searched(problem, again, early)
    if early and not serves(problem, made.information):  # before parts of it are looked for
        raise Undetermined(made)
    made = with_parts(made, again, loss, partial(_of_part, again=again)) if early else worth_when_broken_off(made, again, 0.0)
    return certified(made, _lifted(made.problem, relaxed))


def _of_part(problem: Problem, again: float) -> Chosen | None:
    """problem of a part of the time, s of one more touch in a row → its plan; None where none is worth making."""
    told = replace(problem, say=lambda text: problem.say(f"for a run that is broken off, {text}"))
    with suppress(NoTime, NoWay):
        found = _searched(told, again, True)[0]
        return found if serves(problem, found.information) and believed(found) else None
    return None


def _searched(problem: Problem, again: float, early: bool) -> tuple[Chosen, Relaxed]:
    """problem, s of one more touch in a row, whether to give up early what seems in vain → plan, relaxed design."""
    # The first choice, a quick one, says what touches and turns cost.
    _hopeless(problem)
    what = f"a plan of {problem.seconds / 60:.1f} min"
    problem.say(f"{what}: a first one")
    first, relaxed = _first(problem)
    costs = costs_of(first)
    if early and not serves(problem, first.information) and in_vain(problem, costs, relaxed):
        raise Undetermined(first)
    rows, relaxed = _in_a_row(problem, costs, again, relaxed)
    best = first, relaxed
    problem.say(f"{what}: touches and indexations that say most")
    with suppress(NoWay):
        found, last = _tried(rows, (costs[0] + (rows.times - 1) * again, *costs[1:]), SHAKES, relaxed)
        best = min((on_the_way(found, again), last), best, key=lambda each: each[0].value)
        with suppress(NoTime):  # the turns of that plan say what turns cost
            problem.say(f"{what}: the same by what its moves take")
            for _ in range(OFTEN if problem.choice.twice else 1):
                found, last = _tried(rows, costs_of(found), SHAKES, last)
                best = min(best, (on_the_way(found, again), last), key=lambda each: each[0].value)
        if rows.times > 1 and best[0] is first:  # too few facets were left to determine everything
            found, last = _tried(problem, costs, SHAKES, None)
            best = min((on_the_way(found, again), last), best, key=lambda each: each[0].value)
    made, relaxed = best
    problem.say(f"{what}: the order of its touches")
    made = on_the_way(made, again) if made is first else made
    return used_up(shared(made, again), again), relaxed


def quick(problem: Problem) -> Chosen:
    """problem → a plan made quickly, as `chosen` begins with. Raises InputError when the time is too short for any."""
    return _first(replace(problem, senses=senses_of(problem.choice)) if problem.senses is None else problem)[0]


def exchanged(found: Chosen) -> Chosen:
    """quick plan → one of its time whose visits are exchanged, for what its touches and turns take. Raises InputError for none."""
    return _tried(found.problem, costs_of(found), SHAKES, None)[0]


def _first(problem: Problem) -> tuple[Chosen, Relaxed]:
    """problem → a first plan, made quickly, and the relaxed design. Raises NoWay where no safe way was found to anything.

    The minutes that a refusal names are those of such a plan; a search of these minutes begins with it.
    """
    key = (id(problem.choice), id(problem.criterion), problem.seconds, problem.times, problem.repeats)
    if key not in problem.quickly:  # with what the key numbers: else something later could have the number of what is gone
        problem.quickly[key] = (*_made_first(problem), problem.choice, problem.criterion)
    return problem.quickly[key][:2]


def _made_first(problem: Problem) -> tuple[Chosen, Relaxed]:
    for _ in range(FIRST):
        with suppress(NoWay):  # what has no way is left out the next time
            return _tried(problem, (_first_costs(problem), 12.0, 0.0), 0, None)
    return _tried(problem, (_first_costs(problem), 12.0, 0.0), 0, None)


def _tried(problem: Problem, costs: tuple[float, float, float], shakes: int, relaxed: Relaxed | None) -> tuple[Chosen, Relaxed]:
    """problem, s of a facet, of a visit and of all else, how thoroughly, where to begin → plan, relaxed design."""
    touch, visit, spare = costs
    light, seconds = lighter(problem), problem.seconds - spare
    choice = light.choice
    _enough(problem, seconds, touch, visit)
    each = Costs(np.full(len(choice.rows), touch), np.full(len(choice.of_pose), visit))
    relaxed = relax(choice.rows, choice.of_pose, light.held, each, seconds, light.criterion, relaxed)
    mask = whole(choice.rows, choice.pose, choice.of_pose, light.held, each, seconds, relaxed, shakes)
    found, last = [], None
    for sides in (True, False) if shakes else (False,):
        try:
            found.append(_fitted(problem, mask, relaxed, None, sides))
        except TooShort as error:
            last = error
    if not found and last is not None:
        raise last
    return min(found, key=lambda each: each.value), relaxed


def costs_of(found: Chosen) -> tuple[float, float, float]:
    """plan → s of a facet, of a visit, and of all else: the gate, and the first indexation once more."""
    touch, visit = found.costs
    indexations = found.cell.strategy.indexations
    visits = len({tuple(sorted(i.position.items())) for i in indexations})
    again = indexations[-1].facets if len(indexations) > visits else ()
    facets = (len(found.time) - len(again)) / found.problem.times
    return touch, visit, found.seconds - touch * facets - visit * visits


def _hopeless(problem: Problem) -> None:
    """problem → nothing. Raises TooFew where it is plain, before anything is searched, that no plan determines what it is for.

    What a touch takes is seen in a plan of few indexations with many facets, where ways are short.
    """
    choice, unknowns = problem.choice, least.touches(problem)
    if not unknowns:
        return
    fullest = np.argsort([-len(own) for own in choice.of_pose], kind="stable")[:TRIED]
    mask = np.isin(choice.pose, fullest)
    own = replace(
        problem, ways=Ways(looked=problem.ways.looked, legs=problem.ways.legs)
    )  # three that have no way to each other may have one to others
    try:
        trial, _ = passable(own, mask, sorted(fullest.tolist()), order.Legs(choice.cell, problem.feed, problem.ways.legs))
    except NoWay:
        return
    most, touches = least.most_told(problem, costs_of(trial), problem.seconds)
    if most < unknowns:
        raise TooFew(trial, round(touches / least.SPARE), unknowns)


def _lifted(problem: Problem, relaxed: Relaxed) -> Relaxed:
    """problem, relaxed design of what is lighter to work with → the same with the criterion of the problem."""
    if relaxed.many is None:
        return relaxed
    return replace(relaxed, criterion=problem.criterion.with_weights(relaxed.many))


def _in_a_row(
    problem: Problem, costs: tuple[float, float, float], again: float, relaxed: Relaxed | None
) -> tuple[Problem, Relaxed]:
    """problem, its costs, s of the same touch once more, where to begin → the problem with the best number of touches in a row."""
    single, visit, spare = costs
    seconds, unknowns = problem.seconds - spare, len(lighter(problem).held)
    best: tuple[float, Problem, Relaxed] | None = None
    for times in range(1, MOST + 1):
        touch = single + (times - 1) * again
        if times == 1:
            _enough(problem, seconds, touch, visit)
        elif seconds < visit + 3 * touch or (not problem.choice.twice and SHARE * seconds / touch < ENOUGH * unknowns):
            break
        tried = problem.in_a_row(times)
        reached, _, _, relaxed = at_first(tried, touch, visit, seconds, relaxed)
        if best is None or reached < best[0]:
            best = reached, tried, relaxed
    assert best is not None
    return best[1], best[2]


def _enough(problem: Problem, seconds: float, touch: float, visit: float) -> None:
    if seconds < visit + 3 * touch:
        raise NoTime(
            f"--minutes: found {problem.seconds / 60:.3g}; an indexation takes {visit:.0f} s and each touch {touch:.1f} s; "
            "allow more time"
        )


def certified(found: Chosen, relaxed: Relaxed) -> Chosen:
    """plan, relaxed design from which to go on → the plan with the bound for what its own touches and turns take.

    It holds for every plan that touches a facet no more often in a row. Such a visit is a mixture of visits that touch all of their
    facets as often as that: of those touched once at least, twice at least, and so on.
    """
    most = most_in_a_row(found)
    problem = found.problem.in_a_row(most)
    choice, touch = problem.choice, found.costs[0] / found.problem.times * most
    costs = Costs(np.full(len(choice.rows), touch), np.full(len(choice.of_pose), found.costs[1]))
    seconds = max(problem.seconds, found.seconds) - proof(found.plan, problem.gate, problem.feed)
    bound = relax(choice.rows, choice.of_pose, problem.held, costs, seconds, problem.criterion, relaxed, THOROUGH).bound
    made = replace(found, bound=bound, efficiency=efficiency(problem.criterion, found.value, bound, len(problem.held)))
    return replace(made, here=certified_here(made))


def _first_costs(problem: Problem) -> float:
    approach = problem.choice.cell.strategy.approach
    return approach.standoff / (approach.feed / 60) + 2.0


def _fitted(problem: Problem, mask: Mask, relaxed: Relaxed, visited: list[int] | None = None, sides: bool = False) -> Chosen:
    """chosen touches, order of visits if it is known → the plan of these, with fewer or more until it fits into the time.

    `sides`: whether the order of the visits takes longer where axes then come from sides that tell more.
    """
    more = needed(problem, mask) | proving(problem, mask)
    mask = (mask | more) & ~problem.barred
    choice = problem.choice
    legs = order.Legs(choice.cell, problem.feed, problem.ways.legs)
    best: Chosen | None = None
    worse = 0
    for _ in range(TRIMS):
        visits = np.unique(choice.pose[mask]).tolist()
        if visited is None or set(visited) != set(visits):
            visited = sequence(problem, mask, visits, sides)
        visited = provable(problem, mask, visited)  # also where they are given: other facets may be touched there now
        found, visited = passable(problem, mask, visited, legs)
        mask = mask & ~problem.barred
        over = found.seconds - problem.seconds
        worse += 1
        if over <= 0 and (best is None or found.value < best.value):
            best, worse = found, 0
        if best is not None and (worse >= WORSE or -CLOSE * problem.seconds <= over <= 0):
            break
        own = Costs(np.full(len(choice.rows), found.costs[0]), np.full(len(choice.of_pose), found.costs[1]))
        changed = _changed(lighter(problem.ordered(visited)), mask, own, relaxed, over, more & ~problem.barred)
        more |= needed(problem, changed) | proving(problem, changed)
        changed = (changed | more) & ~problem.barred
        if changed.sum() < 2 or (changed == mask).all():
            break
        mask = changed
    if best is None:
        raise TooShort(found)
    return best


def _changed(light: Problem, mask: Mask, costs: Costs, relaxed: Relaxed, over: float, stay: Mask) -> Mask:
    """problem, chosen touches, costs, s too long, touches that stay → touches that take as much less, or more."""
    choice, many = light.choice, light.criterion
    if many.worst is not None:
        weights = parts(many, light.held + choice.rows[mask].T @ choice.rows[mask]) ** SHARP
        relaxed = replace(relaxed, criterion=many.with_weights(weights / weights.sum()))
    draft = Draft(choice.rows, choice.pose, choice.of_pose, light.held, costs, relaxed, mask)
    draft.needed = stay
    aim = draft.seconds - over * (1.0 if over > 0 else PART)
    if over > 0:
        draft.eliminate(aim)
    else:
        draft.fill(aim)
    if many.worst is None:
        draft.swap(aim)
    elif len(light.held) <= FEWER:
        sharpened(draft, aim, many)
    return draft.chosen
