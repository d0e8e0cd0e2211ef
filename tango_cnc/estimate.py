"""Gauss–Newton on δd = J δE, with standard deviations, condition number and suspicious touches (thesis section 4.3).

The unknowns are carried as deviations from the nominal machine and table, never as 300 mm numbers: the iteration stops when
no touch would move by more than `STEP`, which is far above rounding and far below anything that can be measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats

from .identify import Selection, select
from .model import Model, known, linearise
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
    iterations: int
    jacobian: Array  # (n + m, p) at the solution: gaps of the touches, then calibrated facets and scale bar; mm, rad
    known_residuals: Array  # (m,) mm, calibrated facets and scale bar
    known_weights: Array  # (m,) sigma over their uncertainties

    @cached_property
    def condition_number(self) -> float:
        """→ of the Jacobian in mm and rad, machine and setup columns together, scale bar included."""
        return float(np.linalg.cond(self.jacobian))

    @cached_property
    def outliers(self) -> NDArray[np.int64]:
        """→ numbers of the touches that a robust fit cannot reach: flagged, not removed."""
        return _outliers(self)

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
    values, before = np.zeros(p), np.inf
    for iterations in range(1, ITERATIONS + 1):
        gaps, jacobian = linearise(model, values)
        offsets, rows, uncertainty = known(model, values)
        full = np.vstack([jacobian, rows])
        weights = sigma / uncertainty
        change, root = _step(full, np.concatenate([gaps, offsets]), np.concatenate([np.ones(n), weights]))
        moved = full @ change
        values = values - change
        gaps, offsets = gaps - moved[:n], offsets - moved[n:]
        size = float(np.max(np.abs(moved)))
        found = max(float(np.sqrt(gaps @ gaps / dof)), SIGMA_FLOOR)
        settled = m == 0 or abs(found - sigma) < 1e-3 * sigma
        sigma = found
        # What is still to come is the last step times the rate at which the steps shrink.
        if settled and size * min(1.0, size / before) < STEP:
            inverse = linalg.solve_triangular(root, sigma * np.eye(p), check_finite=False)
            return Estimate(selection, values, inverse @ inverse.T, gaps, sigma, dof, iterations, full, offsets, weights)
        before = size
    raise TangoError(
        f"estimate: the iteration did not settle in {ITERATIONS} steps; check readings and machine.yaml "
        "(axis directions, facet normals, stylus length), or use a smaller set of terms"
    )


def _step(full: Array, right: Array, weights: Array) -> tuple[Array, Array]:
    """Jacobian (k, p), residuals (k,), weights (k,) → change (p,), triangular root (p, p) of the weighted normal matrix.

    One QR decomposition of the scaled columns with the right-hand side beside them. Raises TangoError for dependent columns.
    """
    p = full.shape[1]
    weighted = full * weights[:, None]
    scale = np.linalg.norm(weighted, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    augmented = np.empty((len(full), p + 1), order="F")
    np.divide(weighted, scale, out=augmented[:, :p])
    augmented[:, p] = right * weights
    triangle = linalg.lapack.dgeqrf(augmented, lwork=64 * (p + 1), overwrite_a=True)[0]  # what stands below it is not read
    root = triangle[:p, :p]
    if not np.min(np.abs(np.diag(root))) > 1e-14:
        raise TangoError(
            "estimate: the touches that were made cannot tell all unknowns apart; check that readings and artefact "
            "belong together, or use a smaller set of terms (--terms)"
        )
    return linalg.solve_triangular(root, triangle[:p, p], check_finite=False) / scale, root * scale


def _outliers(result: Estimate) -> NDArray[np.int64]:
    """estimate → touch numbers that a robust fit cannot reach.

    Bisquare weights (Beaton & Tukey 1974) around the least-squares solution, residuals divided by what their leverage leaves
    of them, scale by the median; the threshold lets one set of good readings in a thousand be accused.
    """
    gaps = result.residuals
    n = len(gaps)
    weighted = result.jacobian * np.concatenate([np.ones(n), result.known_weights])[:, None]
    basis = np.asarray(np.linalg.qr(weighted)[0])
    touched, below = basis[:n], basis[n:]
    held, pull = below.T @ below, below.T @ (result.known_residuals * result.known_weights)
    weight = np.ones(n)
    standard = np.zeros(n)
    for _ in range(8):
        try:
            root = np.linalg.cholesky((touched.T * weight) @ touched + held)
        except np.linalg.LinAlgError:
            break
        seen = linalg.solve_triangular(root, touched.T, lower=True, check_finite=False)
        correction = linalg.solve_triangular(root, touched.T @ (weight * gaps) + pull, lower=True, check_finite=False)
        left = np.clip(1 - weight * np.sum(seen**2, axis=0), 0.0, 1.0)
        alone = left < 1e-6
        standard = np.where(alone, 0.0, (gaps - correction @ seen) / np.sqrt(np.where(alone, 1.0, left)))
        size = 1.4826 * float(np.median(np.abs(standard[~alone]))) if not alone.all() else 0.0
        if size < SIGMA_FLOOR:
            return np.array([], dtype=np.int64)
        standard /= size
        new = np.clip(1 - (standard / 6) ** 2, 0.05, None) ** 2
        if np.max(np.abs(new - weight)) < 0.02:
            break
        weight = new
    return result.model.touches.number[np.abs(standard) > float(stats.norm.isf(0.0005 / n))]


def without(readings: Readings, touches: NDArray[np.int64]) -> Readings:
    """readings, touch numbers → the readings of all other touches."""
    return readings.rows(~np.isin(readings.touch, touches))
