"""What no plan does without: so many touches, and so many indexations, before all that a goal asks for can be determined.

Theory of operation. φ is of combinations of unknowns (`aims`); all of them have to lie in what the touches tell. That a touch tells
one combination bounds the number of touches. What all touches at one indexation tell of the errors of the rotary axes has a rank:
6 where they turn the table, since a table has a place and a direction; 3 where they turn the head, since a tip has a place only.
The restriction of the aims to those errors lies in what the indexations tell of them together, whose rank is at most the sum.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from ..records import Array
from .candidates import WIDE
from .problem import Problem

SPARE = 1.1  # times as many seconds are counted: ways of the plan that says what a touch takes are short already
RANK = 1e-9  # of the largest singular value: smaller ones are rounding


def touches(problem: Problem) -> int:
    """problem → touches without which no plan determines what the goal asks for; 0 where that is not known so simply.

    What is certain without a touch helps little.
    """
    aims = _aims(problem)
    return 0 if aims is None else int(np.linalg.matrix_rank(aims) - _certain(problem))


def visits(problem: Problem) -> int:
    """problem → indexations without which no plan determines what the goal asks for; 1 where that is not known so simply."""
    aims, own = _aims(problem), _rotary(problem)
    if aims is None or not own:
        return 1
    return max(1, math.ceil((_rank(aims[:, own]) - _certain(problem)) / max(told(problem), 1)))


def told(problem: Problem) -> int:
    """problem → numbers of the errors of its rotary axes that touches at one indexation tell at most."""
    own, choice = _rotary(problem), problem.choice
    return max((_rank(choice.rows[some][:, own]) for some in choice.of_pose if len(some)), default=0)


def most_told(problem: Problem, costs: tuple[float, float, float], seconds: float) -> tuple[float, float]:
    """problem, s of a facet, of a visit and of all else, s → unknowns of the machine that a plan can tell at most; its touches.

    At each visit a facet is worth one touch, and every facet touched brings an unknown of its own; those of a ball share three.
    """
    touch, visit, spare = costs
    of_ball = Counter(facet.ball for facet in problem.choice.cell.artefact.facets.values() if facet.ball is not None)
    own = min([1.0, *(3 / count for count in of_ball.values())])
    counted = np.arange(visits(problem), max(len(problem.choice.of_pose), visits(problem)) + 1)
    made = np.maximum(SPARE * (seconds - spare) - counted * visit, 0.0) / touch
    told = made * (1 - own / counted)
    best = int(np.argmax(told))
    return float(told[best]), float(made[best])


def _rotary(problem: Problem) -> list[int]:
    """→ unknowns that are errors of rotary axes."""
    rotary = problem.choice.cell.machine.rotary
    return [j for j, c in enumerate(problem.choice.selection.model.coefficients) if c.slot.axis in rotary]


def _aims(problem: Problem) -> Array | None:
    """→ combinations of unknowns that φ is of; None for a check and for the determinant."""
    aims = problem.criterion.worst if problem.criterion.spread is None else problem.criterion.spread
    return None if problem.choice.twice or problem.criterion.determinant else aims


def _certain(problem: Problem) -> int:
    """→ combinations that are certain without a touch."""
    return int(np.linalg.matrix_rank(problem.held - (problem.choice.sigma / WIDE) ** 2 * np.eye(len(problem.held))))


def _rank(rows: Array) -> int:
    size = np.linalg.svd(rows, compute_uv=False)
    return int((size > RANK * size.max(initial=0.0)).sum())
