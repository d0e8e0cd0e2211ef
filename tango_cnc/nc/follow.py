"""Lines of a program → motions in axis positions, in order, a few thousand at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from ..records import Array, InputError, Machine
from .blocks import Block, Modal, refused

TRAVEL = 1e-3  # mm or degrees beyond the end of an axis that are rounding
HALF = 179.9  # deg of a turn from which an axis that takes the nearer way may go the other one, corrected or not


@dataclass(frozen=True)
class Setup:
    """What a program does not say: where its zero is, how long the tools are."""

    machine: Machine
    zero: Mapping[str, float]  # machine coordinates of the axes when the words are 0 and no tool length acts, mm and degrees
    length: float  # mm, of every tool that `tools` does not name
    tools: Mapping[int, float] = field(default_factory=dict)
    settled: bool = False  # the user says that the control is set to millimeters and absolute coordinates
    came: Mapping[str, float] = field(default_factory=dict)  # sense of an axis' last motion; others: the mean of both

    def length_of(self, tool: int | None) -> float:
        """number of a tool → its length, mm."""
        return self.tools.get(tool, self.length) if tool is not None else self.length


@dataclass(slots=True)
class Motion:
    """A block with where its motion begins and ends, programmed mm and degrees; `known`: whether every axis is."""

    block: Block
    start: dict[str, float]
    end: dict[str, float]
    length: float  # mm of the tool
    added: float  # mm that the control adds to Z for it
    known: bool
    assumed: str = ""  # rotary axes that no block has named yet: they are taken to be at 0


def follow(lines: Iterable[str], language: ModuleType, setup: Setup) -> Iterator[Motion]:
    """lines, language, set-up → every block with its motion. Raises InputError for what cannot be followed."""
    machine = setup.machine
    axes = "".join((*machine.linear, *machine.rotary))
    modal = Modal()
    at: dict[str, float] = dict.fromkeys(machine.rotary, 0.0)
    tool: int | None = None
    acts = bool(language.LENGTH)
    before = 0.0
    turned: set[str] = set()  # rotary axes that a block has named: before, none has said where they stand
    for number, line in enumerate(lines, 1):
        block = language.read(line, number, modal, axes)
        if block.tool is not None:
            tool = block.tool
        if block.length is not None:
            acts = block.length
        length = setup.length_of(tool)
        added = length if acts else 0.0
        for axis in block.forgets + ("Z" if added != before else ""):  # another length, and Z stands at another word
            at.pop(axis, None)
            if axis not in block.target:
                modal.position.pop(axis, None)
        before = added
        start = dict(at)
        if block.kind in ("rapid", "feed", "arc"):
            if not setup.settled:
                _stated(block, language, modal)
            if block.kind == "feed":
                _the_way_of_the_numbers(block, {a: v for a, v in at.items() if a in turned}, machine)
            turned |= block.target.keys()
            at.update(block.target)
        lacking = [a for a in axes if a not in at]
        known = not lacking
        wanted = [a for a in axes if a not in start] if block.kind == "arc" else lacking if block.kind == "feed" else []
        if wanted:
            raise refused(
                number,
                block.text.strip(),
                f"where {' and '.join(wanted)} {'is' if len(wanted) == 1 else 'are'}, no block has said before: "
                f"begin with a rapid to {' '.join(wanted)}",
            )
        if known and block.target:
            _within_travel(block, at, added, setup)
        assumed = "".join(a for a in machine.rotary if a not in turned)
        yield Motion(block, start, dict(at), length, added, known, assumed)


def _stated(block: Block, language: ModuleType, modal: Modal) -> None:
    """Raises InputError where no block has stated millimeters and absolute coordinates: the control may be set to others."""
    known = (modal.metric, modal.absolute)
    lacking = [what for what, one in zip(language.UNITS, known, strict=False) if not one]
    if lacking:
        asked = {(True, False): "absolute", (False, True): "in millimeters"}.get(known, "in millimeters and absolute")
        raise refused(
            block.number,
            block.text.strip(),
            f"whether it is {asked}, no block has stated: write {' and '.join(lacking)} before it; tango compensate and predict "
            "take --metric-absolute where the control is set so",
        )


def _the_way_of_the_numbers(block: Block, at: Mapping[str, float], machine: Machine) -> None:
    """Raises InputError where a rotary axis that may take the nearer way turns by a half or more: its parts go the numbers' way."""
    for axis in set(machine.rotary) & block.target.keys() & at.keys():
        known = machine.axis(axis)
        turn = block.target[axis] - at[axis]
        if abs(turn) >= HALF and (known.nearer or known.travel is None):
            why = "it takes the nearer way (nearer)" if known.nearer else "it has no travel, so it may take the nearer way"
            raise refused(
                block.number,
                f"{axis}{block.target[axis]:g} after {axis}{at[axis]:g}",
                f"a cut that turns by {abs(turn):g}°, and machine.yaml says of {axis} that {why}: which way it turns is not known; "
                "let the post-processor write turns of less than half a revolution",
            )


def _within_travel(block: Block, at: Mapping[str, float], added: float, setup: Setup) -> None:
    """Raises InputError where an axis would leave its travel: a zero or a length is wrong, or the machine another one.

    A rotary axis that takes the nearer way reaches every angle.
    """
    machine = setup.machine
    for axis in (*machine.linear, *(a for a in machine.rotary if a in block.target)):
        known = machine.axis(axis)
        if known.travel is None or known.nearer:
            continue
        scale, unit = (1.0, "mm") if axis in machine.linear else (180 / math.pi, "deg")
        low, high = (end * scale for end in known.travel)
        value = at[axis] + setup.zero.get(axis, 0.0) + (added if axis == "Z" else 0.0)
        if not low - TRAVEL <= value <= high + TRAVEL:
            why = (
                "see whether --zero and the lengths of the tools are right" if axis in machine.linear else "see whether it is right"
            )
            raise refused(
                block.number,
                f"{axis}{at[axis]:g}",
                f"the machine would stand at {axis} {value:g}, and machine.yaml has {low:g} to {high:g} {unit}: {why}",
            )


def positions(setup: Setup, motions: list[dict[str, float]], added: list[float]) -> Array:
    """set-up, programmed coordinates, what tool length adds → (n, k) mm rad of the axes; axes without a word at their zero."""
    machine = setup.machine
    result = np.zeros((len(motions), len(machine.names)))
    for name in (*machine.linear, *machine.rotary):
        scale = 1.0 if name in machine.linear else math.pi / 180
        zero = setup.zero.get(name, 0.0)
        column = np.array([m.get(name, 0.0) for m in motions]) + zero
        if name == "Z":
            column = column + np.array(added)
        result[:, machine.column(name)] = column * scale
    return result


def senses(setup: Setup) -> Array:
    """set-up → (k,) sense of each axis' last motion, −1 or 1; 0 where it is not stated."""
    return np.array([setup.came.get(name, 0.0) for name in setup.machine.names])


def beyond(machine: Machine, at: Array, touched: Mapping[str, tuple[float, float]]) -> NDArray[np.bool_]:
    """(n, k) mm rad, touched ranges → (n,) whether an axis is where nothing was touched."""
    return np.logical_or.reduce([*axes_beyond(machine, at, touched).values(), np.zeros(len(at), dtype=np.bool_)])


def axes_beyond(machine: Machine, at: Array, touched: Mapping[str, tuple[float, float]]) -> dict[str, NDArray[np.bool_]]:
    """(n, k) mm rad, touched ranges → by axis (n,) whether it is where nothing was touched."""
    values = {name: at[:, machine.column(name)] for name in touched}
    return {name: (values[name] < low - 1e-6) | (values[name] > high + 1e-6) for name, (low, high) in touched.items()}


def words(setup: Setup, position: Array, added: float) -> dict[str, float]:
    """set-up, (k,) mm rad, what tool length adds → programmed coordinates, mm and degrees."""
    machine = setup.machine
    result = {}
    for name in (*machine.linear, *machine.rotary):
        scale = 1.0 if name in machine.linear else 180 / math.pi
        value = float(position[machine.column(name)]) * scale - setup.zero.get(name, 0.0)
        result[name] = value - (added if name == "Z" else 0.0)
    return result


def arc_points(motion: Motion, chord: float) -> list[dict[str, float]]:
    """motion on an arc, chord error mm → programmed coordinates of the ends of its parts, helix along the third axis."""
    arc = motion.block.arc
    assert arc is not None
    a, b = arc.axes
    start, end = (motion.start[a], motion.start[b]), (motion.end[a], motion.end[b])
    radius = math.dist(start, arc.centre)
    first = math.atan2(start[1] - arc.centre[1], start[0] - arc.centre[0])
    last = math.atan2(end[1] - arc.centre[1], end[0] - arc.centre[0])
    sweep = (first - last) % (2 * math.pi) if arc.clockwise else (last - first) % (2 * math.pi)
    if math.dist(start, end) < 1e-9 or sweep < 1e-12:
        sweep = 2 * math.pi
    step = 2 * math.acos(max(-1.0, 1 - min(chord, radius) / radius))
    count = max(2, math.ceil(sweep / step))
    final = math.dist(end, arc.centre)
    points = []
    for i in range(1, count + 1):
        share = i / count
        angle = first + (-sweep if arc.clockwise else sweep) * share
        r = radius + share * (final - radius)
        point = {name: motion.start[name] + share * (value - motion.start[name]) for name, value in motion.end.items()}
        point[a], point[b] = arc.centre[0] + r * math.cos(angle), arc.centre[1] + r * math.sin(angle)
        points.append(point)
    points[-1] = dict(motion.end)
    return points


def zero_of(text: str | None, machine: Machine, what: str = "--zero") -> dict[str, float]:
    """'X=-120,Y=35.2,Z=-310' → machine coordinates of the zero. Raises InputError for anything else."""
    result: dict[str, float] = {}
    axes = (*machine.linear, *machine.rotary)
    for part in text.split(",") if text else ():
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if name.strip() not in axes or not math.isfinite(number):
            raise InputError(f"{what}: found {part!r}; allowed: AXIS=NUMBER,… in mm and degrees, axes {' '.join(axes)}")
        result[name.strip()] = number
    missing = [a for a in machine.linear if a not in result]
    if missing:
        raise InputError(
            f"{what}: found no {', '.join(missing)}; allowed: the machine coordinates of the program's zero (its work offset), "
            f"e.g. {what} X=0,Y=0,Z=-300"
        )
    return result
