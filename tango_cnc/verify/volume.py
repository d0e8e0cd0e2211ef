"""How far the tool tip is from where it should be, relative to the table, over the working volume (ISO 230-1:2012, 3.7).

The table frame and the tool length are set up on the machine itself, so a rigid displacement of the workpiece and a
longer tool are no error of the machine: what the best set-up takes out (six numbers and one) is taken out of the errors
and of their uncertainty alike. Which of several equivalent names the model uses then makes no difference.

A polynomial says nothing about where nobody has touched. Every pose is marked: inside the convex hull of the touched axis
positions, or not, and which axes lie outside the range that was touched.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from .. import kinematics
from ..estimate import Estimate
from ..iso230.poses import all_steady, at_poses, is_setup
from ..kinematics import Errors
from ..model import Model, errors
from ..records import Array, InputError, Machine, TangoError
from ..terms import Coefficient
from ..touches import Touches

LEVELS = {3: 9, 4: 7, 5: 5}  # grid points an axis, by number of axes: at most some thousands of poses
HULL = 1e-5  # of an axis' probed range: nearer to the hull than this is inside it
LARGEST = 40_000  # poses


@dataclass(frozen=True)
class VolumeMap:
    """n poses of the grid; vectors in the table frame, mm, after the best set-up of workpiece and tool length."""

    axes: tuple[str, ...]
    position: Array  # (n, k) mm rad
    point: Array  # (n, 3) mm, nominal tip in the table frame
    error: Array  # (n, 3) mm, actual minus nominal tip, mean of both directions of motion
    std: Array  # (n,) mm, standard deviation of the error in its most uncertain direction
    reversal: Array  # (n,) mm, what backlash adds at the worst combination of last motions
    outside: NDArray[np.bool_]  # (n, k) axis position outside the range that was touched
    extrapolated: NDArray[np.bool_]  # (n,) outside the convex hull of the touched axis positions

    @property
    def size(self) -> Array:
        """→ (n,) mm, length of the error vector."""
        return np.asarray(np.linalg.norm(self.error, axis=1))

    def worst(self, rows: NDArray[np.bool_]) -> int | None:
        """(n,) mask → row with the longest error vector among them, None when there are none."""
        index = np.flatnonzero(rows)
        return int(index[np.argmax(self.size[index])]) if len(index) else None


def grid(machine: Machine, touches: Touches, levels: int | None = None, over: str = "travel") -> Array:
    """machine, touches, points an axis, `travel` or `probed` → (n, k) mm rad; the spindle stays at 0.

    `travel`: each axis' travel, one turn of a rotary axis that has more or is endless. `probed`: the range that was touched.
    Raises InputError for an axis without a travel or a grid that is too large.
    """
    names = (*machine.linear, *machine.rotary)
    count = levels or LEVELS.get(len(names), 3)
    if count < 2 or count ** len(names) > LARGEST:
        raise InputError(
            f"--levels: found {count}; allowed: 2 to {int(LARGEST ** (1 / len(names)))} points on each of {len(names)} axes"
        )
    lines = []
    for name in names:
        travel = machine.axis(name).travel
        if over == "probed":
            low, high = float(touches.axis(name).min()), float(touches.axis(name).max())
        elif travel is None and name in machine.rotary:
            low, high = -np.pi, np.pi
        elif travel is None:
            raise InputError(f"machine: axis {name} has no travel; give it one, or use the touched range (--over probed)")
        else:
            low, high = travel
        if name in machine.rotary and high - low > 2 * np.pi:
            middle = 0.0 if low <= -np.pi and high >= np.pi else (low + high) / 2
            low, high = middle - np.pi, middle + np.pi
        lines.append(np.linspace(low, high, count))
    position = np.zeros((count ** len(names), len(machine.names)))
    mesh = np.meshgrid(*lines, indexing="ij")
    for name, values in zip(names, mesh, strict=True):
        position[:, machine.column(name)] = values.ravel()
    return position


def volume(result: Estimate, position: Array) -> VolumeMap:
    """estimate, poses (n, k) mm rad → errors of the machine there, their uncertainty, and what is extrapolated.

    Raises TangoError when the estimate contains no error of the machine: a map of zeros would look like a perfect one.
    """
    touches = result.model.touches
    if not any(c.slot.axis and not is_setup(c.slot) for c in result.model.coefficients):
        raise TangoError(result.selection.without_machine("volume", "its tool tip cannot be predicted"))
    poses = at_poses(touches.machine, position, np.zeros_like(position))
    nominal = kinematics.tip(poses.chain, position)
    outside, extrapolated = probed(touches, position)
    own, _ = all_steady(result.model.coefficients, poses)
    coefficients, values = [result.model.coefficients[i] for i in own], result.values[own]
    acting = errors(Model(poses, tuple(coefficients)), values)
    levers, reversal = _levers(coefficients, values, poses, acting)
    error = (kinematics.tip(poses.chain, position, acting) - nominal)[:, :, None]
    both = set_up(np.concatenate([error, levers], axis=2), setup_lever(poses, nominal), _trusted(extrapolated))
    spread = both[:, :, 1:] @ result.covariance[np.ix_(own, own)] @ np.swapaxes(both[:, :, 1:], 1, 2)
    std = np.sqrt(np.clip(np.linalg.eigvalsh(spread)[:, -1], 0.0, None))
    return VolumeMap(touches.machine.names, position, nominal, both[:, :, 0], std, reversal, outside, extrapolated)


def of_tips(chart: VolumeMap, tip: Array, touches: Touches) -> Array:
    """map, tips (n, 3) mm of another machine at the same poses → its errors (n, 3) mm after its own best set-up."""
    poses = at_poses(touches.machine, chart.position, np.zeros_like(chart.position))
    return set_up((tip - chart.point)[:, :, None], setup_lever(poses, chart.point), _trusted(chart.extrapolated))[:, :, 0]


def _trusted(extrapolated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """→ (n,) poses that the set-up is fitted to: the touched region, or all where hardly a pose lies in it."""
    inside = ~extrapolated
    return inside if inside.sum() >= 10 else np.ones_like(inside)


def setup_lever(poses: Touches, point: Array) -> Array:
    """poses, nominal tips (n, 3) → (n, 3, 7): what moving and turning the workpiece and a longer tool do to the tip."""
    n = len(point)
    lever = np.zeros((n, 3, 7))
    lever[:, :, :3] = np.eye(3)
    for i in range(3):
        lever[:, :, 3 + i] = np.cross(np.eye(3)[i], point) / 100.0
    lever[:, :, 6] = kinematics.spindle_axis(poses.chain, poses.position)
    return lever


def set_up(vectors: Array, lever: Array, trusted: NDArray[np.bool_]) -> Array:
    """(n, 3, m) mm, (n, 3, 7), (n,) mask → (n, 3, m) mm, each less the set-up that fits its trusted poses best."""
    m = vectors.shape[2]
    fit = np.linalg.lstsq(lever[trusted].reshape(-1, 7), vectors[trusted].reshape(-1, m), rcond=1e-10)[0]
    return np.asarray(vectors - lever @ fit)


def _levers(coefficients: Sequence[Coefficient], values: Array, poses: Touches, acting: Errors) -> tuple[Array, Array]:
    """→ (n, 3, p) derivative of the tip by each coefficient, (n,) mm worst sum of all that depends on the last motions."""
    moving = at_poses(poses.machine, poses.position, np.ones_like(poses.position))
    still = [c.regressor(poses) for c in coefficients]
    change = [c.regressor(moving) - s for c, s in zip(coefficients, still, strict=True)]
    run = kinematics.trace(poses.chain, poses.position, acting)
    levers = np.zeros((len(poses), 3, len(coefficients)))
    jumps = np.zeros((len(poses), 3, len(coefficients)))
    for i in range(3):
        slots = kinematics.sensitivity(poses.chain, run, np.tile(np.eye(3)[i], (len(poses), 1))).slots
        for j, c in enumerate(coefficients):
            levers[:, i, j] = slots[c.slot] * still[j]
            jumps[:, i, j] = slots[c.slot] * change[j] * values[j]
    moved = np.flatnonzero(np.any(jumps != 0, axis=(0, 1)))
    signs = itertools.product((-1.0, 1.0), repeat=len(moved))
    worst = np.max([np.linalg.norm(jumps[:, :, moved] @ np.array(sign), axis=1) for sign in signs], axis=0)
    return levers, worst


def probed(touches: Touches, position: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """touches made, poses (n, k) → (n, k) axis outside its touched range, (n,) outside the convex hull of what was touched.

    A pose is inside when it is a mean, with weights, of touched poses (non-negative least squares). Full turns of a rotary
    axis are not unfolded: a polynomial of the angle knows nothing of them.
    """
    machine = touches.machine
    names = (*machine.linear, *machine.rotary)
    columns = [machine.column(name) for name in names]
    seen = np.unique(np.round(touches.position[:, columns], 6), axis=0)
    low, high = seen.min(axis=0), seen.max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    at = (position[:, columns] - low) / width
    outside = np.zeros(position.shape, dtype=np.bool_)
    outside[:, columns] = (at < -HULL) | (at > (high - low) / width + HULL)
    extrapolated = np.asarray(outside.any(axis=1), dtype=np.bool_)
    matrix = np.vstack([((seen - low) / width).T, np.ones(len(seen))])
    touched = {tuple(row) for row in seen.tolist()}  # a touched pose is inside: that needs no search
    inner = [tuple(row) not in touched for row in np.round(position[:, columns], 6).tolist()]
    for i in np.flatnonzero(~extrapolated & np.array(inner, dtype=bool)):
        _, distance = optimize.nnls(matrix, np.append(at[i], 1.0))
        extrapolated[i] = distance > HULL
    return outside, extrapolated
