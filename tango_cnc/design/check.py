"""The quick check: a few touches that see any change of the machine larger than a stated size, wherever parts are made.

Theory of operation. A full run has said what the machine is, E, with a covariance; the check asks whether it is still that. Its
touches depend on E, on the changes δ since, and on a stylus that may have been mounted anew. All are unknowns of one linear
model whose first part the full run knows. The test is one: δ = 0 for locations, gains and backlashes together, by the χ² of
their estimate; and one more of what is left over, for changes of any other shape. Each has half of the false alarms.

A change that moves the tool tip by s in direction u at a pose has, whatever else changes with it, a noncentrality of at least
s² / Var(u·L δ̂). So the least power over all changes of size s follows from the largest prediction variance in the volume: the
plan is G-optimal (Kiefer and Wolfowitz 1960), and how small the change can be is a number of the plan alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize, special

from ..records import Array
from .candidates import WIDE, Candidates
from .choose import Chosen
from .criterion import Criterion
from .region import Levers

ALARMS = 1 / 730  # false alarms: one in two years of nights
POWER = 0.95
BIG = 0.005  # mm


def noncentrality(dof: int, alarms: float = ALARMS / 2, power: float = POWER) -> float:
    """degrees of freedom, false alarms, power → noncentrality at which a χ² test of that level has that power."""
    limit = float(special.chdtri(dof, alarms))
    return float(optimize.brentq(lambda size: 1 - special.chndtr(limit, dof, size) - power, 1e-3, 1e5))


def with_changes(choice: Candidates, before: Array, changing: list[int]) -> Candidates:
    """candidates, (p, p) information of the full run, unknowns that may have changed → candidates of the check.

    The changes come after the other unknowns and are known to nothing: a millimetre at a touch.
    """
    p, q = len(choice.scale), len(changing)
    held = np.zeros((p + q, p + q))
    held[:p, :p] = before
    held[p:, p:] = (choice.sigma / WIDE) ** 2 * np.eye(q)
    rows = np.hstack([choice.rows, choice.rows[:, changing]])
    scale = np.concatenate([choice.scale, choice.scale[changing]])
    return Candidates(choice.cell, choice.selection, choice.facet, choice.pose, rows, scale, held, tuple(changing))


def worst_change(choice: Candidates, lever: Levers) -> Criterion:
    """candidates of the check, levers of the unknowns of the full run → largest variance of the tool tip's change in the volume."""
    p = len(choice.scale) - len(choice.twice)
    changing = list(choice.twice)
    moved = lever.steady[:, :, changing] * choice.scale[changing]
    rows = np.zeros((moved.shape[0] * 3, len(choice.scale)))
    rows[:, p:] = moved.reshape(-1, len(changing))
    lost = lever.jumps[:, :, changing] * choice.scale[changing]
    largest = np.abs(lost).max(axis=(0, 1))
    backlash = np.zeros((int((largest > 0).sum()), len(choice.scale)))
    backlash[np.arange(len(backlash)), p + np.flatnonzero(largest > 0)] = largest[largest > 0]
    return Criterion("check", None, np.vstack([rows, backlash]))


@dataclass(frozen=True)
class Power:
    """What a check sees: least size of a change of locations, gains and backlashes (mm), and of each other one, by name."""

    size: float
    dof: int
    others: dict[str, float]


def power(found: Chosen, lever: Levers) -> Power:
    """plan of a check, levers → sizes (mm at the worst place of the volume) of changes that are seen with `POWER`."""
    choice = found.problem.choice
    p = len(choice.scale) - len(choice.twice)
    covariance = np.linalg.inv(found.information)[p:, p:] * choice.sigma**2
    moved = lever.steady[:, :, list(choice.twice)] * choice.scale[list(choice.twice)]
    spread = moved @ covariance @ np.swapaxes(moved, 1, 2)
    worst = float(np.linalg.eigvalsh(spread)[:, -1].max())
    lost = np.abs(lever.jumps[:, :, list(choice.twice)] * choice.scale[list(choice.twice)]).max(axis=(0, 1))
    worst = max(worst, float((lost**2 * np.diag(covariance)).max(initial=0.0)))
    machine = sum(1 for j in choice.twice if not choice.selection.model.coefficients[j].name.endswith("t"))
    size = np.sqrt(noncentrality(machine) * worst)
    # Of any other shape: what is left over when the stylus is free, with the scatter of the full run's prediction.
    before = choice.held[:p, :p]
    touches = found.rows[:, :p]
    scatter = np.eye(len(touches)) + touches @ np.linalg.solve(before, touches.T)
    root = np.linalg.cholesky(scatter)
    tip = [j for j, c in enumerate(choice.selection.model.coefficients) if c.name.endswith("t")]
    white = linalg.solve_triangular(root, touches, lower=True)
    basis = np.linalg.qr(white[:, tip])[0]
    seen = white - basis @ (basis.T @ white)
    needed = noncentrality(len(touches) - len(tip))
    others = {}
    for j, c in enumerate(choice.selection.model.coefficients):
        if j in choice.twice or j in tip:
            continue
        largest = float(np.linalg.norm(lever.steady[:, :, j], axis=1).max()) * choice.scale[j]
        strength = float(np.linalg.norm(seen[:, j]))
        others[c.name] = float("inf") if strength < 1e-9 else largest * choice.sigma * np.sqrt(needed) / strength
    return Power(float(size), machine, others)
