"""The quick check: a few touches that see any change of the machine larger than a stated size, wherever parts are made.

Theory of operation. A full run has said what the machine is, E, with a covariance; the check asks whether it is still that.
Its touches depend on E, on the changes δ since of locations, gains and backlashes, and on where the stylus is now, which comes
back to the spindle within a stated repeatability. All are unknowns of one linear model whose first part the full run knows.

Two tests share the false alarms, nine in ten for the first (`TIP`). It is in the unit of the part: the changes δ̂ that the touches
make likely move the tool tip by T at most, anywhere in the volume; more than the limit c is an alarm. c is the quantile of T for a
machine that is what it was, by Monte Carlo. A change that moves the tip by s in direction u at a pose moves it, in δ̂, by
s + N(0, Var u·Lδ̂). So T exceeds c with the stated power when s is at least c + z σ, σ² the largest prediction variance in the
volume, whatever else changes with it: the plan is G-optimal (Kiefer and Wolfowitz 1960). The second is χ² of what the touches
differ from the prediction by, for changes of any other shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize, special

from ..model import STYLUS as STYLUS_NAMES
from ..records import Array
from .candidates import WIDE, Candidates
from .criterion import Criterion
from .problem import Chosen
from .region import Levers

ALARMS = 1 / 730  # false alarms: one in two years of nights
TIP = 0.9  # of them are left to the first test, by which a check is judged; the others to the second one
POWER = 0.95
STYLUS = 0.002  # mm: how well a stylus comes back to the spindle when nobody states it; taper and probe together
DRAWS = 100_000  # of a machine that is what it was, for the limit
CHUNK = 5_000


def noncentrality(dof: int, alarms: float = (1 - TIP) * ALARMS, power: float = POWER) -> float:
    """degrees of freedom, false alarms, power → noncentrality at which a χ² test of that level has that power."""
    limit = float(special.chdtri(dof, alarms))
    return float(optimize.brentq(lambda size: 1 - special.chndtr(limit, dof, size) - power, 1e-3, 1e5))


def with_changes(choice: Candidates, before: Array, changing: list[int], stylus: float) -> Candidates:
    """candidates, (p, p) information of the full run, unknowns that may have changed, mm stylus comes back within → candidates.

    The changes come after the other unknowns. Those of the machine are known to nothing: a millimetre at a touch.
    """
    p, q = len(choice.scale), len(changing)
    held = np.zeros((p + q, p + q))
    held[:p, :p] = before
    wide = [stylus / choice.scale[j] if is_stylus(choice, j) else WIDE for j in changing]
    held[p:, p:] = np.diag((choice.sigma / np.array(wide)) ** 2)
    rows = np.hstack([choice.rows, choice.rows[:, changing]])
    scale = np.concatenate([choice.scale, choice.scale[changing]])
    return Candidates(choice.cell, choice.selection, choice.facet, choice.pose, rows, scale, held, tuple(changing))


def is_stylus(choice: Candidates, j: int) -> bool:
    """candidates, unknown → whether it is where the stylus is."""
    return choice.selection.model.names[j] in STYLUS_NAMES


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
class Seen:
    """What the touches of a check say of changes: their covariance, and what each does to the tool tip."""

    covariance: Array  # (q, q) of the changes of the machine, scaled, mm²
    moved: Array  # (m, 3, q) mm of the tool tip, by pose
    lost: Array  # (k, q) mm, by backlash

    def most(self, change: Array) -> Array:
        """(n, q) changes → (n,) mm: the most that each moves the tool tip anywhere, or loses."""
        found = np.zeros(len(change))
        for begin in range(0, len(change), CHUNK):
            some = slice(begin, begin + CHUNK)
            far = np.sqrt(((self.moved @ change[some].T) ** 2).sum(axis=1)).max(axis=0)
            found[some] = np.maximum(far, np.abs(change[some] @ self.lost.T).max(axis=1, initial=0.0))
        return found

    @property
    def worst(self) -> float:
        """→ mm, largest standard deviation of what moves the tool tip in any direction, or is lost."""
        spread = self.moved @ self.covariance @ np.swapaxes(self.moved, 1, 2)
        lost = np.einsum("ki,ij,kj->k", self.lost, self.covariance, self.lost)
        return float(np.sqrt(max(np.linalg.eigvalsh(spread)[:, -1].max(), lost.max(initial=0.0))))

    def limit(self, alarms: float = TIP * ALARMS) -> float:
        """false alarms → mm that the tool tip moves by so rarely when nothing has changed."""
        root = np.linalg.cholesky(self.covariance)
        draws = np.random.default_rng(730).standard_normal((DRAWS, len(root)))
        return float(np.quantile(self.most(draws @ root.T), 1 - alarms))


def seen(choice: Candidates, information: Array, lever: Levers) -> Seen:
    """candidates of the check, (p + q, p + q) information of its touches and the full run, levers → what it sees of changes."""
    p = len(choice.scale) - len(choice.twice)
    own = [k for k, j in enumerate(choice.twice) if not is_stylus(choice, j)]
    changing = [choice.twice[k] for k in own]
    covariance = np.linalg.inv(information)[p:, p:][np.ix_(own, own)] * choice.sigma**2
    lost = np.abs(lever.jumps[:, :, changing] * choice.scale[changing]).max(axis=(0, 1))
    return Seen(np.asarray(covariance), lever.steady[:, :, changing] * choice.scale[changing], np.diag(lost)[lost > 0])


@dataclass(frozen=True)
class Power:
    """What a check sees: least size of a change of locations, gains and backlashes (mm), and of each other one, by name."""

    size: float
    limit: float  # mm by which the tool tip seems to move before it is an alarm
    others: dict[str, float]


def power(found: Chosen, lever: Levers) -> Power:
    """plan of a check, levers → sizes (mm at the worst place of the volume) of changes that are seen with `POWER`."""
    choice = found.problem.choice
    told = seen(choice, found.information, lever)
    limit = told.limit()
    size = limit + float(special.ndtri(POWER)) * told.worst
    p = len(choice.scale) - len(choice.twice)
    root, touches = scatter(choice, found.rows), found.rows[:, :p]
    white = linalg.solve_triangular(root, touches, lower=True)
    needed = noncentrality(len(touches))
    others = {}
    for j, c in enumerate(choice.selection.model.coefficients):
        if j in choice.twice or is_stylus(choice, j):
            continue
        largest = float(np.linalg.norm(lever.steady[:, :, j], axis=1).max()) * choice.scale[j]
        strength = float(np.linalg.norm(white[:, j]))
        others[c.name] = float("inf") if strength < 1e-9 else largest * choice.sigma * np.sqrt(needed) / strength
    return Power(size, limit, others)


def scatter(choice: Candidates, rows: Array) -> Array:
    """candidates of the check, (n, p + q) rows → (n, n) root of the covariance of what touches differ from the prediction by.

    By the full run's uncertainty, and by where the stylus is now; in standard deviations of a touch.
    """
    p = len(choice.scale) - len(choice.twice)
    spread = np.eye(len(rows)) + rows[:, :p] @ np.linalg.solve(choice.held[:p, :p], rows[:, :p].T)
    for k, j in enumerate(choice.twice):
        if is_stylus(choice, j):
            spread += np.outer(rows[:, p + k], rows[:, p + k]) / choice.held[p + k, p + k]
    return np.asarray(np.linalg.cholesky(spread))
