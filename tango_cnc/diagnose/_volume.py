"""What a diagnosis changes in the predicted error of the tool tip over the volume that was touched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import kinematics
from ..estimate import Estimate
from ..kinematics import Slot
from ..records import Array
from ..terms import GAP
from ..touches import Touches, of_facets

POSES = 400


@dataclass(frozen=True)
class Volume:
    """Lengths of the tip error vectors over random poses within the touched ranges, mm, the best rigid set-up taken out."""

    before: float  # rms
    after: float
    moved: float  # rms of the difference of the two predictions
    moved_most: float


def volume(before: Estimate, after: Estimate, names: set[str], seed: int = 0) -> Volume:
    """estimates without and with the causes, coefficients of the present model → their predictions. Causes are not predicted."""
    touches = before.model.touches
    rng = np.random.default_rng([seed, POSES])
    low, high = touches.position.min(axis=0), touches.position.max(axis=0)
    position = rng.uniform(low, high, size=(POSES, len(low)))
    position[:, touches.machine.column("S")] = 0.0
    poses = of_facets(touches.machine, touches.artefact, [touches.facet[0]] * POSES, position, np.zeros_like(position))
    nominal = kinematics.tip(poses.chain, position)
    errors = [_set_up(kinematics.tip(poses.chain, position, _acting(e, poses, names)) - nominal, nominal) for e in (before, after)]
    difference = np.linalg.norm(errors[1] - errors[0], axis=1)
    rms = [float(np.sqrt(np.mean(np.sum(e**2, axis=1)))) for e in errors]
    return Volume(rms[0], rms[1], float(np.sqrt(np.mean(difference**2))), float(difference.max()))


def _acting(e: Estimate, poses: Touches, names: set[str]) -> dict[Slot, Array]:
    found: dict[Slot, Array] = {}
    for c in e.model.coefficients:
        if c.name in names and c.slot != GAP and c.slot.stage not in ("stylus", "table"):
            found[c.slot] = found.get(c.slot, np.zeros(len(poses))) + e.value(c.name) * c.regressor(poses)
    return found


def _set_up(error: Array, point: Array) -> Array:
    """(n, 3) mm, (n, 3) mm → what is left after the best shift and turn of the workpiece."""
    n = len(point)
    lever = np.zeros((n, 3, 6))
    lever[:, :, :3] = np.eye(3)
    for i in range(3):
        lever[:, :, 3 + i] = np.cross(np.eye(3)[i], point) / 100.0
    flat = lever.reshape(-1, 6)
    return np.asarray(error - (flat @ np.linalg.lstsq(flat, error.ravel(), rcond=1e-10)[0]).reshape(n, 3))
