"""How many minutes would do, where those that somebody allows do not: what a refusal names."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ..records import Array, InputError
from . import choose
from .problem import Chosen, Problem, lighter
from .relaxed import Costs, Relaxed, relax
from .whole import whole

LONGER, LONGEST = 1.25, 60.0  # steps, and the end, of looking for minutes that would do
FINE, LATER = 0.1, 1.08  # of the minutes: as near are they looked for; times as many where a plan of them does not do


def needed(found: Chosen, good: Callable[[Problem, Array], bool], more_than: float = 0.0, longest: float = LONGEST) -> float | None:
    """plan, what is asked of its information, minutes that do not do → minutes in which a quick plan reaches it.

    None: not within the longest. A quick choice of touches says where to look, in longer and longer times and then between them.
    What is named has been planned, with its turns as they come.
    """
    problem = found.problem
    quick = _Quick(found, good)
    short, minutes = max(problem.seconds / 60, more_than), None
    while (longer := math.ceil(2 * short * LONGER) / 2) <= longest:
        if quick.does(longer):
            minutes = longer
            break
        short = longer
    if minutes is None:
        return None
    while minutes - short > max(0.5, FINE * minutes):
        middle = math.ceil(short + minutes) / 2
        short, minutes = (short, middle) if quick.does(middle) else (middle, minutes)
    while minutes <= longest:
        with suppress(InputError):
            made = choose.quick(problem.of_time(60 * minutes))
            if good(problem, made.information):
                return minutes
        minutes = math.ceil(2 * minutes * LATER) / 2
    return None


class _Quick:
    """Whether a quick choice of touches in some time is good, for what touches and turns of a plan take."""

    def __init__(self, found: Chosen, good: Callable[[Problem, Array], bool]) -> None:
        self.found, self.good, self.light = found, good, lighter(found.problem)
        self.touch, self.visit, self.spare = choose.costs_of(found)
        choice = self.light.choice
        self.each = Costs(np.full(len(choice.rows), self.touch), np.full(len(choice.of_pose), self.visit))
        self.least = choose.least_touches(found.problem)
        self.relaxed: Relaxed | None = None

    def does(self, minutes: float) -> bool:
        """minutes → whether it is."""
        problem, light, choice = self.found.problem, self.light, self.light.choice
        again = problem.of_time(60 * minutes).repeats - problem.repeats  # a longer run repeats its first indexation
        seconds = 60 * minutes - self.spare - again * self.touch - (self.visit if again and not problem.repeats else 0.0)
        if seconds < self.visit + 3 * self.touch:  # what every plan needs takes longer
            return False
        if choose.most_told(problem, (self.touch, self.visit, self.spare), 60 * minutes)[0] < self.least:
            return False
        self.relaxed = relax(choice.rows, choice.of_pose, light.held, self.each, seconds, light.criterion, self.relaxed)
        mask = whole(choice.rows, choice.pose, choice.of_pose, light.held, self.each, seconds, self.relaxed, 0)
        return self.good(light, light.held + choice.rows[mask].T @ choice.rows[mask])
