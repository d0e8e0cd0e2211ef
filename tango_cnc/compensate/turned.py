"""Kinematics alone: no touch without tool center point control sees them. One feature at two angles shows whether they act.

The control's own cycle finds the center of a boss or bore at an angle of a table axis and again with that axis turned. Where the
control believes the axis to be where it is, the program coordinates are the same both times. The stylus cancels, as it has not
turned with the table. What is not in the control is what both differ by:

    d = −(e(turned) − e(0)) + s · Σ v (L(turned) − L(0))

e: error of the tip by the run before; v, L: changes of the numbers and what each does to the tip; s: the share that acts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import kinematics
from ..iso230.poses import at_poses
from ..records import Array, InputError, Machine
from .fit import known, rms
from .outcome import Outcome, promises, rolled_back
from .promise import DRAWS, Figure
from .seen import NEAR, WITHIN
from .short import Short, changes
from .space import Poses

DRIFT = 0.002  # mm: what a cycle of the control and warmth between both measurements may make
HALF = np.pi


@dataclass(frozen=True)
class Turn:
    """A table axis turned from zero, and what the center of a feature then differs by, mm."""

    axis: str
    angle: float  # rad
    letters: tuple[str, ...]  # of the two coordinates across the axis
    without: Array  # (2,) mm, nothing of the compensation acts
    within: Array  # (2,) mm, all of it acts
    std: float  # mm, of either as predicted and measured

    def share(self, seen: Array) -> tuple[float, float]:
        """(2,) mm as measured → share that acts, its standard deviation."""
        way = self.within - self.without
        size = float(way @ way)
        return float((seen - self.without) @ way) / size, self.std / size**0.5


def alone(asked: Short) -> bool:
    """compensation → whether it changes nothing but what acts with tool center point control."""
    own = changes(asked.kept)
    return bool(own) and all(h.tcp for h in asked.held if h.place in own)


def turn(asked: Short, axis: str, angle: float, *, fixture: bool) -> Turn:
    """compensation of kinematics, table axis, rad, whether the control keeps its axes' directions (G54.2) → what is to be expected.

    Raises InputError for an axis that no table has or whose travel ends before that.
    """
    machine = asked.before.result.model.touches.machine
    _allowed(machine, axis, angle)
    middle = np.median(asked.poses.touches.position, axis=0)
    at = np.tile(middle, (2, 1))
    for name in machine.rotary:
        at[:, machine.column(name)] = 0.0
    chain = kinematics.chain(machine)
    point = kinematics.tip(chain, at[:1])
    at[1, machine.column(axis)] = angle
    at[1] = kinematics.inverse(chain, at[1:], point)[0]
    poses = Poses(at_poses(machine, at, np.zeros_like(at)))
    found = known(asked.before.result, poses)
    own = changes(asked.kept)
    moved = np.zeros((2, 3))
    for h in asked.held:
        if h.place in own:
            moved += h.lever(poses) * own[h.place] * h.sign / h.factor
    error = found.error(poses)
    if not asked.first_tcp:
        error = error - asked.kinematics(poses, new=False)
    levers = found.levers(poses).reshape(2, 3, -1)
    frame = np.linalg.inv(kinematics.affine(chain, at)[2][1]) if fixture else np.eye(3)
    names = [machine.names[c] for c in chain.linear_columns] if fixture else list("XYZ")
    along = np.abs(np.array(machine.axis(axis).direction))
    letters = tuple("XYZ"[i] for i in range(3) if along[i] < 0.5)
    rows = [names.index(letter) for letter in letters]
    without, way = frame @ -(error[1] - error[0]), frame @ (moved[1] - moved[0])
    spread = frame @ (levers[1] - levers[0])
    variance = np.einsum("ij,jk,ik->i", spread, found.covariance, spread)[rows].max()
    std = float(np.sqrt(variance + DRIFT**2 + 2 * machine.probe.repeatability**2))
    return Turn(axis, angle, letters, without[rows], (without + way)[rows], std)


def _allowed(machine: Machine, axis: str, angle: float) -> None:
    tables = [name for name in machine.workpiece_branch if name in machine.rotary]
    if axis not in tables:
        raise InputError(
            f"--turned: found the axis {axis!r}; allowed: a rotary axis of the table ({', '.join(tables) or 'none here'})"
        )
    low, high = machine.axis(axis).limits
    if not low - 1e-9 <= angle <= high + 1e-9 or abs(angle) < np.radians(20):
        raise InputError(f"--turned: found {np.degrees(angle):g} deg; allowed: 20 deg or more, within the travel of {axis}")


def usual(asked: Short, *, fixture: bool) -> Turn | None:
    """compensation of kinematics → the table axis and angle at which it makes the largest difference; None without a table axis."""
    machine = asked.before.result.model.touches.machine
    best: Turn | None = None
    for axis in (name for name in machine.workpiece_branch if name in machine.rotary):
        low, high = machine.axis(axis).travel or (-HALF, HALF)
        angle = min(high, HALF) if min(high, HALF) >= min(-low, HALF) else -min(-low, HALF)
        if abs(angle) >= np.radians(20):
            found = turn(asked, axis, angle, fixture=fixture)
            if best is None or _size(found) > _size(best):
                best = found
    return best


def _size(found: Turn) -> float:
    return float(np.linalg.norm(found.within - found.without)) / found.std


def judged(asked: Short, found: Turn, seen: Array) -> Outcome:
    """compensation of kinematics, what was to be expected, (2,) mm as measured → what became of the promise."""
    before, promised = promises(asked.kept.record)
    share, std = found.share(seen)
    off = float(np.linalg.norm(seen - found.without - share * (found.within - found.without))) / found.std
    measured = _left(asked, share, std)
    what = f"{100 * share:.0f} ± {200 * std:.0f} % of what was written acts, by one feature at two angles of {found.axis}"
    left = f"{measured.value:.2f} µm ({measured.low:.2f} to {measured.high:.2f}) are left of {before.value:.2f} µm"
    if off > 4:
        text = f"{what}; but across that it differs by {off:.0f} standard deviations more: something else has moved. Measure again"
        return Outcome(before, promised, measured, "undecided", text)
    if share + WITHIN * std < 0.5:
        text = (
            f"{left}: it has not helped; {what}. Load undo/, and note it: {rolled_back(asked.kept)}. Is it loaded, is a sign wrong?"
        )
        return Outcome(before, promised, measured, "no help", text)
    if abs(share - 1) > max(WITHIN * std, NEAR):
        return Outcome(before, promised, measured, "not as promised", f"{left}; {what}")
    if share > max(WITHIN * std, 0.5):
        return Outcome(before, promised, measured, "kept", f"{left}; {what}")
    text = f"{what}: that decides nothing. Measure the feature more often and state the mean, or another angle"
    return Outcome(before, promised, measured, "undecided", text)


def _left(asked: Short, share: float, std: float) -> Figure:
    """compensation, share that acts, its standard deviation → µm rms that is left over the volume."""
    at, own = asked.poses, changes(asked.kept)
    found = known(asked.before.result, at)
    moved = sum(
        (h.lever(at).ravel() * own[h.place] * h.sign / h.factor for h in asked.held if h.place in own), np.zeros(3 * len(at))
    )
    error = found.error(at).ravel()
    if not asked.first_tcp:
        error = error - asked.kinematics(at, new=False).ravel()
    free = at.free(np.column_stack([error, moved]))
    shares = share + std * np.random.default_rng(2).normal(size=DRAWS)
    left = free[:, :1] - free[:, 1:] * shares + at.free(found.levers(at)) @ found.draws(DRAWS)
    low, middle, high = np.quantile(np.sqrt(np.sum(left**2, axis=0) / len(at)) * 1e3, [0.025, 0.5, 0.975])
    return Figure(float(middle), min(float(low), rms(free[:, 0] - free[:, 1])), float(high))


def of_text(text: str) -> tuple[str, float, dict[str, float]]:
    """'C=180:X=0.0012,Y=-0.003' → axis, rad, mm by coordinate. Raises InputError for anything else."""
    axis, _, rest = text.partition("=")
    angle, _, values = rest.partition(":")
    try:
        numbers = {k.strip(): float(v) for k, v in (part.split("=") for part in values.split(","))}
        turned = float(np.radians(float(angle)))
    except ValueError:
        numbers, turned = {}, np.nan
    if not numbers or not np.isfinite([turned, *numbers.values()]).all():
        raise InputError(
            f"--turned: found {text!r}; allowed: AXIS=DEG:X=MM,Y=MM, the second minus the first, such as C=180:X=0.0012,Y=-0.003"
        )
    return axis.strip(), turned, numbers
