"""How many minutes would do, where those that somebody allows do not: what a refusal names."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ..records import Array, InputError
from . import choose, least
from .enough import believed
from .problem import Chosen, Problem, lighter
from .relaxed import Costs, Relaxed, relax
from .whole import SHAKES, whole

LONGER, LONGEST = 1.25, 60.0  # steps, and the end, of looking for minutes that would do
FINE, LATER = 0.1, 1.08  # of the minutes: as near are they looked for; times as many where a plan of them does not do
Good = Callable[[Problem, Array], bool]  # of a plan's information (p, p)


def needed(found: Chosen, good: Good, more_than: float = 0.0, longest: float = LONGEST) -> float | None:
    """plan, what is asked of one, minutes that do not do → minutes in which a plan reaches it.

    None: not within the longest. A choice of touches says where to look, for what touches and turns of the plan take. What is named
    has been planned, with its turns as they come: quickly, and where that plan does not do, with its visits exchanged. Where
    neither does, its own touches and turns say where to look on.
    """
    problem, short = found.problem, max(found.problem.seconds / 60, more_than)
    minutes = _look(found, good, short, longest)
    while minutes is not None and minutes <= longest:
        made, short = found, minutes
        with suppress(InputError):
            made = choose.quick(problem.of_time(60 * minutes))
            if exchanging_takes_long(problem):  # the search has touches to spare where a quick plan has not
                enough = good(problem, made.information)
            elif not (enough := good(problem, made.information) and believed(made)):
                made = choose.exchanged(made)
                enough = good(problem, made.information) and believed(made)
            if enough:
                return minutes
        later = math.ceil(2 * minutes * LATER) / 2
        minutes = later if made is found else max(_look(made, good, short, longest) or longest + 1, later)
    return None


def _look(found: Chosen, good: Good, short: float, longest: float) -> float | None:
    """plan, what is asked, minutes that do not do, the longest → minutes that do by a choice of touches; None: none do.

    Longer and longer times are looked at, then those between the last two.
    """
    quick, minutes = Quick(found), None
    often = (0,) if exchanging_takes_long(found.problem) else (0, SHAKES)

    def does(minutes: float) -> bool:
        each = (quick.chosen(60 * minutes, shakes) for shakes in often)  # the second one where the first one does not do
        return any(chosen is not None and good(quick.light, chosen[0]) for chosen in each)

    while (longer := math.ceil(2 * short * LONGER) / 2) <= longest:
        if does(longer):
            minutes = longer
            break
        short = longer
    if minutes is None:
        return None
    while minutes - short > max(0.5, FINE * minutes):
        middle = math.ceil(short + minutes) / 2
        short, minutes = (short, middle) if does(middle) else (middle, minutes)
    return minutes


def exchanging_takes_long(problem: Problem) -> bool:
    """problem → whether it is the worst of many that counts: exchanging visits then takes minutes."""
    return problem.criterion.worst is not None


class Quick:
    """Quick choices of touches in some time, for what touches and turns of a plan take."""

    def __init__(self, found: Chosen) -> None:
        """plan that says what they take."""
        self.found, self.light = found, lighter(found.problem)
        self.touch, self.visit, self.spare = choose.costs_of(found)
        choice = self.light.choice
        self.each = Costs(np.full(len(choice.rows), self.touch), np.full(len(choice.of_pose), self.visit))
        self.least = least.touches(found.problem)
        self.relaxed: Relaxed | None = None

    def chosen(self, seconds: float, shakes: int = 0) -> tuple[Array, list[str]] | None:
        """s, how thoroughly → information (p, p) of a choice of touches, and the facet of each; None where none can do."""
        problem, choice = self.found.problem, self.light.choice
        again = problem.of_time(seconds).repeats - problem.repeats  # a longer run repeats its first indexation
        left = seconds - self.spare - again * self.touch - (self.visit if again and not problem.repeats else 0.0)
        if left < self.visit + 3 * self.touch:  # what every plan needs takes longer
            return None
        if least.most_told(problem, (self.touch, self.visit, self.spare), seconds)[0] < self.least:
            return None
        self.relaxed = relax(choice.rows, choice.of_pose, self.light.held, self.each, left, self.light.criterion, self.relaxed)
        mask = whole(choice.rows, choice.pose, choice.of_pose, self.light.held, self.each, left, self.relaxed, shakes)
        facets = [choice.facet[i] for i in np.flatnonzero(mask)]
        return self.light.held + choice.rows[mask].T @ choice.rows[mask], facets + facets[: problem.repeats + again]
