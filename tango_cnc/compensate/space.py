"""What a control can hold: numbers in tables and parameters, each with what it does to the tool tip over a volume.

Every stored number takes some error of the tool tip away, in proportion to its size: a table point that of the axis it moves, a
pivot that of the chain it belongs to. So what a control can hold is a linear space of functions of the pose, and what it cannot
hold is what is left beside that space. Set-up (six numbers of the workpiece, one of the tool length) is free, as in `verify`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..iso230.poses import at_poses
from ..kinematics import Slot
from ..records import Array, InputError, Machine
from ..touches import Touches
from ..verify.volume import setup_lever
from .frame import back

LONGER = 100.0  # mm of tool between the two tips whose difference is its direction
TURN = 2 * math.pi
EDGE = 1e-6  # of the distance of two points: what rounding of limits leaves
REACH = 300.0  # mm: a turn counts as this many mm a rad when small numbers are preferred
Limits = Mapping[str, tuple[float, float]]  # axis: lower and upper end, mm or rad
Lever = Callable[["Poses"], Array]


@dataclass(frozen=True)
class Held:
    """One number that a control stores.

    The control's number is `base` + `sign` × `factor` × v, where v (mm, rad, mm/mm) is the error of the machine that it stands
    for, actual minus commanded. `lever`: poses → (n, 3) mm of tip error that a unit of v takes away.
    """

    place: str  # where a person finds it in the control
    table: str  # what it belongs to: a file, a table, a group of parameters
    unit: str  # of the control's number
    kind: Literal["length", "angle", "ratio"]
    increment: float  # in `unit`: what the control stores in steps of
    lever: Lever
    factor: float = 1.0  # `unit` per mm, rad or mm/mm
    sign: int = 1
    base: float = 0.0  # the control's number for the machine of machine.yaml without errors
    turns: bool = False  # whether it also corrects the direction of the tool
    slot: Slot | None = None  # the error of the model that v is, where it is one
    axis: str | None = None  # of a table: the axis that it is read with …
    at: float | None = None  # … and where, mm or rad
    sense: int = 0  # 1 −1: only while that axis moves up, down
    tcp: bool = False  # whether it acts only with tool centre point control on
    coefficient: str = ""  # the coefficient of the model that v is, where it is one
    reach: float | None = None  # mm or rad, the most that a ratio is multiplied by over the volume; None: the longest travel
    along: int | None = None  # of a center: which of x y z of the machine it is
    between: bool = False  # of a center: it counts from another axis, and from no zero of the machine
    counted: bool = False  # its file has a whole number: of how many increments it is
    digits: int = 0  # significant ones that its file has, where no control but a program reads it; 0: it has increments

    def number(self, value: float) -> float:
        """v in mm, rad, mm/mm → what the control stores, rounded to its increment, or to significant digits."""
        exact = self.base + self.sign * self.factor * value
        if self.digits:
            return float(f"{exact:.{self.digits}g}") + 0.0
        steps = round(exact / self.increment)
        return round(steps * self.increment, 12) + 0.0

    def written(self, number: float) -> float:
        """The control's number → what its file has: the number, or how many increments that is."""
        return float(round(number / self.increment)) if self.counted else number

    def value(self, number: float) -> float:
        """The control's number → v in mm, rad, mm/mm."""
        return (number - self.base) * self.sign / self.factor


@dataclass(frozen=True)
class Poses:
    """n poses of a volume, with directions of the last motions, and what errors do to the tip there."""

    touches: Touches

    def __len__(self) -> int:
        return len(self.touches)

    @property
    def machine(self) -> Machine:
        """→ the nominal machine."""
        return self.touches.machine

    @cached_property
    def nominal(self) -> Array:
        """→ (n, 3) mm, tip of the nominal machine in the table frame."""
        return kinematics.tip(self.touches.chain, self.touches.position)

    @cached_property
    def slots(self) -> dict[Slot, Array]:
        """→ (n, 3) mm/mm or mm/rad: derivative of the tip by every slot."""
        run = kinematics.trace(self.touches.chain, self.touches.position)
        parts = [kinematics.sensitivity(self.touches.chain, run, np.tile(e, (len(self), 1))).slots for e in np.eye(3)]
        return {slot: np.stack([part[slot] for part in parts], axis=1) for slot in parts[0]}

    @cached_property
    def longer(self) -> Poses:
        """→ the same poses with a tool that is longer."""
        probe = replace(self.machine.probe, length=self.machine.probe.length + LONGER)
        return Poses(at_poses(replace(self.machine, probe=probe), self.touches.position, self.touches.direction))

    @cached_property
    def setup(self) -> Array:
        """→ (3n, q) orthonormal basis of what the set-up of workpiece and tool length takes out."""
        u, s, _ = np.linalg.svd(setup_lever(self.touches, self.nominal).reshape(-1, 7), full_matrices=False)
        return np.asarray(u[:, s > 1e-10 * s[0]])

    def free(self, columns: Array) -> Array:
        """(3n, m) → the same without what a set-up takes out."""
        return np.asarray(columns - self.setup @ (self.setup.T @ columns))


def sample(machine: Machine, limits: Limits, count: int = 1024) -> Poses:
    """machine, volume, n → n poses spread evenly over the volume, with last motions of either direction; n a power of two.

    Sobol's sequence (I. M. Sobol', 1967): even in every projection, either direction as often as the other at every place, so
    that a function of one axis looks like none of another axis by chance. The same poses every time.
    """
    from scipy.stats import qmc  # a command that needs no poses does not wait for it

    names = [*machine.linear, *machine.rotary]
    share = qmc.Sobol(2 * len(names), scramble=False).random_base2(math.ceil(math.log2(count)))
    share += 0.5 / len(share)
    position, direction = np.zeros((len(share), len(machine.names))), np.ones((len(share), len(machine.names)))
    for i, name in enumerate(names):
        low, high = limits[name]
        position[:, machine.column(name)] = low + share[:, i] * (high - low)
        direction[:, machine.column(name)] = np.where(share[:, len(names) + i] < 0.5, -1.0, 1.0)
    return Poses(at_poses(machine, position, direction))


def limits_of(
    machine: Machine, touches: Touches, over: str, given: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """machine, touches, `probed` or `travel`, limits of some axes → the volume. Raises InputError for one that is no volume.

    `probed`: what was touched. `travel`: the travels, at most one turn of a rotary axis.
    """
    result: dict[str, tuple[float, float]] = {}
    for name in (*machine.linear, *machine.rotary):
        travel = machine.axis(name).travel
        if name in given:
            low, high = given[name]
            if travel is not None and (low < travel[0] - 1e-9 or high > travel[1] + 1e-9):
                scale, unit = (1.0, "mm") if name in machine.linear else (180 / np.pi, "deg")
                raise InputError(
                    f"--volume: found {name} from {low * scale:g} to {high * scale:g} {unit}; allowed: within its travel, "
                    f"{travel[0] * scale:g} to {travel[1] * scale:g} {unit}"
                )
        elif over == "probed":
            low, high = float(touches.axis(name).min()), float(touches.axis(name).max())
            if high - low < 1e-6:  # an axis that never moved: a table of one point is none
                low, high = low - (1.0 if name in machine.linear else 0.01), high + (1.0 if name in machine.linear else 0.01)
        elif travel is None and name in machine.rotary:
            low, high = -np.pi, np.pi
        elif travel is None:
            raise InputError(f"machine: axis {name} has no travel; give it one, or name the volume (--volume {name}=LOW:HIGH)")
        else:
            low, high = travel
        if name in machine.rotary and high - low > 2 * np.pi:
            middle = 0.0 if low <= -np.pi and high >= np.pi else (low + high) / 2
            low, high = middle - np.pi, middle + np.pi
        result[name] = (low, high)
    return result


def knots(limits: Limits, axis: str, points: int) -> Array:
    """volume, axis, number → equidistant points of a table over it, mm or rad."""
    return np.linspace(*limits[axis], points)


def turns_whole(machine: Machine, axis: str) -> bool:
    """machine, axis → whether it can turn once round or more: the same place then has several positions, 360 degrees apart."""
    travel = machine.axis(axis).travel
    return axis in machine.rotary and (travel is None or travel[1] - travel[0] >= TURN - 1e-9)


def knots_of_turn(limits: Limits, axis: str, points: int, most: int | None = None) -> tuple[Array, int]:
    """volume, rotary axis, number → points of a table that cover it, rad, and how many of them a whole turn has (`most` at most).

    They are whole multiples of their distance, so that a table of any travel has the same ones in each of its turns. Not more
    than one for each place of the turn.
    """
    low, high = limits[axis]
    turn = math.ceil(TURN * (points - 1) / (high - low) - EDGE)
    turn = turn if most is None else min(turn, most)
    step = TURN / turn
    first = math.floor(low / step + EDGE)
    count = min(math.ceil(high / step - EDGE) - first + 1, turn)
    return np.asarray(step * np.arange(first, first + count), dtype=np.float64), turn


def in_turn(count: int, turn: int, i: int) -> int:
    """points of a table, places of a whole turn, a place from the first point on → the point that holds there.

    Where nothing was touched that is the nearer one of both ends.
    """
    i %= turn
    return i if i < count else count - 1 if i - (count - 1) <= turn - i else 0


def hat(touches: Touches, axis: str, points: Array, i: int, sense: int = 0, turn: int = 0) -> Array:
    """(n,) share of table point i: linear between the points, held beyond both ends; 0 while moving against `sense`.

    `turn`: of how many places a whole turn is, for a table that comes again with each turn; 0: it does not.
    """
    at = touches.axis(axis)
    if turn:
        own = np.array([float(in_turn(len(points), turn, j) == i) for j in range(turn + 1)])
        value = np.interp(np.mod(at - points[0], TURN), TURN / turn * np.arange(turn + 1), own)
    else:
        value = np.interp(at, points, np.eye(len(points))[i])
    return value if not sense else value * (touches.sign(axis) == sense)


def by_slot(slot: Slot, function: Callable[[Touches], Array]) -> Lever:
    """slot, regressor → lever of an error that acts there."""
    return lambda poses: poses.slots[slot] * function(poses.touches)[:, None]


@dataclass(frozen=True)
class Table:
    """A table of one axis: corrects the error at `slot` as a function of `axis`."""

    name: str
    slot: Slot
    axis: str
    points: Array
    senses: tuple[int, ...] = (0,)
    unit: str = "mm"
    factor: float = 1.0
    sign: int = 1
    increment: float = 1e-6
    more: Mapping[str, bool] = field(default_factory=dict)
    turn: int = 0  # places of a whole turn, where the table comes again with each turn; 0: it does not


def tabulated(table: Table, machine: Machine) -> list[Held]:
    """table → its entries, one a point and sense."""
    held = []
    scale, unit = (1.0, "mm") if table.axis in machine.linear else (180 / np.pi, "deg")
    for sense in table.senses:
        for i, at in enumerate(table.points):
            way = {0: "", 1: ", moving up", -1: ", moving down"}[sense]

            def share(t: Touches, i: int = i, sense: int = sense) -> Array:
                return hat(t, table.axis, table.points, i, sense, table.turn)

            kind: Literal["length", "angle"] = "angle" if _turns(table.slot, machine) else "length"
            place = f"{table.name} at {table.axis} {at * scale:.6g} {unit}{way}"
            own = table.slot.stage == "motion" and table.slot.axis in machine.rotary
            held.append(
                Held(
                    place,
                    table.name,
                    table.unit,
                    kind,
                    table.increment,
                    by_slot(table.slot, share),
                    table.factor,
                    table.sign,
                    turns=own,
                    slot=table.slot,
                    axis=table.axis,
                    at=float(at),
                    sense=sense,
                )
            )
    return held


def _turns(slot: Slot, machine: Machine) -> bool:
    return slot.axis in machine.rotary if slot.stage == "motion" else slot.component >= 3


def believed(axis: str, what: Literal["point", "direction"], way: Array) -> Lever:
    """axis, its point (mm) or direction (rad), (3,) along the axes of the control → lever of that belief of the control.

    A control that believes the axis to lie where it is moves the tool by the difference: the derivative of its kinematics, by
    differences of the chain. The workpiece at the zero pose stays where it is.
    """
    step = 1.0 if what == "point" else 1e-4

    def lever(poses: Poses) -> Array:
        tips, own = [], poses.machine.axis(axis)
        to = back(poses.machine, way, about=what == "direction")
        for sign in (1.0, -1.0):
            moved = np.array(getattr(own, what)) + sign * step * to
            if what == "direction":
                moved = moved / np.linalg.norm(moved)
            there = (float(moved[0]), float(moved[1]), float(moved[2]))
            changed = replace(own, point=there) if what == "point" else replace(own, direction=there)
            axes = tuple(changed if a.name == axis else a for a in poses.machine.axes)
            tips.append(kinematics.tip(kinematics.chain(replace(poses.machine, axes=axes)), poses.touches.position))
        return np.asarray((tips[0] - tips[1]) / (2 * step))

    return lever


def matrix(held: Sequence[Held], poses: Poses) -> Array:
    """entries, poses → (3n, h) what a unit of each takes away, set-up taken out."""
    return poses.free(np.stack([h.lever(poses).ravel() for h in held], axis=1)) if held else np.zeros((3 * len(poses), 0))


def direction_matrix(held: Sequence[Held], poses: Poses) -> Array:
    """entries, poses → (3n, h) rad of tool direction that a unit of each takes away."""
    result = np.zeros((3 * len(poses), len(held)))
    for j, h in enumerate(held):
        if h.turns:
            result[:, j] = ((h.lever(poses.longer) - h.lever(poses)) / LONGER).ravel()
    return result


def inside(limits: Limits, machine: Machine, position: Array) -> NDArray[np.bool_]:
    """volume, (n, k) → (n,) whether a pose lies in it."""
    result = np.ones(len(position), dtype=np.bool_)
    for name, (low, high) in limits.items():
        value = position[:, machine.column(name)]
        result &= (value >= low - 1e-9) & (value <= high + 1e-9)
    return result
