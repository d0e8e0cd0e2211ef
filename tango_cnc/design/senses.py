"""From which side rotary axes come to each indexation: the order of the indexations decides it, and a backlash is seen by it.

A candidate says what a touch tells when each rotary axis came from one side. A row is linear in the sense of each axis, −1 or 1, so
that the rows of any order follow from those of the candidates and one derivative for each axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..model import Model, linearise
from ..plan.preload import turned
from ..records import Array
from .candidates import Candidates, Rows

SAME = 1e-9  # rad: an axis that turns by less has not moved


@dataclass(frozen=True)
class Senses:
    """Of each axis that a row depends on: its name, the senses in the candidates (n, a), and derivatives of the rows (a, n, p)."""

    axes: tuple[str, ...]
    now: Array
    by: Array

    def rows(self, rows: Array, some: Rows, sense: Array) -> Array:
        """(n, p) rows of candidates, k of them, (a,) or (k, a) senses → (k, p) rows of these when the axes came so."""
        found = np.array(rows[some])
        for a in range(len(self.axes)):
            found += (np.broadcast_to(sense, (len(found), len(self.axes)))[:, a] - self.now[some, a])[:, None] * self.by[a][some]
        return found


def senses_of(choice: Candidates) -> Senses:
    """candidates → how their rows depend on the sense in which rotary axes came."""
    machine, own = choice.cell.machine, choice.selection.model
    names = (*machine.rotary, "S")
    columns = [machine.column(name) for name in names]

    def jacobian(sense: Array) -> Array:
        direction = own.touches.direction.copy()
        direction[:, columns] = sense
        model = Model(replace(own.touches, direction=direction), own.coefficients)
        found = linearise(model, np.zeros(len(model.names)))[1] * choice.scale[: len(model.names)]
        return np.hstack([found, found[:, list(choice.twice)]])

    base = jacobian(np.ones(len(names)))
    by = [(base - jacobian(np.where(np.arange(len(names)) == a, -1.0, 1.0))) / 2 for a in range(len(names))]
    used = [a for a in range(len(names)) if np.abs(by[a]).max(initial=0.0) > 0]
    now = own.touches.direction[:, [columns[a] for a in used]]
    return Senses(tuple(names[a] for a in used), now, np.array([by[a] for a in used]).reshape(len(used), *base.shape))


def of_order(choice: Candidates, senses: Senses, visits: Sequence[int]) -> Array:
    """candidates, their senses, indexations in their order → (m, a) sense in which each axis comes to each.

    To the first one from below, as a plan preloads it; an axis that does not turn stays as it came.
    """
    machine = choice.cell.machine
    positions: list[Mapping[str, float]] = [choice.cell.strategy.indexations[j].position for j in visits]
    found = np.ones((len(visits), len(senses.axes)))
    for a, name in enumerate(senses.axes):
        for i in range(1, len(visits)):
            change = turned(machine.axis(name), positions[i].get(name, 0.0) - positions[i - 1].get(name, 0.0))
            found[i, a] = np.sign(change) if abs(change) > SAME else found[i - 1, a]
    return found


def ordered(choice: Candidates, senses: Senses, visits: Sequence[int]) -> Candidates:
    """candidates, their senses, indexations in their order → candidates whose rows at these are as that order makes them."""
    rows, came = choice.rows.copy(), of_order(choice, senses, visits)
    for j, sense in zip(visits, came, strict=True):
        own = choice.of_pose[j]
        rows[own] = senses.rows(choice.rows, own, sense)
    return replace(choice, rows=rows)
