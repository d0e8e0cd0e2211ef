"""Serial chain → tip positions and their exact derivatives.

Theory of operation. Every axis is a short list of elementary steps on one point, written in the machine frame at the zero
pose: go into the axis frame, shift and turn there, come back. The tool branch applies its axes from the spindle to the
foundation, the workpiece branch applies the inverses from the foundation to the table. A touch looks at one number only,
the gap along its normal; so the derivative is that normal carried backwards through the same steps (reverse mode), and
every error of the chain is read off on the way: a shift gives a component of the normal, a turn its moment. No step is
linearised. Points are three separate arrays, so that a leading dimension (Monte Carlo trials) costs nothing to support.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple

import numpy as np

from .records import COMPONENTS, Array, Axis, Machine

Stage = Literal["inter", "motion", "intra", "stylus", "table"]
Point = list[Array]  # x, y, z, each (..., n)


class Slot(NamedTuple):
    """A place in the chain where an error acts: component 0–5 = x y z (mm) a b c (rad); `motion` is in command units."""

    axis: str
    stage: Stage
    component: int = 0


Errors = Mapping[Slot, Array | float]


class Element(NamedTuple):
    """One elementary step: shift along or turn about base vector `base` by `factor` × (commanded + error)."""

    turn: bool
    base: int
    factor: float
    slot: Slot
    column: int | None = None  # of the position array, for the commanded motion


@dataclass(frozen=True)
class Joint:
    """The steps of one axis in its frame: rows of `frame` are the frame's base vectors in the machine frame."""

    name: str
    frame: Array | None  # (3, 3), None where it is parallel to the machine frame
    point: Array  # (3,)
    steps: tuple[Element, ...]

    @cached_property
    def motion(self) -> tuple[Element, ...]:
        """→ the steps that a machine without errors makes."""
        return tuple(step for step in self.steps if step.column is not None)


@dataclass(frozen=True)
class Chain:
    """A machine as seen by the tip: joints from the spindle to the table, `tip` at the zero pose.

    The last joint, `w`, is where the artefact sits on the table; it matters only when facets are calibrated.
    """

    joints: tuple[Joint, ...]
    foundation: int  # number of joints of the tool branch
    tip: Array  # (3,) mm, or (3, n) where touches have styli of several lengths
    spindle_frame: Array  # (3, 3) rows = base vectors of the spindle frame in the machine frame
    spindle_direction: Array  # (3,) in the spindle frame, from the tip towards the spindle
    linear_columns: tuple[int, ...]

    @property
    def slots(self) -> tuple[Slot, ...]:
        """→ every place where an error can act."""
        own = [step.slot for joint in self.joints for step in joint.steps]
        return (*(Slot("t", "stylus", i) for i in range(3)), *own)


@dataclass(frozen=True)
class Sensitivity:
    """What a unit error does to the gap of each touch, and the normal as seen from three frames."""

    slots: Mapping[Slot, Array]  # (..., n): mm/mm or mm/rad
    machine_normal: Array  # (..., n, 3)
    spindle_normal: Array  # (..., n, 3), in the frame that turns with S


@lru_cache(maxsize=256)  # a chain is made for every look at the readings
def axis_frame(name: str, direction: tuple[float, float, float]) -> tuple[Array | None, int, float]:
    """letter, direction → (rows of the axis frame in the machine frame or None, base index, sense), by model.md.

    Parallel to the machine frame for ± the letter's base vector; else turned by the smallest rotation that takes it there.
    """
    base = {"X": 0, "A": 0, "Y": 1, "B": 1}.get(name, 2)
    d = np.array(direction)
    e = np.eye(3)[base]
    for sense in (1.0, -1.0):
        if np.linalg.norm(d - sense * e) < 1e-12:
            return None, base, sense
    v = np.cross(e, d)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    rotation = np.eye(3) + cross + 2 * cross @ cross / ((e + d) @ (e + d))
    rotation.flags.writeable = False
    return rotation.T, base, 1.0


def chain(machine: Machine, length: Array | None = None) -> Chain:
    """machine, (n,) mm length of the stylus at every touch (None: that of the probe) → its chain from tip to table."""
    tool = [_joint(machine.axis(name), machine.column(name), False) for name in reversed(machine.tool_branch)]
    work = [_joint(machine.axis(name), machine.column(name), True) for name in machine.workpiece_branch]
    spindle = machine.spindle
    frame, base, sense = axis_frame("S", spindle.direction)
    along = np.array(machine.probe.length if length is None else length)
    tip = (np.array(spindle.point) - along[..., None] * np.array(spindle.direction)).T
    columns = tuple(machine.column(name) for name in machine.linear)
    placement = [Element(turn, i, -1.0, Slot("w", "table", i + 3 * turn)) for turn in (False, True) for i in (2, 1, 0)]
    work.append(Joint("w", None, np.zeros(3), tuple(placement)))
    return Chain((*tool, *work), len(tool), tip, np.eye(3) if frame is None else frame, sense * np.eye(3)[base], columns)


@lru_cache(maxsize=1024)  # hundreds of machines are looked at that differ in one axis
def _joint(axis: Axis, column: int, inverse: bool) -> Joint:
    name = axis.name
    frame, base, sense = axis_frame(name, axis.direction)
    sign = -1.0 if inverse else 1.0

    def displacement(stage: Stage) -> list[Element]:
        skip = base + 3 if axis.kind != "linear" else base
        turns = [Element(True, i, sign, Slot(name, stage, i + 3)) for i in range(3)]
        shifts = [Element(False, i, sign, Slot(name, stage, i)) for i in range(3)]
        # The positioning error acts in the motion, so that its place among the intra-axis errors stays empty.
        return [s for s in (*turns, *shifts) if not (stage == "intra" and s.slot.component == skip)]

    motion = Element(axis.kind != "linear", base, sign * sense, Slot(name, "motion"), column)
    steps = [*displacement("intra"), motion, *displacement("inter")]
    return Joint(name, frame, np.array(axis.point), tuple(reversed(steps) if inverse else steps))


def _enter(joint: Joint, x: Point) -> Point:
    y = [c - p if p else c for c, p in zip(x, joint.point, strict=True)]
    return y if joint.frame is None else _turned(joint.frame, y)


def _leave(joint: Joint, y: Point) -> Point:
    x = y if joint.frame is None else _turned(joint.frame.T, y)
    return [c + p if p else c for c, p in zip(x, joint.point, strict=True)]


def _turned(rows: Array, x: Point) -> Point:
    return [r[0] * x[0] + r[1] * x[1] + r[2] * x[2] for r in rows]


def _rotate(x: Point, base: int, sine: Array, cosine: Array) -> Point:
    j, k = (base + 1) % 3, (base + 2) % 3
    y = list(x)
    y[j] = cosine * x[j] - sine * x[k]
    y[k] = sine * x[j] + cosine * x[k]
    return y


def _amount(step: Element, position: Array, errors: Errors) -> Array | float | None:
    error = errors.get(step.slot)
    if step.column is None:
        return None if error is None else step.factor * np.asarray(error)
    command = position[..., step.column]
    return step.factor * (command if error is None else command + error)


def _start(chain: Chain, position: Array, errors: Errors) -> Point:
    slots = [Slot("t", "stylus", i) for i in range(3)]
    if not any(slot in errors for slot in slots):
        return [np.full(position.shape[:-1], value) for value in chain.tip]
    zero, frame = np.zeros(position.shape[:-1]), chain.spindle_frame
    own = [(row, errors[slot]) for row, slot in enumerate(slots) if slot in errors]
    return [sum((frame[row, i] * offset for row, offset in own), zero + chain.tip[i]) for i in range(3)]


def tip(chain: Chain, position: Array, errors: Errors | None = None) -> Array:
    """(..., n, k) mm rad, errors by slot → (..., n, 3) mm, tip centre in the table frame (thesis eq. 4-4 … 4-7).

    Complex errors give a complex tip: the derivative by complex step, against which `sensitivity` is judged.
    """
    errors = errors or {}
    x = _start(chain, position, errors)
    for joint in chain.joints:
        if not (steps := joint.steps if errors else joint.motion):
            continue  # a body that nothing moves
        x = _enter(joint, x)
        for step in steps:
            amount = _amount(step, position, errors)
            if amount is None:
                continue
            if step.turn:
                x = _rotate(x, step.base, np.sin(amount), np.cos(amount))
            else:
                x = [c + amount if i == step.base else c for i, c in enumerate(x)]
        x = _leave(joint, x)
    return np.stack(np.broadcast_arrays(*x), axis=-1)


@dataclass(frozen=True)
class Trace:
    """A forward pass that remembers enough to be walked backwards."""

    tip: Array  # (..., n, 3) mm, table frame
    turns: tuple[tuple[Array, Array] | None, ...]  # sine and cosine of every step that turned
    points: tuple[Point, ...]  # the point after every step, in the joint's frame


def trace(chain: Chain, position: Array, errors: Errors | None = None) -> Trace:
    """(..., n, k) mm rad, errors by slot → tip with the intermediate results that `sensitivity` needs."""
    errors = errors or {}
    x = _start(chain, position, errors)
    turns: list[tuple[Array, Array] | None] = []
    points: list[Point] = []
    for joint in chain.joints:
        x = _enter(joint, x)
        for step in joint.steps:
            amount = _amount(step, position, errors)
            turn = None
            if amount is not None and step.turn:
                turn = np.sin(amount), np.cos(amount)
                x = _rotate(x, step.base, *turn)
            elif amount is not None:
                x = [c + amount if i == step.base else c for i, c in enumerate(x)]
            turns.append(turn)
            points.append(x)
        x = _leave(joint, x)
    return Trace(np.stack(np.broadcast_arrays(*x), axis=-1), tuple(turns), tuple(points))


def sensitivity(chain: Chain, run: Trace, normal: Array) -> Sensitivity:
    """trace, (..., n, 3) gradient of the gap by the tip in the table frame → derivative of the gap by every slot."""
    g: Point = [normal[..., i] for i in range(3)]
    found: dict[Slot, Array] = {}
    machine_normal = g
    at = len(run.points)
    for number in range(len(chain.joints) - 1, -1, -1):
        if number == chain.foundation - 1:
            machine_normal = g
        joint = chain.joints[number]
        g = g if joint.frame is None else _turned(joint.frame, g)
        for step in reversed(joint.steps):
            at -= 1
            if step.turn:
                j, k = (step.base + 1) % 3, (step.base + 2) % 3
                y = run.points[at]
                found[step.slot] = step.factor * (g[k] * y[j] - g[j] * y[k])
                turn = run.turns[at]
                if turn is not None:
                    g = _rotate(g, step.base, -turn[0], turn[1])
            else:
                found[step.slot] = step.factor * g[step.base]
        g = g if joint.frame is None else _turned(joint.frame.T, g)
    spindle = [chain.spindle_frame[i] @ np.stack(np.broadcast_arrays(*g)).reshape(3, -1) for i in range(3)]
    shape = np.broadcast_shapes(*(c.shape for c in g))
    for i in range(3):
        found[Slot("t", "stylus", i)] = spindle[i].reshape(shape)
    return Sensitivity(
        found, np.stack(np.broadcast_arrays(*machine_normal), axis=-1), np.stack([s.reshape(shape) for s in spindle], axis=-1)
    )


def inverse(chain: Chain, position: Array, tip_position: Array) -> Array:
    """(n, k) with rotary columns set, (n, 3) mm tip in the table frame → (n, k) with the linear columns that bring it there.

    Nominal machine: for fixed rotary positions the tip is an affine function of the three linear axes.
    Raises numpy.linalg.LinAlgError when the linear axes are not independent.
    """
    base, origin, jacobian = affine(chain, position)
    base[:, list(chain.linear_columns)] = np.linalg.solve(jacobian, (tip_position - origin)[:, :, None])[:, :, 0]
    return base


def affine(chain: Chain, position: Array) -> tuple[Array, Array, Array]:
    """(n, k) with rotary columns set → (n, k) with the linear ones 0, (n, 3) mm tip there, (n, 3, 3) its way per linear axis."""
    columns = list(chain.linear_columns)
    base = np.array(position, dtype=float)
    base[:, columns] = 0.0
    moved = np.stack([base] * (1 + len(columns)))
    for i, column in enumerate(columns):
        moved[1 + i, :, column] = 1.0
    origin, *ends = tip(chain, moved)
    jacobian = np.stack([end - origin for end in ends], axis=-1)
    return base, origin, jacobian


def spindle_axis(chain: Chain, position: Array) -> Array:
    """(n, k) → (n, 3) unit vector from the tip towards the spindle, in the table frame, nominal machine."""
    ahead = {Slot("t", "stylus", i): float(chain.spindle_direction[i]) for i in range(3)}
    return tip(chain, position, ahead) - tip(chain, position)


def slot_name(slot: Slot) -> str:
    """slot → the ISO 230-1 name of the error that acts there, e.g. EX0C, EYX, EXX, EXt."""
    if slot.stage in ("stylus", "table"):
        return f"E{COMPONENTS[slot.component]}{slot.axis}"
    if slot.stage == "motion":
        return f"E{slot.axis}{slot.axis}"
    letter = COMPONENTS[slot.component]
    return f"E{letter}0{slot.axis}" if slot.stage == "inter" else f"E{letter}{slot.axis}"
