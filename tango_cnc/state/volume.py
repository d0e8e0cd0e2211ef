"""Unknowns → errors of the tool tip over the working volume, after the best set-up of workpiece and tool length."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import kinematics
from ..estimate import Estimate
from ..iso230.poses import at_poses, is_setup
from ..model import Model
from ..records import Array
from ..verify.volume import grid, set_up, setup_lever
from .frame import Frame

LEVELS = 3  # points an axis


class Volume(NamedTuple):
    """Errors over the volume, mm: at the worst pose, root mean square, and the standard deviation of one direction of one pose."""

    worst: float
    rms: float
    std: float


class Aim(NamedTuple):
    """The variance of the tool tip, a mean over directions and poses, is sum(matrix * covariance of the unknowns)."""

    matrix: Array  # (p, p)
    root: Array  # (p, q): matrix = root rootᵀ


def aim(lever: Array) -> Aim:
    """(m, 3, p) of `levers` → what a night has to know."""
    flat = lever.reshape(-1, lever.shape[2])
    matrix = flat.T @ flat / max(len(flat), 1)
    own = np.flatnonzero(np.diag(matrix) > 0)  # the unknowns that the volume depends on
    size, turned = np.linalg.eigh(matrix[np.ix_(own, own)])
    root = np.zeros((len(matrix), len(own)))
    root[own] = turned * np.sqrt(np.maximum(size, 0.0))
    return Aim(matrix, root)


def levers(followed: Frame, over: str = "probed") -> Array:
    """frame, `travel` or `probed` → (m, 3, p) mm by unknown: the tip relative to the table at m poses."""
    return _levers(followed.model, followed.machine.tolist(), len(followed.names), over)


def of_estimate(result: Estimate) -> Volume | None:
    """estimate → the same number as that of a night: errors over every corner of the touched ranges; None where it has none."""
    lever = levers_of(result)
    return over_volume(lever, result.values, result.covariance) if lever.any() else None


def levers_of(result: Estimate) -> Array:
    """estimate → (m, 3, p) mm by unknown: the tip at every corner of the touched ranges; 0 for all but errors of the machine."""
    model = result.model
    own = [i for i, c in enumerate(model.coefficients) if c.slot.axis and not is_setup(c.slot)]
    return _levers(model, own, len(result.values), "probed")


def _levers(model: Model, own: Sequence[int], count: int, over: str) -> Array:
    """model, places of the errors of the machine, unknowns, `travel` or `probed` → (m, 3, count) mm by unknown."""
    machine = model.touches.machine
    position = grid(machine, model.touches, LEVELS, over)
    poses = at_poses(machine, position, np.zeros_like(position))
    run = kinematics.trace(poses.chain, position, {})
    found = np.zeros((len(position), 3, count))
    regressors = [model.coefficients[i].regressor(poses) for i in own]
    for axis in range(3):
        slots = kinematics.sensitivity(poses.chain, run, np.tile(np.eye(3)[axis], (len(poses), 1))).slots
        for i, regressor in zip(own, regressors, strict=True):
            found[:, axis, i] = slots[model.coefficients[i].slot] * regressor
    tip = kinematics.tip(poses.chain, position)
    return set_up(found, setup_lever(poses, tip), np.ones(len(position), dtype=np.bool_))


def over_volume(lever: Array, mean: Array, covariance: Array) -> Volume:
    """(m, 3, p) of `levers`, (p,) unknowns, (p, p) covariance → errors over the volume."""
    error = lever @ mean
    size = np.linalg.norm(error, axis=1)
    flat = lever.reshape(-1, lever.shape[2])
    own = np.flatnonzero(np.any(flat != 0, axis=0))
    variance = np.sum((flat[:, own] @ covariance[np.ix_(own, own)]) * flat[:, own], axis=1)
    return Volume(float(size.max()), float(np.sqrt(np.mean(size**2))), float(np.sqrt(np.mean(variance))))
