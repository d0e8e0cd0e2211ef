"""The true machine: axis positions → where the stylus tip really is, by multiplying out every transform of the chain.

Slow and literal on purpose. It judges the estimator, so it shares no mathematics with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tango_cnc.nearest import suggestion
from tango_cnc.records import Array, InputError, Machine, World

from . import transforms
from .coefficients import RADIUS, STYLUS, Coefficient, coefficient

Term = tuple[Coefficient, Array | float]
Control = Callable[[Array, Array], Array]  # (n, k) programmed, (n, k) directions → (n, k) where the motors go
BASE = {"X": 0, "A": 0, "Y": 1, "B": 1, "Z": 2, "C": 2, "S": 2}


@dataclass(frozen=True)
class Joint:
    """One axis: column of its command, frame at the zero pose, sense of its motion and what is wrong with it."""

    name: str
    column: int
    rotary: bool
    base: int  # 0 1 2: its motion is along or about this vector of its frame
    sense: int
    location: Array  # (1, 4, 4) this frame → frame of the axis before, at the zero pose
    frame: Array  # (1, 4, 4) this frame → machine frame, at the zero pose

    @property
    def own(self) -> int:
        """→ component (0–5) that is its positioning error E_kk."""
        return self.base + 3 * self.rotary


@dataclass(frozen=True)
class Placement:
    """Where the tip is: (n, 3) mm in the table frame, and the (n, 3, 3) turns of table and spindle frame into the machine frame."""

    tip: Array
    table: Array
    spindle: Array


@dataclass(frozen=True)
class TrueMachine:
    """A machine and all its errors, names checked; made by `true_machine`."""

    machine: Machine
    workpiece: tuple[Joint, ...]  # from the foundation outwards
    tool: tuple[Joint, ...]
    errors: tuple[tuple[Coefficient, float], ...]
    stylus: Array  # (3,) mm, in the spindle frame
    stylus_tip: Array  # (3,) mm, nominal tip at the zero pose, machine frame
    control: Control | None = None  # what is compensated in the control; None: nothing

    @cached_property
    def by_axis(self) -> Mapping[str, tuple[Term, ...]]:
        """→ the errors of each axis."""
        return {joint.name: tuple(e for e in self.errors if e[0].axis == joint.name) for joint in (*self.workpiece, *self.tool)}

    @cached_property
    def to_table(self) -> Array | None:
        """→ (1, 4, 4) machine frame → frame of the last axis under the table, at the zero pose; None without such an axis."""
        return transforms.inverse(self.workpiece[-1].frame) if self.workpiece else None

    @cached_property
    def stylus_tip_out(self) -> Array:
        """→ (3,) tip at the zero pose, machine frame, with the stylus as it is."""
        return np.asarray((self.tool[-1].frame[0] @ self.tip_in_spindle)[:3])

    @cached_property
    def tip_in_spindle(self) -> Array:
        """→ (4,) tip in the frame of the spindle, with the stylus as it is."""
        nominal: Array = transforms.inverse(self.tool[-1].frame)[0] @ np.append(self.stylus_tip, 1.0)
        return nominal + np.append(self.stylus, 0.0)


def true_machine(machine: Machine, world: World, control: Control | None = None) -> TrueMachine:
    """machine, world → the true machine. Raises InputError for a coefficient or stylus offset that does not exist."""
    errors = tuple((coefficient(name, machine), value) for name, value in world.errors.items())
    named = {f"{name}{number}" for name in (*STYLUS, RADIUS) for number in range(2, len(machine.styli) + 1)}
    for name in world.stylus:
        if name not in named and name not in STYLUS:
            known = (*STYLUS, *sorted(named))
            raise InputError(f"stylus: found {name!r}; allowed: {', '.join(known)}.{suggestion(name, known)}")
    spindle = machine.spindle
    tip = np.array(spindle.point) - machine.probe.length * np.array(spindle.direction)
    return TrueMachine(
        machine,
        _joints(machine, machine.workpiece_branch),
        _joints(machine, machine.tool_branch),
        errors,
        np.array([of_stylus(machine, world, name) for name in STYLUS]),
        tip,
        control,
    )


def of_stylus(machine: Machine, world: World, name: str) -> float:
    """machine, world, `EXt` … or `ERt` → mm, of the stylus that is in the spindle: `EXt2` in the world is of the second."""
    return world.stylus.get(name if machine.stylus == 1 else f"{name}{machine.stylus}", 0.0)


def nominal_machine(machine: Machine) -> TrueMachine:
    """machine → the same without any error."""
    return true_machine(machine, World())


def _joints(machine: Machine, names: Iterable[str]) -> tuple[Joint, ...]:
    joints: list[Joint] = []
    for name in names:
        axis = machine.axis(name)
        columns, sense = transforms.axis_frame(BASE[name], axis.direction)
        frame = transforms.frame(columns, axis.point)
        location = transforms.inverse(joints[-1].frame) @ frame if joints else frame
        joints.append(Joint(name, machine.column(name), axis.kind != "linear", BASE[name], sense, location, frame))
    return tuple(joints)


def tip_in_table(true: TrueMachine, positions: Array, directions: Array, extra: Mapping[str, Array] | None = None) -> Array:
    """(n, k) mm rad, (n, k) −1 0 1 → (n, 3) mm true stylus tip in the table frame; columns as in `Machine.names`.

    `extra` adds (n,) or scalar values to coefficients. Raises InputError for a coefficient that does not exist.
    """
    return place(true, positions, directions, extra).tip


def place(true: TrueMachine, positions: Array, directions: Array, extra: Mapping[str, Array] | None = None) -> Placement:
    """(n, k) mm rad, (n, k) −1 0 1 → tip and table. Raises InputError as `tip_in_table` (thesis eq. 4-4 … 4-7, 6-2)."""
    if true.control is not None:
        positions = true.control(positions, directions)
    errors = true.by_axis
    if extra:
        more = [(coefficient(name, true.machine), value) for name, value in extra.items()]
        errors = {name: (*own, *(e for e in more if e[0].axis == name)) for name, own in errors.items()}
    table = _branch(true.workpiece, positions, directions, errors)
    spindle = _branch(true.tool, positions, directions, errors)
    if true.to_table is not None:
        table = table @ true.to_table
    tip = spindle @ true.tip_in_spindle
    in_table = np.einsum("nij,nj->ni", transforms.inverse(table), tip)
    return Placement(in_table[:, :3], table[:, :3, :3], spindle[:, :3, :3])


def body(true: TrueMachine, moved_by: tuple[str, ...], positions: Array, directions: Array) -> Array:
    """axes from the foundation outwards, (n, k) mm rad, (n, k) → (n, 4, 4) where what they move goes from the zero pose."""
    if not moved_by:
        return transforms.translation(np.zeros((len(positions), 3)))
    if true.control is not None:
        positions = true.control(positions, directions)
    joints = [joint for joint in (*true.workpiece, *true.tool) if joint.name in moved_by]
    return _branch(joints, positions, directions, true.by_axis) @ transforms.inverse(joints[-1].frame)


def _branch(joints: Iterable[Joint], positions: Array, directions: Array, errors: Mapping[str, Iterable[Term]]) -> Array:
    """joints from the foundation outwards → (n, 4, 4) frame of the last one → machine frame."""
    pose: Array | None = None
    for joint in joints:
        command, last = positions[:, joint.column], directions[:, joint.column]
        own = errors[joint.name]
        pose = joint.location if pose is None else pose @ joint.location
        if not own:
            perfect = joint.sense * command
            pose = pose @ (transforms.rotation(joint.base, perfect) if joint.rotary else transforms.shift(joint.base, perfect))
            continue
        still = all(isinstance(value, float) for c, value in own if c.kind == "inter")  # an axis mostly stands where it stands
        inter, intra = np.zeros((1 if still else len(positions), 6)), np.zeros((len(positions), 6))
        for c, value in own:
            if c.kind == "inter":
                inter[:, c.component] += value
            elif c.kind == "backlash":
                intra[:, c.component] += value * last
            else:
                intra[:, c.component] += value * command**c.degree
        # E_kk is measured in command units: it goes into the motion, not after it
        moved = joint.sense * (command + intra[:, joint.own])
        intra[:, joint.own] = 0.0
        motion = transforms.rotation(joint.base, moved) if joint.rotary else transforms.shift(joint.base, moved)
        pose = (pose @ transforms.error(inter) if inter.any() else pose) @ motion
        pose = pose @ transforms.error(intra) if intra.any() else pose
    return transforms.translation(np.zeros((len(positions), 3))) if pose is None else pose
