"""Where a facet proves the probe (`gate: facet`): a plan then touches one from above, and begins at that indexation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..gate import ABOVE
from .candidates import Candidates
from .criterion import value
from .problem import Problem

EDGE = 1e-6  # of the cosine: a facet at just that angle may be beyond it in the plan, by rounding
Mask = NDArray[np.bool_]


def from_above(choice: Candidates) -> Mask:
    """candidates → (n,) which of them the probe touches from above."""
    machine, artefact = choice.cell.machine, choice.cell.artefact
    stations = [[i.position.get(name, 0.0) for name in machine.names] for i in choice.cell.strategy.indexations]
    up = kinematics.spindle_axis(kinematics.chain(machine), np.array(stations))
    normal = np.array([artefact.facets[f].normal for f in choice.facet])
    return np.asarray(np.einsum("ij,ij->i", normal, up[choice.pose]) >= ABOVE + EDGE)


def proving(problem: Problem, mask: Mask) -> Mask:
    """chosen touches → one to make besides where none of them can prove the probe: where the plan is already, if there is any.

    Of several the one that makes the plan best. None where no facet can be touched from above, and for another gate.
    """
    choice, more = problem.choice, np.zeros(len(mask), dtype=np.bool_)
    if problem.gate != "facet":
        return more
    above = from_above(choice) & ~problem.barred
    some = np.flatnonzero(above & np.isin(choice.pose, np.unique(choice.pose[mask])))
    some = some if len(some) else np.flatnonzero(above)
    if (above & mask).any() or not len(some):
        return more
    base = choice.held + choice.rows[mask].T @ choice.rows[mask]
    worth = [value(problem.criterion, base + np.outer(choice.rows[i], choice.rows[i])) for i in some]
    more[some[int(np.argmin(worth))]] = True
    return more
