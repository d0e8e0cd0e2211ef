"""Where the probe is proven: a plan begins with an upright tool where it has one, and with a facet from above for `gate: facet`.

With a tool that lies the way to the first touch leads down beside the table, and nothing has proven the probe on it yet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..gate import ABOVE
from ..records import Array
from .candidates import Candidates
from .criterion import value
from .problem import Problem

EDGE = 1e-6  # of the cosine: a facet at just that angle may be beyond it in the plan, by rounding
Mask = NDArray[np.bool_]


def _up(choice: Candidates) -> Array:
    """candidates → (m, 3) direction of the spindle axis on the table at each indexation."""
    machine = choice.cell.machine
    stations = [[i.position.get(name, 0.0) for name in machine.names] for i in choice.cell.strategy.indexations]
    return kinematics.spindle_axis(kinematics.chain(machine), np.array(stations))


def from_above(choice: Candidates) -> Mask:
    """candidates → (n,) which of them the probe touches from above."""
    normal = np.array([choice.cell.artefact.facets[f].normal for f in choice.facet])
    return np.asarray(np.einsum("ij,ij->i", normal, _up(choice)[choice.pose]) >= ABOVE + EDGE)


def upright(choice: Candidates) -> Mask:
    """candidates → (n,) which of them are touched with the tool as it stands where no rotary axis of the head has turned."""
    machine = choice.cell.machine
    head = {name for name in machine.rotary if name in machine.tool_branch}
    stations = [[i.position.get(n, 0.0) if n in head else 0.0 for n in machine.names] for i in choice.cell.strategy.indexations]
    up = kinematics.spindle_axis(kinematics.chain(machine), np.array([*stations, np.zeros(len(machine.names))]))
    return np.asarray((up[:-1] @ up[-1] >= ABOVE + EDGE)[choice.pose])


def beginnings(choice: Candidates, gate: str) -> list[Mask]:
    """candidates, what proves the probe → (n,) at which of them a plan begins: the first of these that it touches."""
    if gate == "none":
        return []
    stands = upright(choice)
    if gate != "facet":
        return [stands]
    above = from_above(choice)
    return [above & stands, above]


def proving(problem: Problem, mask: Mask) -> Mask:
    """chosen touches → one to make besides where none of them can prove the probe: where the plan is already, with an upright tool
    if there is any.

    Of several the one that makes the plan best. None where no facet can be touched from above, and for another gate.
    """
    choice, more = problem.choice, np.zeros(len(mask), dtype=np.bool_)
    if problem.gate != "facet":
        return more
    above = from_above(choice) & ~problem.barred
    if (above & mask).any() or not above.any():
        return more
    here = above & np.isin(choice.pose, np.unique(choice.pose[mask]))
    some = next(np.flatnonzero(m) for m in (here & upright(choice), here, above) if m.any())
    base = choice.held + choice.rows[mask].T @ choice.rows[mask]
    worth = [value(problem.criterion, base + np.outer(choice.rows[i], choice.rows[i])) for i in some]
    more[some[int(np.argmin(worth))]] = True
    return more
