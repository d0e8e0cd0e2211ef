"""A Fanuc with vectors of the rotary axes or a dynamic fixture offset, pitch error, straightness and backlash."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, Trim, alarm, moved_axes, number, text_of


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for what it refuses."""
    trims: list[Trim] = []
    reversal: dict[str, float] = {}
    head, rows = "", []  # type: str, list[tuple[float, float]]

    def finish() -> None:
        found = re.fullmatch(r"pitch ([XYZABC])|straightness ([XYZ]) to ([XYZ])", head)
        if not found:
            return
        by, out = (found[1], found[1]) if found[1] else (found[2], found[3])
        if by not in machine.names or len(rows) < 2 or len(rows) > 128 or (found[2] and len(rows) != 4):
            raise InputError(f"compensation.txt: the simulated control refuses it: [{head}] with {len(rows)} points")
        table = np.array(rows)
        if (np.diff(table[:, 0]) <= 0).any():
            raise InputError(f"compensation.txt: the simulated control refuses it: points of [{head}] do not ascend")
        values = table[:, 1] * _scale(machine, out)
        trims.append(Trim(out, by, table[:, 0] * _scale(machine, by), values, values))

    for i, line in enumerate(text_of(folder, "compensation.txt").splitlines(), 1):
        begin, back = re.fullmatch(r"\[(.+)\]", line.strip()), re.fullmatch(r"1851 of ([XYZABC]) = (\S+)", line.strip())
        if begin:
            finish()
            head, rows = begin[1], []
        elif back and head == "backlash" and back[1] in machine.names:
            reversal[back[1]] = number(back[2], "compensation.txt", i) * _scale(machine, back[1])
        elif len(line.split()) == 2:
            a, b = (number(word, "compensation.txt", i) for word in line.split())
            rows.append((a, b))
        else:
            raise alarm("compensation.txt", i, f"found {line!r}")
    finish()
    return Applied(machine, _vectors(folder, machine) or _fixture(folder, machine), None, trims, reversal=reversal)


def _scale(machine: Machine, axis: str) -> float:
    return 1.0 if axis in machine.linear else math.pi / 180


def _vectors(folder: Path, machine: Machine) -> Callable[[Array], Array] | None:
    text = text_of(folder, "vectors.nc")
    if not text:
        return None
    values: dict[int, float] = {}
    writing = False
    for i, line in enumerate(text.splitlines(), 1):
        bare = re.sub(r"\([^)]*\)", "", line).strip()
        found = re.fullmatch(r"N(\d+)\s*R(\S+)", bare)
        if bare in ("G10 L52", "G11"):
            writing = bare == "G10 L52"
        elif found and writing and 19700 <= int(found[1]) <= 19714:
            values[int(found[1])] = number(found[2], "vectors.nc", i)
        elif bare and bare not in ("%", "M30") and not re.fullmatch(r"O\d+", bare):
            raise alarm("vectors.nc", i, f"found {line!r}")

    def vector(first: int) -> Array:
        if not all(first + i in values for i in range(3)):
            raise InputError(f"vectors.nc: the simulated control refuses it: {first} to {first + 2} are not all there")
        return np.array([values[first + i] for i in range(3)])

    work = [a for a in machine.workpiece_branch if a in machine.rotary]
    tool = [a for a in machine.tool_branch if a in machine.rotary]
    points: dict[str, Array] = {}
    if work:
        points[work[0]] = np.array(machine.spindle.point) + vector(19700)  # machine zero is where the spindle stands
    if len(work) == 2:
        points[work[1]] = points[work[0]] + vector(19703)
    if tool:
        points[tool[-1]] = np.array(machine.spindle.point) + vector(19709)
    if len(tool) == 2:
        points[tool[0]] = points[tool[1]] + vector(19712)
    return moved_axes(machine, points, {})


def _fixture(folder: Path, machine: Machine) -> Callable[[Array], Array] | None:
    """G54.2: what lies on the table is turned about the zero of the work offset; Fanuc writes it in machine coordinates."""
    text = text_of(folder, "fixture.nc")
    if not text:
        return None
    zero: dict[str, float] = {}
    absolute = metric = False
    for i, line in enumerate(text.splitlines(), 1):
        bare = re.sub(r"\([^)]*\)", "", line).strip()
        found = re.fullmatch(r"G10 L2 P[1-6]((?: [XYZ]\S+)+)", bare)
        if bare == "G21 G90":
            absolute = metric = True
        elif found and absolute and metric and not zero:
            zero = {word[0]: number(word[1:], "fixture.nc", i) for word in found[1].split()}
        elif bare and bare not in ("%", "M30") and not re.fullmatch(r"O\d+", bare):
            raise alarm("fixture.nc", i, f"found {line!r}")
    table = [a for a in machine.workpiece_branch if a in machine.rotary]
    if len(table) != 1 or len(zero) != 2:
        raise InputError("fixture.nc: the simulated control refuses it: allowed: one table axis, two coordinates of its center")
    point = np.array(machine.axis(table[0]).point)
    for axis, value in zero.items():
        column = "XYZ".index(axis)
        point[column] = machine.spindle.point[column] + value
    return moved_axes(machine, {table[0]: point}, {})
