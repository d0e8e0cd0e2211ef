"""Readings of a check, and of the full run before it → whether the machine has changed, and by how much where parts are made."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, special

from ..records import Array, InputError, Readings
from ..touches import from_readings
from .candidates import Candidates
from .check import ALARMS, TIP, is_stylus, scatter, seen
from .measured import fitted, seen_at
from .region import Levers

CHANCE = 0.01  # of differences that are left, above which they are scatter


@dataclass(frozen=True)
class Change:
    """What a check says. Lengths in mm."""

    moved: float  # the most that the likely changes move the tool tip anywhere, or lose
    limit: float  # more is an alarm
    p_other: float  # of the touches' differences from the prediction, whatever their shape
    p_left: float  # the same of what the likely changes leave of these differences
    alarms: float  # false alarms of both tests together
    parameters: dict[str, tuple[float, float]]  # change, standard deviation, in the parameter's own unit; most certain first
    units: dict[str, str]  # of the parameters: mm, rad, mm/mm …

    @property
    def changed(self) -> bool:
        """→ whether it is an alarm."""
        return self.moved > self.limit or self.other

    @property
    def other(self) -> bool:
        """→ whether the touches differ from what the full run predicts, in whatever shape."""
        return self.p_other < (1 - TIP) * self.alarms

    @property
    def explained(self) -> bool:
        """→ whether the likely changes (locations, gains, backlashes) leave no more of the differences than chance does."""
        return self.p_left > CHANCE


def changed(
    choice: Candidates,
    lever: Levers,
    before: Readings,
    check: Readings,
    alarms: float = ALARMS,
    limit: float | None = None,
    was: Array | None = None,
) -> Change:
    """candidates of the check, levers, readings of the full run and of the check, false alarms → what the check says.

    `limit`: mm, where it is known already (`Seen.limit`). `was`: so is what the full run says (`measured.fitted`).

    Raises InputError for a check that touches a facet which the full run has not touched, and for one that is the full run itself.
    """
    artefact = choice.cell.artefact
    machine = choice.cell.machine
    if before.position.shape == check.position.shape and np.array_equal(before.position, check.position):
        raise InputError("check: found the readings of the full run itself; allowed: those of a check made after it")
    full, few = (replace(from_readings(machine, artefact, r), artefact=artefact) for r in (before, check))
    new = sorted(set(few.facets) - set(full.facets))
    if new:
        raise InputError(f"check: facet {new[0]} is not in the readings of the full run; allowed: facets that it has touched")
    p = len(choice.scale) - len(choice.twice)
    was = fitted(choice, full) if was is None else was
    gaps, jacobian = seen_at(choice, few, was)
    rows = np.hstack([jacobian, jacobian[:, list(choice.twice)]])
    root = scatter(choice, rows)
    information = choice.held + rows.T @ rows
    estimate = np.linalg.solve(information, rows.T @ -gaps)
    told = seen(choice, information, lever)
    own = [k for k, j in enumerate(choice.twice) if not is_stylus(choice, j)]
    change = estimate[p:][own]
    white = linalg.solve_triangular(root, gaps / choice.sigma, lower=True)
    after = gaps + jacobian[:, [choice.twice[k] for k in own]] @ change
    left = linalg.solve_triangular(root, after / choice.sigma, lower=True)
    std = np.sqrt(np.diag(told.covariance))
    names, units = {}, {}
    for i in np.argsort(-np.abs(change) / std):
        j = choice.twice[own[i]]
        coefficient = choice.selection.model.coefficients[j]
        label = choice.selection.label(coefficient.name)
        units[label] = coefficient.unit
        names[label] = (float(change[i] * choice.scale[j]), float(std[i] * choice.scale[j]))
    return Change(
        float(told.most(change[None])[0]),
        told.limit(TIP * alarms) if limit is None else limit,
        float(special.chdtrc(len(white), white @ white)),
        float(special.chdtrc(len(left), left @ left)),
        alarms,
        names,
        units,
    )
