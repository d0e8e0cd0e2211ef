"""Gauss–Newton on δd = J δE, with standard deviations, condition number and suspicious touches (thesis section 4.3).

The unknowns are carried as deviations from the nominal machine and table, never as 300 mm numbers: the iteration stops when
no touch would move by more than `STEP`, which is far above rounding and far below anything that can be measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from . import kinematics
from .features import good, located
from .identify import CLEAR, Selection, condition_number, scaled_condition_number, select
from .model import Model, errors, known, linearise, residual
from .records import Array, Artefact, Machine, Parameter, Readings, TangoError, TermItem
from .terms import causes
from .touches import FAR, Touches, from_readings, misnamed

STEP = 1e-11  # mm
SLOWEST = 0.01  # rate at which steps shrink that is trusted
ITERATIONS = 60
# mm: after a step as short as this the derivatives of the step before serve; the result moves by less than 1e-9 mm.
SERVES = 1e-6
# Below one nanometre the touches are treated as exact and the scale bar keeps its weight.
SIGMA_FLOOR = 1e-6
PLENTY = 120  # touches to spare that tell their scatter well enough
TWO_SIDED = 0.975


@dataclass(frozen=True)
class Jump:
    """Something moved at once: touches before and after contradict each other."""

    before: int  # number of the last touch before it
    after: int  # number of the first touch after it
    frame: str  # machine, table, spindle or axis (of which `axis` is the letter): in which it moved
    shift: tuple[float, float, float]  # mm, by which it moved there
    moves: tuple[str, ...]  # coefficients that it moves, or without which nothing would be known of them
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad, by which the table turned
    radius: float = 0.0  # mm, by which the tip is larger
    row: int = 0  # of the first touch after it, in the order of measurement
    axis: str = ""  # rotary axis that moved on what carries it
    instead: tuple[tuple[str, str], ...] = ()  # frame and axis of what may have moved in its place: these touches cannot tell


@dataclass(frozen=True)
class Noise:
    """What the residuals are made of, mm: white scatter of a touch; root mean square over the touches of a walk and of seating."""

    white: float
    walk: float = 0.0
    seating: float = 0.0
    facets: Mapping[str, float] = field(default_factory=dict)  # facets that scatter more than the others, each with its scatter
    step: Jump | None = None
    undecided: tuple[int, ...] = ()  # touches without weight, as others on their facet or ball do not fit: who is wrong is unknown
    columns: Array | None = None  # (n, q) what one standard deviation of walk and seating does to the touches, over `white`
    chance: float = 0.0  # of a smooth walk that nobody can tell from none, beside `walk`: the covariance has it, too


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
    rejected: NDArray[np.bool_] | None = None  # (n,) touches that do not fit and have no weight; None: all have the same
    unsure: NDArray[np.bool_] | None = None  # (n,) touches without weight: they or their neighbours are wrong
    noise: Noise | None = None  # None: taken as white

    @cached_property
    def condition_number(self) -> float:
        """→ of the Jacobian in mm and rad, machine and setup columns together, scale bar included."""
        return condition_number(self.jacobian)

    @property
    def scaled_condition_number(self) -> float:
        """→ of the Jacobian with columns of length 1: how alike the unknowns are to the touches, whatever their units."""
        return scaled_condition_number(self.jacobian)

    @cached_property
    def out(self) -> NDArray[np.bool_]:
        """→ (n,) touches that a robust fit cannot reach: flagged, not removed. One of several cycles, not its number in all."""
        return _outliers(self) if self.rejected is None else self.rejected

    @property
    def outliers(self) -> NDArray[np.int64]:
        """→ numbers of the touches that a robust fit cannot reach."""
        return self.model.touches.number[self.out]

    @property
    def unused(self) -> NDArray[np.bool_]:
        """→ (n,) touches that have no weight: outliers, and those of which nobody knows whether they are."""
        return self.out if self.unsure is None else self.out | self.unsure

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
    touches = from_readings(machine, located(artefact, good(readings)), readings)
    if not len(touches):
        raise TangoError("readings: found no touch with status ok; at least as many touches as unknowns are needed")
    first = [item for item in terms if not _needs_tip(item)]
    try:
        result = fit(select(touches, first, degree))
    except TangoError as error:
        raise type(error)(f"{error}{_elsewhere(touches)}") from None
    if len(first) < len(terms):
        result = fit(select(replace(touches, tip=tips(result)), terms, degree))
    return result


def _elsewhere(touches: Touches) -> str:
    """touches → what to add when no fit is found: those that were made at another facet than the readings say, or nothing."""
    found = misnamed(touches)
    if not found:
        return ""
    m = found[0]
    near = "" if m.near == m.facet else f", {m.beside:.1f} mm from where facet {m.near} is touched"
    count = "1 touch was" if len(found) == 1 else f"{len(found)} touches were"
    return (
        f". {count} made more than {FAR:g} mm from the facet that the readings name: touch {m.number} is called facet {m.facet}, "
        f"but was made {m.away:.1f} mm away{near}"
    )


def _needs_tip(item: TermItem) -> bool:
    name = item if isinstance(item, str) else str(item["cause"])
    return name in causes() and causes()[name].needs == "tip"


def tips(result: Estimate) -> Array:
    """estimate → (n, 3) mm, table frame, where it puts the stylus tip at every touch."""
    model = result.model
    machine, _, _ = model.split(result.values)
    return np.asarray(kinematics.tip(model.touches.chain, model.touches.position, errors(model, machine)))


def student(dof: float) -> float:
    """touches to spare → factor of standard deviations, so that ± 1.96 of them hold in 95 of 100 runs (Student's t).

    Few touches scatter by less than the probe does in every second run. Of 120 it is less than 1 %, and left alone.
    """
    return float(special.stdtrit(max(dof, 1.0), TWO_SIDED) / special.ndtri(TWO_SIDED)) if dof < PLENTY else 1.0


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
    values, size, damping = np.zeros(p), np.inf, 0.0
    used, shifted = sigma, 0.0
    full, weights, touched, root = np.zeros((0, p)), np.zeros(0), np.zeros((0, p + 1)), np.zeros((p, p))
    here: tuple[Array, Array, Array] | None = None
    for iterations in range(1, ITERATIONS + 1):
        offsets, rows, uncertainty = known(model, values)
        used, weights = sigma, np.concatenate([np.ones(n), sigma / uncertainty])
        if damping == 0 and size < SERVES:
            # A chord step, with the derivatives of the step before (Deuflhard 2011, Newton Methods for Nonlinear Problems, 2.1.2).
            right = np.concatenate([residual(model, values), offsets])
            if shifted > 1e-6:
                root = _step(touched, full[n:], right[n:], weights[n:], damping)[1]
            change = _again(full, right, weights, root)
        else:
            gaps, jacobian = linearise(model, values)
            right, full = np.concatenate([gaps, offsets]), np.vstack([jacobian, rows])
            if here is not None and _grew(here[1] * weights, right * weights):
                # Where a plan hardly sees a combination the step reaches so far that the model has curved away: a shorter one.
                values, right, full = here
                damping = max(10 * damping, 1e-6)
            else:
                touched = _triangle(full[:n], right[:n])
                damping = damping / 10 if damping > 1e-9 else 0.0
            here = values, right, full
            change, root = _step(touched, full[n:], right[n:], weights[n:], damping)
        moved = full @ change
        values = values - change
        longest = float(np.max(np.abs(moved)))
        rate, size = longest / size if size else 0.0, longest
        after = right - moved
        spare = max(n - p + _told(full[n:] * weights[n:, None], root), 1.0)
        sigma = max(float(np.sqrt(after[:n] @ after[:n] / spare)), SIGMA_FLOOR)
        shifted = abs(sigma / used - 1) if m else 0.0  # of sigma: the weights of bar and calibrated facets rest on sigma
        settled = shifted < 1e-3 and damping == 0 and iterations > 1
        # What is still to come is the last step times the rate at which steps shrink, in the end by hundreds and not squared.
        if settled and size * min(1.0, max(rate, SLOWEST)) < STEP:
            upper = np.triu(linalg.lapack.dpotri(root)[0])  # (RᵀR)⁻¹, of which LAPACK fills the upper half
            covariance = sigma**2 * (upper + np.triu(upper, 1).T)
            return Estimate(selection, values, covariance, after[:n], sigma, dof, iterations, full, after[n:], sigma / uncertainty)
    raise TangoError(
        f"estimate: the iteration did not settle in {ITERATIONS} steps; check readings and machine.yaml "
        "(axis directions, facet normals, stylus length), or use a smaller set of terms"
    )


def _told(rows: Array, root: Array) -> float:
    """(m, p) weighted rows of bar and calibrated facets, R (p, p) → how many unknowns they tell: 0 … m; the touches tell the rest.

    The residuals of the touches have the freedom of n − p + this: what is known of a facet that the touches hardly need takes
    nothing off their scatter. Where R is singular each row tells one, and what nothing determines is named later.
    """
    spread, failed = linalg.lapack.dtrtrs(root, rows.T, trans=1)
    told = float(np.sum(spread**2)) if len(rows) and not failed else float(len(rows))
    return min(told, float(len(rows))) if np.isfinite(told) else float(len(rows))


def _grew(before: Array, after: Array) -> bool:
    """weighted residuals before and after a step → whether their sum of squares grew by more than rounding."""
    return bool(after @ after > (1 + 1e-6) * (before @ before) + len(before) * STEP**2)


def _triangle(jacobian: Array, gaps: Array) -> Array:
    """(n, p), (n,) mm → the triangle (≤ p + 1, p + 1) of both side by side: all that a step needs of touches of weight 1.

    Far from the limit it is the Cholesky root of the normal equations, at a fifth of the cost: the steps that follow begin with
    exact gaps, so they take away what it rounds. Else a QR decomposition.
    """
    n, p = jacobian.shape
    normal = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(normal))
    if np.all(scale > 0):
        root, failed = linalg.lapack.dpotrf(normal / scale / scale[:, None])  # below its diagonal are zeros
        if not failed and np.min(np.diag(root)) > CLEAR:
            found = np.empty((p, p + 1))
            found[:, :p], found[:, p] = root * scale, linalg.blas.dtrsv(root, jacobian.T @ gaps / scale, trans=1)
            return found
    beside = np.empty((n, p + 1), order="F")
    beside[:, :p], beside[:, p] = jacobian, gaps
    return np.triu(linalg.lapack.dgeqrf(beside, lwork=64 * (p + 1), overwrite_a=True)[0][: p + 1])


def _step(touched: Array, rows: Array, offsets: Array, weights: Array, damping: float) -> tuple[Array, Array]:
    """`_triangle` of the touches; known rows (m, p), their residuals and weights (m,); damping → change (p,), root (p, p).

    The root is the triangular one of the weighted normal matrix. Known rows stand below the triangle of the touches, so that new
    weights cost no decomposition of all touches; damping as by Levenberg and Marquardt. Raises TangoError for dependent columns.
    """
    p, t, m = rows.shape[1], len(touched), len(rows)
    stacked = np.zeros((t + m + (p if damping else 0), p + 1), order="F")
    stacked[:t] = touched
    stacked[t : t + m, :p], stacked[t : t + m, p] = rows * weights[:, None], offsets * weights
    scale = np.linalg.norm(stacked[:, :p], axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    stacked[:, :p] /= scale
    if damping:
        stacked[t + m :, :p] = damping**0.5 * np.eye(p)
    if m or damping:
        # What stands below the triangle is not read.
        stacked = linalg.lapack.dgeqrf(stacked, lwork=64 * (p + 1), overwrite_a=True)[0]
    root = stacked[:p, :p]
    if not np.min(np.abs(np.diag(root))) > 1e-14:
        raise TangoError(
            "estimate: the touches that were made cannot separate all unknowns; check that readings and artefact "
            "belong together, or use a smaller set of terms (--terms)"
        )
    return linalg.solve_triangular(root, stacked[:p, p], check_finite=False) / scale, root * scale


def _again(full: Array, right: Array, weights: Array, root: Array) -> Array:
    """Jacobian (k, p), residuals (k,), weights (k,), triangular root (p, p) → change (p,), by the seminormal equations."""
    scale = np.linalg.norm(root, axis=0)
    triangle = np.asfortranarray(root / scale)
    side = linalg.blas.dtrsv(triangle, full.T @ (weights**2 * right) / scale, trans=1)
    return np.asarray(linalg.blas.dtrsv(triangle, side)) / scale


def _outliers(result: Estimate) -> NDArray[np.bool_]:
    """estimate → (n,) touches that a robust fit cannot reach.

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
            return np.zeros(n, dtype=np.bool_)
        standard /= size
        new = np.clip(1 - (standard / 6) ** 2, 0.05, None) ** 2
        if np.max(np.abs(new - weight)) < 0.02:
            break
        weight = new
    return np.asarray(np.abs(standard) > -float(special.ndtri(0.0005 / n)))


def without(readings: Readings, touches: Touches, out: NDArray[np.bool_]) -> Readings:
    """readings, touches (n,) of them, which of these → all other readings. A touch is meant in its cycle of its day, not in all."""
    gone = set(zip(touches.day[out].tolist(), touches.cycle[out].tolist(), touches.number[out].tolist(), strict=True))
    every = zip(readings.day.tolist(), readings.cycle.tolist(), readings.touch.tolist(), strict=True)
    return readings.rows(np.array([one not in gone for one in every], dtype=np.bool_))
