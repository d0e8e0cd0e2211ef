"""What `tango estimate` makes of touches on balls, and the touches without which it would lose one.

Candidates have a centre for every ball that they could determine. Of a ball that a plan touches from too few sides the estimate
knows no centre (`features.loose`): its facets have an offset each, and a scale bar that ends there is not used.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..features import completing, loose
from ..records import Array, Id
from .candidates import Candidates
from .criterion import value
from .problem import Problem

Mask = NDArray[np.bool_]


def as_estimated(choice: Candidates, facets: Sequence[Id], rows: Array) -> Array:
    """candidates, facet of every touch, (n, p) rows with all ball centres → (n, p) rows as the estimate has them.

    A free offset of a facet takes what all touches of the facet have in common. A check rests on a full run, which knows the balls.
    """
    artefact = choice.cell.artefact
    lost = () if choice.twice else loose(artefact, facets)
    if not lost:
        return rows
    names = choice.selection.model.names
    found = rows.copy()
    centres = {f"E{c}ball{ball}" for ball in lost for c in "XYZ"}
    found[:, [j for j, name in enumerate(names) if name in centres]] = 0.0
    for facet in set(facets):
        if artefact.facets[facet].ball in lost:
            own = [i for i, name in enumerate(facets) if name == facet]
            found[own] -= found[own].mean(axis=0)
    return found


def information(choice: Candidates, facets: Sequence[Id], rows: Array) -> Array:
    """candidates, facet of every touch, (n, p) their rows → (p, p) information that the estimate has from them."""
    own = as_estimated(choice, facets, rows)
    return np.asarray(choice.held + own.T @ own)


def unknowns(choice: Candidates, facets: Sequence[Id]) -> int:
    """candidates, facet of every touch → how many unknowns the estimate has: of the machine, the set-up and what is touched."""
    artefact, model, touched = choice.cell.artefact, choice.selection.model, set(facets)
    lost = loose(artefact, facets)
    balls = {artefact.facets[f].ball for f in touched} - {None, *lost}
    return len(model.coefficients) + 3 * len(balls) + sum(artefact.facets[f].ball in (None, *lost) for f in touched)


def needed(problem: Problem, mask: Mask) -> Mask:
    """chosen touches → touches to make besides, so that no ball is lost: where the plan is already, if there are any.

    Of several the one that makes the plan best. A ball that no touch completes stays as it is.
    """
    choice, more = problem.choice, np.zeros(len(mask), dtype=np.bool_)
    if choice.twice:
        return more
    artefact, facet, barred = choice.cell.artefact, np.array(choice.facet), problem.barred
    for ball in loose(artefact, [choice.facet[i] for i in np.flatnonzero(mask)]):
        while True:
            chosen = mask | more
            touched = [choice.facet[i] for i in np.flatnonzero(chosen)]
            if ball not in loose(artefact, touched):
                break
            offered = np.isin(facet, completing(artefact, ball, touched)) & ~chosen & ~barred
            here = offered & np.isin(choice.pose, np.unique(choice.pose[chosen]))
            some = np.flatnonzero(here if here.any() else offered)
            if not len(some):
                break
            base = choice.held + choice.rows[chosen].T @ choice.rows[chosen]
            worth = [value(problem.criterion, base + np.outer(choice.rows[i], choice.rows[i])) for i in some]
            more[some[int(np.argmin(worth))]] = True
    return more
