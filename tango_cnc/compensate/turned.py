"""Kinematics alone: no touch without tool center point control sees them. One feature at two angles shows whether they act.

The control's own cycle finds the center of a boss or bore at an angle of a table axis and again with that axis turned. Where the
control believes the axis to be where it is, the program coordinates are the same both times. The stylus cancels, as it has not
turned with the table. What is not in the control is what both differ by:

    d = −(e(turned) − e(0)) + s · Σ v (L(turned) − L(0))

e: error of the tip by the run before; v, L: changes of the numbers and what each does to the tip; s: the share that acts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import kinematics
from ..iso230.poses import at_poses
from ..loaded import AS_SEEN
from ..records import Array, InputError, Machine
from .fit import known, rms
from .frame import of_control
from .outcome import HELPED, Outcome, listed, no_help, promises, rolled_back
from .promise import DRAWS, Figure
from .seen import NEAR, WITHIN
from .short import Short, changes
from .space import Poses

NEARBY = 50.0  # mm along the axis by which the feature may be elsewhere
SHOWS = 0.5  # of what a number takes away over the volume: one that a turn shows less of is not seen by it
MOST = 1.0  # mm: two centers that differ by more are not the same feature, or not in mm
TURNED = np.radians(20)  # rad at least, from whole turns
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
    blind: tuple[str, ...] = ()  # numbers that change, and hardly show by this turn

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
    chain = kinematics.chain(machine)
    place = feature(asked)
    away = place + NEARBY * np.array(machine.axis(axis).direction)  # the feature may be as much higher or lower
    at = _poses_of(machine, chain, (place, place, away, away), axis, (0.0, angle, 0.0, angle))
    poses = Poses(at_poses(machine, at, np.zeros_like(at)))
    found = known(asked.before.result, poses)
    each = _each(asked, poses)
    moved = np.sum(list(each.values()), axis=0)
    error = found.error(poses)
    if not asked.first_tcp:
        error = error - asked.kinematics(poses, new=False)
    levers = found.levers(poses).reshape(4, 3, -1)
    own = of_control(machine)  # what a person reads is along the axes of the control
    frame = np.linalg.inv(kinematics.affine(chain, at)[2][1]) if fixture else own
    names = [machine.names[c] for c in chain.linear_columns] if fixture else list("XYZ")
    along = np.abs(own @ np.array(machine.axis(axis).direction))
    letters = tuple("XYZ"[i] for i in range(3) if along[i] < 0.5)
    rows = [names.index(letter) for letter in letters]
    without, way = frame @ -(error[1] - error[0]), frame @ (moved[1] - moved[0])
    spread = frame @ (levers[1] - levers[0])
    variance = np.einsum("ij,jk,ik->i", spread, found.covariance, spread)[rows].max()
    elsewhere = (frame @ (moved[3] - moved[2] - error[3] + error[2]))[rows] - (without + way)[rows]
    std = float(np.sqrt(variance + DRIFT**2 + 2 * machine.probe.repeatability**2 + np.max(elsewhere**2)))
    turned = {name: float(np.linalg.norm((frame @ (m[1] - m[0]))[rows])) for name, m in each.items()}
    whole = {name: rms(asked.poses.free(m.reshape(-1, 1))[:, 0]) / 1e3 for name, m in _each(asked, asked.poses).items()}
    blind = tuple(name for name, size in turned.items() if size < SHOWS * whole[name])
    return Turn(axis, angle, letters, without[rows], (without + way)[rows], std, blind)


def feature(asked: Short) -> Array:
    """compensation of kinematics → (3,) mm in the table, where the feature is taken to be: in the middle of what was touched."""
    return np.asarray(np.median(asked.before.result.model.touches.point, axis=0))


def _poses_of(machine: Machine, chain: kinematics.Chain, points: Sequence[Array], axis: str, angles: Sequence[float]) -> Array:
    """machine, its chain, (3,) mm in the table, table axis, rad → (n, axes) where the tip stands at each."""
    at = np.zeros((len(points), len(machine.names)))
    at[:, machine.column(axis)] = angles
    return np.vstack([kinematics.inverse(chain, at[i : i + 1], point[None]) for i, point in enumerate(points)])


def _each(asked: Short, poses: Poses) -> dict[str, Array]:
    """compensation of kinematics, poses → {number that changes: (n, 3) mm of tip error that it takes away}."""
    own = changes(asked.kept)
    return {h.place: h.lever(poses) * own[h.place] * h.sign / h.factor for h in asked.held if h.place in own}


def _allowed(machine: Machine, axis: str, angle: float) -> None:
    tables = [name for name in machine.workpiece_branch if name in machine.rotary]
    if axis not in tables:
        raise InputError(
            f"--turned: found the axis {axis!r}; allowed: a rotary axis of the table ({', '.join(tables) or 'none here'})"
        )
    low, high = machine.axis(axis).limits
    if not low - 1e-9 <= angle <= high + 1e-9 or abs((angle + HALF) % (2 * HALF) - HALF) < TURNED:
        raise InputError(
            f"--turned: found {np.degrees(angle):g} deg; allowed: 20 deg or more from whole turns, within the travel of {axis}"
        )


def usual(asked: Short, *, fixture: bool) -> Turn | None:
    """compensation of kinematics → the table axis and angle at which it makes the largest difference; None without a table axis."""
    machine = asked.before.result.model.touches.machine
    best: Turn | None = None
    for axis in (name for name in machine.workpiece_branch if name in machine.rotary):
        low, high = machine.axis(axis).travel or (-HALF, HALF)
        angle = min(high, HALF) if min(high, HALF) >= min(-low, HALF) else -min(-low, HALF)
        if abs(angle) >= TURNED:
            found = turn(asked, axis, angle, fixture=fixture)
            if best is None or _size(found) > _size(best):
                best = found
    return best


def _size(found: Turn) -> float:
    return float(np.linalg.norm(found.within - found.without)) / found.std


def judged(asked: Short, found: Turn, seen: Array) -> Outcome:
    """compensation of kinematics, what was to be expected, (2,) mm as measured → what became of the promise."""
    before, promised = promises(asked.kept.record)
    if np.abs(seen).max() > MOST + 2 * max(np.abs(found.within).max(), np.abs(found.without).max()):
        raise InputError(
            f"--turned: found {np.abs(seen).max():g} mm; allowed: mm by which both centers differ, at most about {MOST:g}"
        )
    share, std = found.share(seen)
    off = float(np.linalg.norm(seen - found.without - share * (found.within - found.without))) / found.std
    measured, none, part = _left(asked, share, std, found.blind)
    what = f"{100 * share:.0f} ± {200 * std:.0f} % of what was written acts, by one feature at two angles of {found.axis}"
    left = f"{measured.value:.2f} µm ({measured.low:.2f} to {measured.high:.2f}) are left of {before.value:.2f} µm"
    if off > 4:
        text = f"{what}; but across that it differs by {off:.0f} standard deviations more: something else has moved. Measure again"
        return Outcome(before, promised, measured, "undecided", text)
    if share + WITHIN * std < 0.5:
        text = (
            f"{no_help(before, promised, measured)}; {what}. Load undo/, and note it: {rolled_back(asked.kept)}. Is it "
            "loaded, is a sign wrong?"
        )
        return Outcome(before, promised, measured, "no help", text)
    if abs(share - 1) > max(WITHIN * std, NEAR):
        return Outcome(before, promised, measured, "not as promised", f"{left}; {what}")
    if share > max(WITHIN * std, 0.5) and part > HELPED:
        text = (
            f"{what}. A turn of {found.axis} shows nothing of {listed(found.blind)}, which take away most of it: turn "
            "another axis of the table, or run a probing program with tool center point control on, and state --tcp"
        )
        return Outcome(before, promised, measured, "undecided", text)
    if share > max(WITHIN * std, 0.5) and found.blind:
        return Outcome(before, promised, measured, AS_SEEN, f"{left}; {what}", found.blind, none)
    if share > max(WITHIN * std, 0.5):
        return Outcome(before, promised, measured, "kept", f"{left}; {what}")
    text = f"{what}: that decides nothing. Measure the feature more often and state the mean, or another angle"
    return Outcome(before, promised, measured, "undecided", text)


def _left(asked: Short, share: float, std: float, blind: Sequence[str]) -> tuple[Figure, float, float]:
    """compensation, share that acts, its standard deviation, numbers that were not seen → µm rms that is left over the volume,
    µm if none of those acts, how much of all they take away.

    Of what was not seen any share may act.
    """
    at = asked.poses
    found = known(asked.before.result, at)
    each = _each(asked, at)
    hidden = sum((m.ravel() for name, m in each.items() if name in blind), np.zeros(3 * len(at)))
    moved = sum((m.ravel() for name, m in each.items() if name not in blind), np.zeros(3 * len(at)))
    error = found.error(at).ravel()
    if not asked.first_tcp:
        error = error - asked.kinematics(at, new=False).ravel()
    free = at.free(np.column_stack([error, moved, hidden]))
    rng = np.random.default_rng(2)
    shares, unknown = share + std * rng.normal(size=DRAWS), rng.uniform(size=DRAWS)
    left = free[:, :1] - free[:, 1:2] * shares - free[:, 2:] * unknown + at.free(found.levers(at)) @ found.draws(DRAWS)
    low, middle, high = np.quantile(np.sqrt(np.sum(left**2, axis=0) / len(at)) * 1e3, [0.025, 0.5, 0.975])
    figure = Figure(float(middle), min(float(low), rms(free[:, 0] - free[:, 1] - free[:, 2])), float(high))
    part = rms(free[:, 2]) / max(rms(free[:, 1] + free[:, 2]), 1e-12)
    return figure, rms(free[:, 0] - free[:, 1]), part


def of_text(text: str) -> tuple[str, float, dict[str, float]]:
    """'C=180:X=0.0012,Y=-0.003' → axis, rad, mm by coordinate. Raises InputError for anything else."""
    axis, _, rest = text.partition("=")
    angle, _, values = rest.partition(":")
    try:
        pairs = [(k.strip(), float(v)) for k, v in (part.split("=") for part in values.split(","))]
        numbers = dict(pairs) if len(dict(pairs)) == len(pairs) else {}
        turned = float(np.radians(float(angle)))
    except ValueError:
        numbers, turned = {}, np.nan
    if not numbers or not np.isfinite([turned, *numbers.values()]).all():
        raise InputError(
            f"--turned: found {text!r}; allowed: AXIS=DEG:X=MM,Y=MM, the second minus the first, such as C=180:X=0.0012,Y=-0.003"
        )
    return axis.strip(), turned, numbers
