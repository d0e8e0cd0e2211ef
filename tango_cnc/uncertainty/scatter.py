"""What the residuals show and the budget leaves out: no interval is shorter than the scatter that was seen.

The very touches that have no weight in `tango estimate` have none here. What the others leave is compared with what the budget
lets one expect of it, E(rᵀWr) = tr(M V) with M = I − J(JᵀWJ)⁻¹JᵀW; beyond chance, the rest becomes one more line of the budget,
shaped as the residuals are: white, wandering, seating (JCGM 100:2008, 4.3.7 and F.2.4: a model is checked by its residuals).
"""

from __future__ import annotations

import numpy as np
from scipy import special

from ..estimate import Estimate, without
from ..records import Array, Readings
from .inputs import Part, Scene

CHANCE = 1e-3  # that a right budget is taken to leave something out
MOST = 0.35  # share of touches without weight beyond which nobody knows which are right: all are kept
LABEL = "scatter seen in the residuals"


def reached(readings: Readings, robust: Estimate | None) -> Readings:
    """readings, the estimate that gives outliers no weight (None: all count) → the readings that it rests on."""
    if robust is None or not robust.unused.any():
        return readings
    fewer = without(readings, robust.model.touches, robust.unused)
    return fewer if len(fewer) >= (1 - MOST) * len(readings) else readings


def with_rest(found: Estimate, robust: Estimate | None, own: tuple[Part, ...]) -> tuple[Part, ...]:
    """estimate, robust estimate (None: nothing is added), budget → the budget with a line for what it leaves out, if anything."""
    rest = None if robust is None else left_out(found, robust, own)
    return own if rest is None else (*own, rest)


def left_out(found: Estimate, robust: Estimate | None, own: tuple[Part, ...]) -> Part | None:
    """estimate (its residuals), robust estimate (its noise), budget → what the budget leaves out; None: nothing beyond chance."""
    n, weights = len(found.residuals), np.concatenate([np.ones(len(found.residuals)), found.known_weights])
    left = np.concatenate([found.residuals, found.known_residuals]) * weights
    weighted = found.jacobian * weights[:, None]
    basis = np.linalg.qr(weighted / np.maximum(np.linalg.norm(weighted, axis=0), 1e-300))[0]

    def seen(factor: Array) -> Array:
        here = factor * weights[:, None]
        return np.asarray(here - basis @ (basis.T @ here))

    allowed = np.hstack([seen(part.factor) for part in own])
    square = allowed.T @ allowed if allowed.shape[1] < len(allowed) else allowed @ allowed.T
    expected, dof = float(np.trace(square)), float(np.trace(square)) ** 2 / max(float(np.sum(square**2)), 1e-300)
    observed = float(left @ left)
    # A budget of a few directions leaves a few degrees of freedom; numerators of white residuals have all of them.
    if observed <= expected * float(special.chdtri(dof, CHANCE)) / dof or observed < n * 1e-12:
        return None
    shape = _shape(found, robust)
    return Part(LABEL, shape * np.sqrt((observed - expected) / float(np.sum(seen(shape) ** 2))), repeats=False)


def _shape(found: Estimate, robust: Estimate | None) -> Array:
    """→ (n + m, k) factor of scatter as the residuals show it, of any size."""
    scene, touches = Scene(found.model, found.values), found.model.touches
    noise = None if robust is None else robust.noise
    if noise is None:
        return scene.on_touches(np.eye(len(touches)))
    parts = [scene.on_touches(np.diag([noise.facets.get(facet, noise.white) for facet in touches.facet]))]
    time, day = touches.time, touches.day
    walk = float(np.hypot(noise.walk, noise.chance))
    for size, together in (
        (walk, np.minimum.outer(time - time.min(), time - time.min()) * np.equal.outer(day, day)),
        (noise.seating, np.equal.outer(touches.indexation, touches.indexation).astype(float)),
    ):
        if size and np.any(together):
            factor = scene.along(together)
            parts.append(factor * size / np.sqrt(np.sum(factor**2) / len(touches)))
    return np.hstack(parts)
