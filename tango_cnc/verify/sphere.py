"""The sphere test of thesis chapter 6: one ball, touched at many indexations, must come out as one ball in the table frame.

The touched points are carried into the table frame once by the nominal model and once by the estimated one; what is left
about the best-fitting sphere is the machine's error as a coordinate measuring machine, isotropic scale excepted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import kinematics
from ..estimate import Estimate
from ..model import Model, linearise
from ..records import Approach, Array, Artefact, Ball, Facet, Id, Indexation, InputError, Machine, Readings, Strategy
from ..touches import Touches, from_readings, of_facets
from ._shared import tips

PARALLELS = ((0.0, 12), (30.0, 8), (-30.0, 8), (60.0, 4), (90.0, 1))  # latitude deg, points: section 6.3
BALL = "1"


@dataclass(frozen=True)
class SphereFit:
    """The sphere of least squared radial distances through tip centres, mm, table frame."""

    centre: Array  # (3,)
    radius: float
    residual: Array  # (n,) positive = outside

    @property
    def out_of_sphericity(self) -> float:
        """→ mm, largest minus smallest residual (section 6.6)."""
        return float(np.ptp(self.residual))

    @property
    def sd(self) -> float:
        """→ mm, standard deviation of the residuals."""
        return float(self.residual.std(ddof=1))


@dataclass(frozen=True)
class SphereTest:
    """One set of touches on a ball, carried into the table frame by the nominal and by the estimated model."""

    touches: Touches
    nominal: SphereFit
    compensated: SphereFit
    true_radius: float  # mm, of ball and tip together
    expected: tuple[float, float]  # mm, median and 97.5 % of the out-of-sphericity that touch and estimate alone leave

    def size_error(self, fit: SphereFit) -> float:
        """fit → mm, radius found minus radius of ball and tip."""
        return fit.radius - self.true_radius


def directions() -> Array:
    """→ (33, 3) outward unit normals: 12 on the equator, 8 at +30° and −30°, 4 at 60°, the pole (section 6.3)."""
    found = []
    for latitude, count in PARALLELS:
        around, up = 2 * np.pi * np.arange(count) / count, np.radians(latitude)
        found.append(np.column_stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.full(count, np.sin(up))]))
    return np.vstack(found)


def sphere_cell(
    machine: Machine,
    indexations: Sequence[Indexation],
    centre: Sequence[float],
    radius: float,
    approach: Approach = Approach(10.0, 5.0, 180.0),  # noqa: B008  frozen
) -> tuple[Artefact, Strategy]:
    """machine, indexations, centre and radius (mm, table frame) → the ball with its 33 facets, and what is touched where.

    Kept are the touches whose normal does not point away from the spindle. Raises InputError when none is left.
    """
    normals = directions()
    middle = np.array(centre, dtype=float)
    facets: dict[Id, Facet] = {}
    for i, n in enumerate(normals, 1):
        point, normal = middle + radius * n, n + 0.0
        facets[f"{i}"] = Facet(f"{i}", tuple(point.tolist()), tuple(normal.tolist()), ball=BALL)
    artefact = Artefact(f"sphere of {2 * radius:g} mm", facets, {BALL: Ball(BALL, tuple(middle.tolist()), radius)})
    chain, kept = kinematics.chain(machine), []
    for indexation in indexations:
        position = np.array([[indexation.position.get(name, 0.0) for name in machine.names]])
        upward = kinematics.spindle_axis(chain, position)[0]
        reach = tuple(facet for facet, n in zip(facets, normals, strict=True) if n @ upward >= -1e-9)
        if reach:
            kept.append(Indexation(indexation.position, reach))
    if not kept:
        raise InputError(
            "sphere: no indexation lets the probe reach the sphere; add indexations that tilt the table to the spindle"
        )
    return artefact, Strategy("sphere test", approach, tuple(kept))


def drawn(result: Estimate, seed: int = 6) -> Estimate:
    """estimate → one machine that it might stand for: values drawn with its covariance."""
    values = _draw(result, len(result.values), 1, np.random.default_rng(seed))
    return replace(result, values=result.values + values[:, 0])


def contacts(
    machine: Machine, artefact: Artefact, strategy: Strategy, result: Estimate | None, sigma: float = 0.0, seed: int = 6
) -> Touches:
    """ball, strategy, estimate taken for the truth (None: nominal machine) → touches where that machine would make them.

    `sigma` mm scatters the touches along their normals. Fixed point on the nominal inverse: the error of the chain hardly
    changes over the distance that it causes.
    """
    facets = [f for indexation in strategy.indexations for f in indexation.facets]
    position = np.array(
        [
            [indexation.position.get(name, 0.0) for name in machine.names]
            for indexation in strategy.indexations
            for _ in indexation.facets
        ]
    )
    touches = of_facets(machine, artefact, facets, position, np.zeros_like(position)).nominal
    tip = touches.point + machine.probe.tip_radius * touches.normal
    touches = replace(touches, direction=_approach(touches, tip))
    if sigma:
        tip = tip + np.random.default_rng([seed, 1]).normal(scale=sigma, size=(len(tip), 1)) * touches.normal
    if result is None:
        return replace(touches, position=kinematics.inverse(touches.chain, touches.position, tip))
    wanted = tip
    for _ in range(12):
        missed = tip - tips(result, touches)
        wanted = wanted + missed
        touches = replace(touches, position=kinematics.inverse(touches.chain, touches.position, wanted))
        if np.max(np.abs(missed)) < 1e-12:
            break
    return touches


def _approach(touches: Touches, tip: Array) -> Array:
    """→ (n, k) −1 0 1, directions of the last motions: towards the ball along its normal, in the order of measurement."""
    before = kinematics.inverse(touches.chain, touches.position, tip + touches.normal)
    moved = np.where(np.abs(touches.position - before) > 1e-6, np.sign(touches.position - before), 0.0)
    turned = np.sign(np.diff(touches.position, axis=0, prepend=0 * touches.position[:1]))
    linear = list(touches.chain.linear_columns)
    turned[:, linear] = 0.0
    latest = np.where(moved != 0, moved, np.where(np.abs(turned) > 0, turned, 0.0))
    row = np.maximum.accumulate(np.where(latest != 0, np.arange(len(latest))[:, None], 0), axis=0)
    return np.take_along_axis(latest, row, axis=0)


def fit_sphere(points: Array) -> SphereFit:
    """(n, 3) mm, four or more → the sphere of least squared radial distances (Gauss–Newton, section 6.4).

    Raises InputError when the points do not fix a sphere.
    """
    if len(points) < 5:
        raise InputError(f"sphere: found {len(points)} points; allowed: 5 or more")
    origin = points.mean(axis=0)
    away = points - origin
    matrix = np.column_stack([2 * away, np.ones(len(away))])
    start, _, rank, _ = np.linalg.lstsq(matrix, np.sum(away**2, axis=1), rcond=1e-12)
    if rank < 4:
        raise InputError("sphere: the points lie in one plane; touch the sphere at several heights")
    centre, radius = start[:3], float(np.sqrt(start[3] + start[:3] @ start[:3]))
    for _ in range(30):
        spoke = away - centre
        distance = np.linalg.norm(spoke, axis=1)
        jacobian = np.column_stack([-spoke / distance[:, None], -np.ones(len(away))])
        step = np.linalg.lstsq(jacobian, distance - radius, rcond=None)[0]
        centre, radius = centre - step[:3], radius - float(step[3])
        if np.max(np.abs(step)) < 1e-13:
            break
    residual = np.linalg.norm(away - centre, axis=1) - radius
    return SphereFit(origin + centre, radius, residual)


def sphere_test(result: Estimate, touches: Touches, trials: int = 400) -> SphereTest:
    """estimate, touches on one ball → the ball seen through the nominal and the estimated model. Raises InputError."""
    balls = touches.balls
    if len(balls) != 1 or touches.facets:
        raise InputError("sphere: found facets off the ball or more than one ball; allowed: readings on the facets of one ball")
    nominal = fit_sphere(kinematics.tip(touches.chain, touches.position))
    compensated = fit_sphere(tips(result, touches))
    radius = touches.artefact.balls[balls[0]].radius + touches.machine.probe.tip_radius
    return SphereTest(touches, nominal, compensated, radius, _expected(result, touches, trials))


def measured(machine: Machine, artefact: Artefact, readings: Readings) -> Touches:
    """cell of the sphere and its readings → touches that made proper contact."""
    return from_readings(machine, artefact, readings)


def _expected(result: Estimate, touches: Touches, trials: int) -> tuple[float, float]:
    """→ mm, median and 97.5 % of the out-of-sphericity when the estimate errs as its covariance says and a touch as its sigma.

    First order: radial error of a point = lever · δE + touch, less what centre and radius of the fit take up.
    """
    model = Model(touches, result.model.coefficients)
    _, jacobian = linearise(model, np.zeros(len(model.names)))
    count = len(model.coefficients)
    rng = np.random.default_rng(6)
    draws = _draw(result, count, trials, rng)
    radial = jacobian[:, :count] @ draws + rng.normal(scale=result.sigma, size=(len(touches), trials))
    taken = np.column_stack([touches.normal, np.ones(len(touches))])
    left = radial - taken @ np.linalg.lstsq(taken, radial, rcond=None)[0]
    spread = np.ptp(left, axis=0)
    return float(np.median(spread)), float(np.quantile(spread, 0.975))


def _draw(result: Estimate, count: int, trials: int, rng: np.random.Generator) -> Array:
    """→ (count, trials) deviations of the first unknowns, drawn with their covariance."""
    covariance = result.covariance[:count, :count]
    scale = np.sqrt(np.diag(covariance))  # mm² and rad² side by side: factor the correlations, not the covariances
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.clip(values, 0.0, None))
    return np.asarray(root @ rng.normal(size=(count, trials)))
