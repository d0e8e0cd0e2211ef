"""Whether a plan determines what its goal asks for, or only repeats what is assumed of every machine.

Every unknown is taken to be within `WIDE` of nominal before anything is measured, so that a plan of any touches has a number. Where
that number grows when the unknowns are taken to be further off, it is made of the assumption. `tango estimate` does not make it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..estimate import student
from ..features import bar_left_out
from ..records import Array, Id
from .balls import unknowns
from .candidates import WIDE, Candidates
from .check import is_stylus
from .criterion import value
from .problem import Chosen, Problem

SPARE = 15  # touches more than unknowns: with fewer than 10 an estimate is incomplete, and some may go wrong
LOOSER = 0.01  # of the information that is assumed of every unknown is left: ten times as far from nominal
GROWS = 1.1  # times φ may grow with it
COARSE = 0.02  # mm, standard deviation of a change of the tool tip: what a check sees must be six times as large


def determined(problem: Problem, information: Array) -> bool:
    """problem, A (p, p) of a plan → whether φ follows from touches and certificates; of the determinant, which counts all, True."""
    if problem.criterion.determinant:
        return True
    choice = problem.choice
    assumed = np.full(len(information), (choice.sigma / WIDE) ** 2)
    first = len(choice.scale) - len(choice.twice)
    for k, j in enumerate(choice.twice):
        if is_stylus(choice, j):  # how well it comes back was stated
            assumed[first + k] = 0.0
    loose = information - (1 - LOOSER) * np.diag(assumed)
    return bool(value(problem.criterion, loose) < GROWS * value(problem.criterion, information))


def serves(problem: Problem, information: Array) -> bool:
    """problem, A (p, p) of a plan → whether it is worth making: it determines what it is for, and a check sees 0.1 mm."""
    if not determined(problem, information):
        return False
    return not _checks(problem) or problem.choice.sigma * value(problem.criterion, information) ** 0.5 < COARSE


def to_spare(found: Chosen) -> int:
    """plan → touches that it has more than its estimate has unknowns: they show whether the result may be believed."""
    return spare(found.problem.choice, [touch.facet for touch in found.plan.touches])


def widened(choice: Candidates, facets: Sequence[Id]) -> float:
    """candidates, facet of every touch → factor by which `tango estimate` widens standard deviations (Student's t).

    Few touches to spare leave the scatter unsure. Certificates count as touches. 1 for a check: it rests on a full run.
    """
    if choice.twice:
        return 1.0
    model, artefact, touched = choice.selection.model, choice.cell.artefact, set(facets)
    certain = sum(model.touches.facets[place] in touched for place, _ in model.calibrated)
    if artefact.scale_bar is not None and bar_left_out(artefact, facets) is None:
        certain += 1
    return student(spare(choice, facets) + certain)


def promised(found: Chosen) -> float:
    """plan → φ with the standard deviations that `tango estimate` will state; of the determinant as it is."""
    if found.problem.criterion.determinant:
        return found.value
    return found.value * widened(found.problem.choice, [touch.facet for touch in found.plan.touches]) ** 2


def spare(choice: Candidates, facets: Sequence[Id]) -> int:
    """candidates, facet of every touch → touches more than the estimate of these has unknowns."""
    return len(facets) - unknowns(choice, facets)


def believed(found: Chosen) -> bool:
    """plan → whether it has touches enough to spare; a check rests on a full run, which has them."""
    return bool(found.problem.choice.twice) or to_spare(found) >= SPARE


def _checks(problem: Problem) -> bool:
    """problem → whether it is a check, which rests on a full run."""
    return problem.criterion.name == "check"
