"""Whether it is plain after the first, quick plan that a search would end with a refusal.

The search makes a plan better by some percent; it seldom determines what a choice of touches of somewhat more time does not. So a
quick choice of that time says whether the search is worth making; where it does not, one whose visits are exchanged does: of a
machine whose turns are slow, that may determine everything where the quick one does not.
"""

from __future__ import annotations

import numpy as np

from .enough import serves
from .problem import Problem, lighter
from .relaxed import Costs, Relaxed, relax
from .whole import SHAKES, whole

PATIENT = 1.15  # times the seconds that there are: what a search might gain on a quick choice
NEARLY = 1.05  # the same on one whose visits are exchanged


def in_vain(problem: Problem, costs: tuple[float, float, float], relaxed: Relaxed | None) -> bool:
    """problem, s of a facet, of a visit and of all else, where to begin → whether no choice of more time serves, either."""
    touch, visit, spare = costs
    light = lighter(problem)
    choice = light.choice
    each = Costs(np.full(len(choice.rows), touch), np.full(len(choice.of_pose), visit))
    long = light.criterion.worst is not None  # exchanging visits for the worst of many takes minutes
    often = ((PATIENT, 0),) if long else ((PATIENT, 0), (NEARLY, SHAKES))
    for patient, shakes in often:
        seconds = patient * problem.seconds - spare
        relaxed = relax(choice.rows, choice.of_pose, light.held, each, seconds, light.criterion, relaxed)
        mask = whole(choice.rows, choice.pose, choice.of_pose, light.held, each, seconds, relaxed, shakes)
        if serves(light, light.held + choice.rows[mask].T @ choice.rows[mask]):
            return False
    return True
