"""Gauss–Newton on δd = J δE, with standard deviations, condition number and suspicious touches (thesis section 4.3).

The unknowns are carried as deviations from the nominal machine and table, never as 300 mm numbers: the iteration stops when
no touch would move by more than `STEP`, which is far above rounding and far below anything that can be measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats

from .identify import Selection, select
from .model import Model, known, linearise, residual
from .records import Array, Artefact, Machine, Parameter, Readings, TangoError, TermItem
from .touches import from_readings

STEP = 1e-11  # mm
ITERATIONS = 30
# Below one nanometre the touches are treated as exact and the scale bar keeps its weight.
SIGMA_FLOOR = 1e-6


@dataclass(frozen=True)
class Estimate:
    """The fitted model: everything a report, a compensation or a further stage needs."""

    selection: Selection
    values: Array  # (p,) mm, rad …; order of model.names
    covariance: Array  # (p, p)
    residuals: Array  # (n,) mm, positive = the ball stands off the estimated surface
    sigma: float  # mm, standard deviation of a touch: from the residuals and their degrees of freedom
    dof: int
    condition_number: float
    iterations: int
    outliers: NDArray[np.int64]  # touch numbers, flagged and not removed

    @property
    def model(self) -> Model:
        """→ the model that was fitted."""
        return self.selection.model

    @property
    def std(self) -> Array:
        """→ (p,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    def value(self, name: str) -> float:
        """name of an unknown → its value. Raises ValueError for a name that was not estimated."""
        return float(self.values[self.model.names.index(name)])

    @property
    def parameters(self) -> dict[str, Parameter]:
        """→ machine coefficients under the names they may be reported by."""
        std = self.std
        return {
            self.selection.label(c.name): Parameter(float(self.values[i]), c.unit, float(std[i]))
            for i, c in enumerate(self.model.coefficients)
            if c.slot.stage not in ("stylus", "table") or c.slot.axis == ""
        }

    @property
    def setup(self) -> dict[str, Parameter]:
        """→ stylus tip offsets and, for a calibrated artefact, its placement on the table."""
        std = self.std
        return {
            c.name: Parameter(float(self.values[i]), c.unit, float(std[i]))
            for i, c in enumerate(self.model.coefficients)
            if c.slot.axis in ("t", "w")
        }

    @property
    def facets(self) -> dict[str, Parameter]:
        """→ facet offsets along the nominal normals, mm."""
        first, std = len(self.model.coefficients), self.std
        return {
            f: Parameter(float(self.values[first + i]), "mm", float(std[first + i]))
            for i, f in enumerate(self.model.touches.facets)
        }

    @property
    def balls(self) -> dict[str, Array]:
        """→ estimated ball centres (3,) mm, table frame."""
        _, _, shifts = self.model.split(self.values)
        known_balls = self.model.touches.artefact.balls
        return {ball: np.array(known_balls[ball].centre) + shifts[i] for i, ball in enumerate(self.model.touches.balls)}


def estimate(machine: Machine, artefact: Artefact, readings: Readings, terms: Sequence[TermItem], degree: int = 3) -> Estimate:
    """readings → estimate. Raises InputError for unknown terms, TangoError when the touches do not support a fit."""
    touches = from_readings(machine, artefact, readings)
    if not len(touches):
        raise TangoError("readings: found no touch with status ok; at least as many touches as unknowns are needed")
    return fit(select(touches, terms, degree))


def fit(selection: Selection) -> Estimate:
    """selection → estimate. Raises TangoError when there are too few touches or the iteration does not settle."""
    model = selection.model
    n, p = len(model.touches), len(model.names)
    m = len(known(model, np.zeros(p))[0])
    dof = n + m - p
    if dof < 1:
        raise TangoError(
            f"readings: found {n} touches for {p} unknowns; more touches than unknowns are needed: "
            "use a smaller set of terms (--terms) or touch more facets"
        )
    sigma = max(model.touches.machine.probe.repeatability, SIGMA_FLOOR)
    values, iterations = np.zeros(p), 0
    for _ in range(3):
        values, normal_root, steps = _iterate(model, values, sigma)
        iterations += steps
        gaps = residual(model, values)
        found = max(float(np.sqrt(gaps @ gaps / dof)), SIGMA_FLOOR)
        settled = m == 0 or abs(found - sigma) < 1e-3 * sigma
        sigma = found
        if settled:
            break
    _, jacobian = linearise(model, values)
    _, rows, uncertainty = known(model, values)
    weighted = np.vstack([jacobian, rows * (sigma / uncertainty)[:, None]])
    scale = np.linalg.norm(weighted, axis=0)
    inverse_root = linalg.solve_triangular(normal_root, np.eye(p))
    covariance = sigma**2 * (inverse_root @ inverse_root.T) / np.outer(scale, scale)
    return Estimate(
        selection,
        values,
        covariance,
        gaps,
        sigma,
        dof,
        float(np.linalg.cond(np.vstack([jacobian, rows]))),
        iterations,
        _outliers(model, gaps, weighted / scale),
    )


def _iterate(model: Model, values: Array, sigma: float) -> tuple[Array, Array, int]:
    """start, standard deviation of a touch → solution, triangular root of the scaled normal matrix, number of steps."""
    for step in range(1, ITERATIONS + 1):
        gaps, jacobian = linearise(model, values)
        offsets, rows, uncertainty = known(model, values)
        weight = sigma / uncertainty
        full = np.vstack([jacobian, rows * weight[:, None]])
        right = np.concatenate([gaps, offsets * weight])
        scale = np.linalg.norm(full, axis=0)
        scaled = full / scale
        root = linalg.qr(scaled, mode="r", check_finite=False)[0][: len(scale)]
        # Seminormal equations, one solve forwards and one back; the iteration itself corrects what rounding leaves.
        change = linalg.solve_triangular(root, linalg.solve_triangular(root, scaled.T @ right, trans="T", check_finite=False))
        values = values - change / scale
        if float(np.max(np.abs(scaled @ change))) < STEP:
            return values, root, step
    raise TangoError(
        f"estimate: the iteration did not settle in {ITERATIONS} steps; check readings and machine.yaml "
        "(axis directions, facet normals, stylus length), or use a smaller set of terms"
    )


def _outliers(model: Model, gaps: Array, scaled: Array) -> NDArray[np.int64]:
    """gaps (n,), scaled Jacobian (n + m, p) at the solution → touch numbers that a robust fit cannot reach.

    Bisquare weights (Beaton & Tukey 1974) around the least-squares solution, residuals divided by what their leverage leaves
    of them, scale by the median; the threshold lets one set of good readings in a thousand be accused.
    """
    n = len(gaps)
    extra = len(scaled) - n
    weight = np.ones(n)
    spread = gaps
    for _ in range(8):
        root = np.sqrt(np.concatenate([weight, np.ones(extra)]))
        q, r = np.linalg.qr(scaled * root[:, None])
        if np.min(np.abs(np.diag(r))) < 1e-9:
            break
        correction = np.linalg.solve(r, q.T @ (root * np.concatenate([gaps, np.zeros(extra)])))
        spread = gaps - scaled[:n] @ correction
        left = np.clip(1 - np.sum(q[:n] ** 2, axis=1), 0.0, 1.0)
        alone = left < 1e-6
        standard = np.where(alone, 0.0, spread / np.sqrt(np.where(alone, 1.0, left)))
        size = 1.4826 * float(np.median(np.abs(standard[~alone]))) if not alone.all() else 0.0
        if size < SIGMA_FLOOR:
            return np.array([], dtype=np.int64)
        new = np.clip(1 - (standard / (6 * size)) ** 2, 0.05, None) ** 2
        if np.max(np.abs(new - weight)) < 0.02:
            break
        weight = new
    limit = float(stats.norm.isf(0.0005 / n))
    return model.touches.number[np.abs(standard) > limit * size]


def without(readings: Readings, touches: NDArray[np.int64]) -> Readings:
    """readings, touch numbers → the readings of all other touches."""
    return readings.rows(~np.isin(readings.touch, touches))
