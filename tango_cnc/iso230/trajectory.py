"""One axis moved alone: how the tool moves and turns relative to the workpiece, linear in the coefficients.

The functional point is the centre of the stylus tip, or the tip of a tool of the stated length, at the reference pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import kinematics
from ..kinematics import Slot
from ..records import Array, Axis, Machine
from ..terms import Coefficient
from ..texts import say
from .poses import all_steady, at_poses

POINTS = 61
ARM = 100.0  # mm, of the points whose ways show the turn of the tool


@dataclass(frozen=True)
class Reference:
    """Where the other axes stand, mm and rad, and the length of the tool, mm."""

    pose: Mapping[str, float]
    length: float
    point: tuple[float, float, float]  # mm, functional point in the table frame

    @property
    def text(self) -> str:
        """→ for people: pose in mm and degrees, tool length and functional point."""
        turned = {n: v if n in "XYZ" else np.degrees(v) for n, v in self.pose.items()}
        pose = ", ".join(f"{n} {v + 0.0:.4g}{'' if n in 'XYZ' else '°'}" for n, v in turned.items())
        at = ", ".join(f"{v + 0.0:.4g}" for v in self.point)
        return say("iso_said.onpart.reference", pose=pose, length=f"{self.length:g}", point=at)


def reference(machine: Machine, over: Mapping[str, tuple[float, float]], length: float | None = None) -> Reference:
    """machine, ranges (mm, rad), tool length (mm; default: the probe) → where the other axes stand."""
    pose = {}
    for name in (*machine.linear, *machine.rotary):
        low, high = over.get(name, (0.0, 0.0))
        pose[name] = 0.0 if name in machine.rotary and low <= 0 <= high else (low + high) / 2
    tool = replace(machine, probe=replace(machine.probe, length=length or machine.probe.length))
    position = np.array([[pose.get(name, 0.0) for name in machine.names]])
    tip = kinematics.tip(kinematics.chain(tool), position)[0]
    return Reference(pose, tool.probe.length, (float(tip[0]), float(tip[1]), float(tip[2])))


@dataclass(frozen=True)
class Trajectory:
    """The tool relative to the workpiece while one axis moves, in the machine frame of the reference pose."""

    axis: Axis
    command: Array  # (m,)
    way: Array  # (3,) unit vector: where the tool goes on the part for a positive command; a rotary axis: zero
    shift: Array  # (m, 3, p) mm
    turn: Array  # (m, 3, p) rad
    reversal: Array  # (3, p) mm, what the last motion adds


def trajectory(
    machine: Machine, axis: Axis, coefficients: Sequence[Coefficient], low: float, high: float, at: Reference
) -> Trajectory:
    """machine, linear axis, coefficients, range (mm), reference → its trajectory."""
    command = np.linspace(low, high, POINTS)
    position = np.tile([at.pose.get(name, 0.0) for name in machine.names], (POINTS, 1))
    position[:, machine.column(axis.name)] = command
    seen = relative(machine, coefficients, position, at.length)
    way = (seen.nominal[-1] - seen.nominal[0]) / np.linalg.norm(seen.nominal[-1] - seen.nominal[0])
    own = np.array([c.slot.axis == axis.name for c in coefficients])
    return Trajectory(axis, command, way, seen.shift, seen.turn, seen.jump[POINTS // 2] * own)


@dataclass(frozen=True)
class Relative:
    """n poses: the tool relative to the workpiece, as seen along the axes of the table frame."""

    nominal: Array  # (n, 3) mm
    shift: Array  # (n, 3, p) mm
    turn: Array  # (n, 3, p) rad
    jump: Array  # (n, 3, p) mm, what last motions in the positive direction add


def relative(machine: Machine, coefficients: Sequence[Coefficient], position: Array, length: float) -> Relative:
    """machine, coefficients (p), poses (n, k) mm rad, tool length (mm) → tool relative to workpiece, linear in the coefficients."""
    tool = replace(machine, probe=replace(machine.probe, length=length))
    still, forward = at_poses(tool, position, np.zeros_like(position)), at_poses(tool, position, np.ones_like(position))
    n, p = len(position), len(coefficients)
    shift, turn, moves = np.zeros((n, 3, p)), np.zeros((n, 3, p)), np.zeros((n, 3, p))
    nominal = kinematics.tip(still.chain, position)
    use, value = all_steady(coefficients, still)
    if not use:
        return Relative(nominal, shift, turn, moves)
    jump = np.array([coefficients[j].regressor(forward) for j in use]) - value
    offset = np.vstack([np.zeros(3), ARM * np.eye(3)])[:, :, None]  # of the tip and of the ends of three spokes around it
    run = kinematics.trace(still.chain, position, {Slot("t", "stylus", i): offset[:, i] for i in range(3)})
    ways = np.broadcast_to(np.eye(3)[:, None, None], (3, 1, n, 3))
    lever = kinematics.sensitivity(still.chain, run, ways).slots
    slots = list(dict.fromkeys(coefficients[j].slot for j in use))  # many coefficients act in one slot
    of = np.array([slots.index(coefficients[j].slot) for j in use])
    # (4, n, 3, slots): where each of the four points goes
    moved = np.stack([np.broadcast_to(lever[slot], (3, 4, n)) for slot in slots], axis=-1).transpose(1, 2, 0, 3)
    spokes = (run.tip[1:] - run.tip[0]) / ARM  # three unit vectors at right angles
    around = np.cross(spokes[..., None], (moved[1:] - moved[0]) / ARM, axis=2).sum(axis=0) / 2
    ahead = moved[0][..., of]
    shift[:, :, use] = ahead * value.T[:, None, :]
    turn[:, :, use] = around[..., of] * value.T[:, None, :]
    moves[:, :, use] = ahead * jump.T[:, None, :]
    return Relative(nominal, shift, turn, moves)
