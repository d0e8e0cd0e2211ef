"""What a control does with a compensation that was written into it: files → programmed positions become those of the motors.

One file a target, its name is the target's name; it reads the files from the facts of docs/compensate.md and knows nothing of the
program that wrote them. `read(folder, machine)` → `Applied`. A file that the control would refuse is an InputError; what a control
takes in silence is taken in silence here, too.

Positions that a program asks for are those of the machine without errors: with tool centre point control they are what the control
calculates backwards from its own kinematics. It reports a probed position with the same calculation.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from tango_cnc.files.checked import read_text
from tango_cnc.files.readjson import read_json
from tango_cnc.nearest import printable
from tango_cnc.records import Array, Axis, InputError, Machine

from ..world import Control, nominal_machine, tip_in_table

LONGEST = 500  # characters of what it says of a file
LARGEST = 1e9  # no control holds more
BY_ITSELF = ("iso230",)  # no control reads it: the file says in which frame it is
ROUNDS = 2  # of the solution for the linear axes: the second one sees 1e-9 mm


@dataclass(frozen=True)
class Trim:
    """A table: what is added to axis `out` (mm, rad) as a function of where axis `by` is; another one for going down, maybe."""

    out: str
    by: str
    points: Array
    up: Array
    down: Array
    modulo: bool = False  # whether the axis counts 0 to 360 degrees

    def at(self, machine: Machine, positions: Array, directions: Array) -> Array:
        """(n, k), (n, k) → (n,) what is added; beyond the ends that of the end."""
        column = machine.column(self.by)
        where = np.mod(positions[:, column], 2 * np.pi) if self.modulo else positions[:, column]
        return np.where(directions[:, column] < 0, np.interp(where, self.points, self.down), np.interp(where, self.points, self.up))


@dataclass(frozen=True)
class Applied:
    """All that a control does; each part may be absent."""

    machine: Machine
    kinematics: Callable[[Array], Array] | None = None  # (n, k) programmed → (n, k) by the control's own kinematics
    volumetric: Callable[[Array, Array], Mapping[str, Array]] | None = None  # positions, directions → errors by name, (n,)
    trims: Sequence[Trim] = ()
    switched: bool = True  # whether `kinematics` acts with tool centre point control only
    reversal: Mapping[str, float] | None = None  # by axis: added half of it in the direction of motion, mm rad

    def __call__(self, positions: Array, directions: Array) -> Array:
        """(n, k) programmed mm rad, (n, k) −1 0 1 → (n, k) where the motors go. Raises InputError where that is no place."""
        try:
            result = self._moved(positions, directions)
        except np.linalg.LinAlgError:
            result = np.full_like(positions, np.nan)
        if not np.isfinite(result).all():
            raise InputError("the simulated control refuses it: with these numbers an axis is to go to no place")
        return result

    def _moved(self, positions: Array, directions: Array) -> Array:
        moved = positions if self.kinematics is None else self.kinematics(positions)
        if self.volumetric is not None:
            moved = self._corrected(moved, directions, self.volumetric)
        result = np.array(moved)
        for trim in self.trims:
            result[:, self.machine.column(trim.out)] += trim.at(self.machine, moved, directions)
        for name, whole in (self.reversal or {}).items():
            result[:, self.machine.column(name)] += whole / 2 * directions[:, self.machine.column(name)]
        return result

    def _corrected(self, positions: Array, directions: Array, errors: Callable[[Array, Array], Mapping[str, Array]]) -> Array:
        nominal = nominal_machine(self.machine)
        wanted = tip_in_table(nominal, positions, directions)
        columns = [self.machine.column(name) for name in self.machine.linear]
        ways = np.empty((len(positions), 3, 3))
        for i, column in enumerate(columns):
            step = positions.copy()
            step[:, column] += 100.0
            ways[:, :, i] = (tip_in_table(nominal, step, directions) - wanted) / 100.0
        result = positions.copy()
        found = errors(positions, directions)
        for _ in range(ROUNDS):
            away = wanted - tip_in_table(nominal, result, directions, found)
            result[:, columns] += np.linalg.solve(ways, away[:, :, None])[:, :, 0]
        return result


def _three(vector: Array) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])


def in_own_axes(machine: Machine) -> Machine:
    """machine in any frame, a mirror image of it perhaps → the same as its control knows it: x y z are where + of X Y Z takes the
    tip over the table. The control was never told of another frame, so positions that go in and come out stay what they are."""
    nominal, still = nominal_machine(machine), np.zeros((4, len(machine.names)))
    for i, name in enumerate("XYZ"):
        still[i + 1, machine.column(name)] = 1.0
    tips = tip_in_table(nominal, still, np.zeros_like(still))
    to = np.round(tips[1:] - tips[0], 9)
    if np.allclose(to, np.eye(3), atol=0.02):
        return machine
    left = float(np.linalg.det(to)) < 0  # seen in a mirror, what turns to the right turns to the left

    def seen(axis: Axis) -> Axis:
        way = to @ np.array(axis.direction) * (-1 if left and axis.kind == "rotary" else 1)
        return replace(axis, direction=_three(way), point=_three(to @ np.array(axis.point)))

    return replace(machine, axes=tuple(seen(axis) for axis in machine.axes))


@cache
def targets() -> tuple[str, ...]:
    """→ every target that a simulated control takes."""
    return tuple(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def read(folder: Path, machine: Machine, *, tcp: bool = True) -> Control:
    """folder as `tango compensate` writes it, machine → what the control does with it, with tool centre point control or without.

    Raises InputError for a folder without compensation.json, a target that no simulated control takes, and files that it refuses.
    """
    file = folder / "compensation.json"
    try:
        target = read_json(file, "what 'tango compensate' wrote")["target"]
    except (InputError, KeyError):
        raise InputError(f"--compensation: found {folder} without a compensation.json that names a target; allowed: a folder "
                         "that 'tango compensate' has written") from None  # fmt: skip
    if target not in targets():
        raise InputError(f"{file}: target: found {target!r:.80}; allowed: {', '.join(targets())}")
    module = importlib.import_module(f"{__name__}.{target}")
    own = machine if target in BY_ITSELF else in_own_axes(machine)
    try:
        found: Applied = module.read(folder, own)
    except InputError as error:
        raise InputError(printable(str(error), LONGEST)) from None
    except (ValueError, IndexError, KeyError, StopIteration) as error:
        raise InputError(f"{folder}: the simulated control refuses it: {printable(str(error), LONGEST)}") from None
    return found if tcp or not found.switched else replace(found, kinematics=None)


def text_of(folder: Path, name: str) -> str:
    """folder, name → text of the file; empty where there is none. Raises InputError for what is no file of that folder."""
    if not there(folder, name):
        return ""
    return read_text(folder / name)


def there(folder: Path, name: str) -> bool:
    """folder, name that a file states → whether it is a file of that folder."""
    if Path(name).name != name or len(name.encode("utf-8", "replace")) > 255 or "\0" in name:
        return False
    return (folder / name).is_file()


def alarm(file: str, line: int, text: str) -> InputError:
    """file, line from 1, what the control says → the error."""
    return InputError(f"{file}:{line}: the simulated control refuses it: {text}")


def number(text: str, file: str, line: int) -> float:
    """text → number. Raises InputError for anything else, a decimal comma among it."""
    try:
        value = float(text)
    except ValueError:
        raise alarm(file, line, f"found {text!r}; allowed: a number") from None
    if not np.isfinite(value):
        raise alarm(file, line, f"found {text!r}; allowed: a finite number")
    if abs(value) > LARGEST:
        raise alarm(file, line, f"found {text!r}; allowed: up to {LARGEST:g}")
    return value


def moved_axes(machine: Machine, points: Mapping[str, Array], directions: Mapping[str, Array]) -> Callable[[Array], Array]:
    """machine, where a control believes axes to lie, and their directions → its kinematics: programmed → its own positions."""
    from ..simulate import linear_positions

    axes = []
    for axis in machine.axes:
        point, direction = points.get(axis.name), directions.get(axis.name)
        own = axis if point is None else replace(axis, point=_three(point))
        if direction is not None:
            unit = direction / np.linalg.norm(direction)
            own = replace(own, direction=_three(unit))
        axes.append(own)
    believed, nominal = replace(machine, axes=tuple(axes)), nominal_machine(machine)

    def kinematics(positions: Array) -> Array:
        return linear_positions(believed, positions, tip_in_table(nominal, positions, np.zeros_like(positions)))

    return kinematics
