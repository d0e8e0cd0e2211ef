"""Whether it is plain after the first, quick plan that a search would end with a refusal.

The search makes a plan better by some percent; it seldom determines what a quick choice of the same time does not. So one look at
a time that is somewhat longer says whether the search is worth making.
"""

from __future__ import annotations

import numpy as np

from .enough import serves
from .problem import Problem, lighter
from .relaxed import Costs, Relaxed, relax
from .whole import whole

PATIENT = 1.15  # times the seconds that there are: what a search might gain


def in_vain(problem: Problem, costs: tuple[float, float, float], relaxed: Relaxed | None) -> bool:
    """problem, s of a facet, of a visit and of all else, where to begin → whether a quick choice of more time serves neither."""
    touch, visit, spare = costs
    light = lighter(problem)
    choice, seconds = light.choice, PATIENT * problem.seconds - spare
    each = Costs(np.full(len(choice.rows), touch), np.full(len(choice.of_pose), visit))
    relaxed = relax(choice.rows, choice.of_pose, light.held, each, seconds, light.criterion, relaxed)
    mask = whole(choice.rows, choice.pose, choice.of_pose, light.held, each, seconds, relaxed, 0)
    return not serves(light, light.held + choice.rows[mask].T @ choice.rows[mask])
