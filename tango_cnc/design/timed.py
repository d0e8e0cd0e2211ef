"""A plan → what it is worth and how long it takes: as its touches will be made, in the model that `tango estimate` will take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..duration import PROOF, duration, of_moves, proof
from ..model import Model, linearise
from ..plan import last_motion
from ..records import Array, Cell, Plan
from ..touches import of_facets
from . import order
from .balls import as_estimated, information
from .candidates import Candidates
from .criterion import value
from .enough import determined, widened
from .problem import Chosen, Problem
from .sequence import FRACTIONS


def rows_of(choice: Candidates, made: Plan) -> Array:
    """candidates, plan → (n, p) rows of its touches with the last motions that the axes have in it."""
    position = np.array([touch.contact for touch in made.touches])
    facets = [t.facet for t in made.touches]
    cell = choice.cell
    touches = replace(of_facets(cell.machine, cell.artefact, facets, position, last_motion(made)), artefact=cell.artefact)
    model = Model(touches, choice.selection.model.coefficients)
    _, jacobian = linearise(model, np.zeros(len(model.names)))
    place = {name: j for j, name in enumerate(choice.selection.model.names)}
    found = np.zeros((len(facets), len(place)))
    found[:, [place[name] for name in model.names]] = jacobian
    found = found * choice.scale[: len(place)]
    return np.hstack([found, found[:, list(choice.twice)]])


def judged(problem: Problem, cell: Cell, made: Plan) -> Chosen:
    """problem, cell with a strategy, its plan → what the plan is worth and takes; no bound yet."""
    facets = [touch.facet for touch in made.touches]
    rows = as_estimated(problem.choice, facets, rows_of(problem.choice, made))
    spent, number, ways = np.zeros(len(rows) + 1), 0, 0.0
    indexation = [touch.indexation for touch in made.touches]
    turned = {0} | {n for n in range(1, len(rows)) if indexation[n] != indexation[n - 1]}
    moves = list(made.served)
    for (move, _), seconds in zip(moves, of_moves(made, problem.feed, moves), strict=True):
        spent[min(number, len(rows) - 1)] += seconds
        if move.kind in order.TOUCHING or number not in turned:
            ways += seconds
        if move.kind == "back":
            number += 1
    total = float(spent.sum())
    costs = ways / len(rows) * problem.times, (total - ways) / len(turned)
    told = problem.held + rows.T @ rows
    reached = value(problem.criterion, told)
    alive = proof(made, problem.gate, problem.feed)
    time = alive + np.cumsum(spent[:-1])
    return Chosen(problem, cell, made, alive + total, told, reached, -np.inf, 0.0, costs, time, rows)


def broken_off(found: Chosen, fractions: Sequence[float] = FRACTIONS) -> Array:
    """chosen plan, parts of its time → φ that an estimate of the touches made by then states; inf where they determine none."""
    problem, values = found.problem, []
    for part in fractions:
        made = int((found.time <= part * found.seconds + 1e-6).sum())
        facets = [touch.facet for touch in found.plan.touches[:made]]
        told = information(problem.choice, facets, found.rows[:made])
        widens = 1.0 if problem.criterion.determinant else widened(problem.choice, facets)
        values.append(value(problem.criterion, told) * widens**2 if determined(problem, told) else np.inf)
    return np.array(values)


def parts_of(found: Chosen) -> dict[str, float]:
    """chosen plan → s by part of the cycle."""
    alive = proof(found.plan, found.problem.gate, found.problem.feed)
    return duration(found.plan, found.problem.feed) | ({PROOF: alive} if alive else {})
