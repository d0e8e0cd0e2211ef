"""HEIDENHAIN: axis error tables `.COM` with their `.CMA`, and entries for the kinematics description."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ...records import Array
from ..space import Held
from . import COMPARE, SIGN_TRIAL, Derived, Fact, Option, Request, any_machine
from ._parts import BOTH_WAYS, Turning, across, centre, counting_on, in_file, point_of, reversal, rows, tilt, trims

TEXT = "HEIDENHAIN: axis error tables .COM and .CMA, entries for the kinematics description"
NCK = "HEIDENHAIN MANUALplus 620 technical manual, p. 715-718"
ITNC = "HEIDENHAIN iTNC 530 HSCI technical manual, p. 671, 680, 686, 722, 749"
FACTS = (
    Fact(".COM: AXISPOS, BACKLASH (values for negative travel), one column per axis; at most 256 equidistant points", NCK),
    Fact(".CMA: one column per axis with the name of its .COM; only one line is active", NCK),
    Fact("the column of an axis is its correction as a function of the axis in whose .CMA column the file stands", NCK),
    Fact(
        "description: Trans AXIS COORD, MachAxis AXIS; the sequence begins at the tool; 50 entries, 4 of them for directions", ITNC
    ),
    Fact("the control itself allows changes of 0.05 mm (MP6600)", ITNC),
    Fact("values of a .COM are corrections: what is added to the commanded position", NCK, confirmed=False),
    Fact(
        "a Trans before a MachAxis moves that axis and everything after it, linear axes too; Trans A B C turn in degrees",
        ITNC,
        confirmed=False,
    ),
    Fact(
        "how .kco and .com of a TNC 640 and TNC7 are written was not found: enter the values there by hand", ITNC, confirmed=False
    ),
)
UNIT_BESIDE = False
OPTIONS = {
    "points": Option(17, "points of each table, at most 256", tuple(range(2, 257))),
    "sign": Option(-1, "-1: corrections; 1: errors, as a sign trial may find", (1, -1)),
    "tables": Option("yes", "write .COM and .CMA", ("yes", "no")),
    "kinematics": Option("yes", "write entries for the kinematics description", ("yes", "no")),
}
TURNING = Turning(BOTH_WAYS, most=256)
check = any_machine


def held(request: Request) -> list[Held]:
    """job → tables of every axis for every linear axis and itself, reversal, places and directions of rotary axes."""
    machine, result = request.machine, []
    if request.options["tables"] == "yes":
        for by in (*machine.linear, *machine.rotary):
            for out in (*machine.linear, *([by] if by in machine.rotary else [])):
                points, sign = int(request.options["points"]), int(request.options["sign"])
                result += trims(request, f"{by}.COM, column {out}", out, by, points, sign=sign, turning=TURNING)
            result.append(reversal(request, f"{by}.COM, BACKLASH", by, sign=int(request.options["sign"])))
    if request.options["kinematics"] == "yes":
        for axis in machine.rotary:
            for c in across(machine, axis):
                place = f"Trans {'XYZ'[c]} of {axis}"
                result.append(centre(machine, axis, c, place, "places", increment=1e-4, base=machine.axis(axis).point[c]))
                base = machine.axis(axis).direction[c]
                result.append(tilt(machine, axis, c, f"direction {'XYZ'[c]} of {axis}", "directions", base=base))
    return result


def _column(value: float, back: float, *, own: bool) -> float:
    """number of a table, BACKLASH of its file, whether it is the column of its own axis → what is written there."""
    return value - (back / 2 if own else 0.0)


def _column_of(request: Request, held: Sequence[Held], by: str, out: str) -> list[tuple[float, Held]]:
    """job, entries, axis of a file, axis of a column → mm or degrees and the entry of each row; [] where it holds none."""
    entries = rows(held, f"{by}.COM, column {out}")
    return in_file(request, by, entries, int(request.options["points"]), TURNING) if entries else []


def derived(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, Derived]:
    """job, entries, numbers → the own column of every .COM file."""
    machine, found = request.machine, {}
    for axis in (*machine.linear, *machine.rotary) if request.options["tables"] == "yes" else ():
        back, unit = numbers[f"{axis}.COM, BACKLASH"], "mm" if axis in machine.linear else "deg"
        for i, (_, h) in enumerate(_column_of(request, held, axis, axis)):
            found[f"{axis}.COM, NR {i}, column {axis} with half of BACKLASH"] = Derived(
                _column(numbers[h.place], back, own=True), unit
            )
    return found


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → one .COM an axis, AXIS.CMA, kinematics.txt."""
    machine, result = request.machine, {}
    axes = (*machine.linear, *machine.rotary)
    if request.options["tables"] == "yes":
        for by in axes:
            columns = {out: _column_of(request, held, by, out) for out in axes}
            first = columns[by]
            back = numbers[f"{by}.COM, BACKLASH"]
            lines = [f"BEGIN {by}.COM", "NR AXISPOS BACKLASH " + " ".join(axes)]
            for i, (at, _) in enumerate(first):
                # The own column has half of the reversal against BACKLASH: values for negative travel are the others' sum.
                own = {out: numbers[columns[out][i][1].place] if columns[out] else 0.0 for out in axes}
                values = [f"{_column(value, back, own=out == by):+.6f}" for out, value in own.items()]
                lines.append(f"{i} {at:+.6f} {back:+.6f} {' '.join(values)}")
            result[f"{by}.COM"] = "\r\n".join([*lines, "[END]"]) + "\r\n"
        line = " ".join(f"{axis}.COM" for axis in axes)
        result["AXIS.CMA"] = "\r\n".join(["BEGIN AXIS.CMA", f"NR ACTIVE {' '.join(axes)}", f"0 * {line}", "[END]"]) + "\r\n"
    if machine.rotary and request.options["kinematics"] == "yes":
        result["kinematics.txt"] = _description(request, numbers)
    return result


def _description(request: Request, numbers: Mapping[str, float]) -> str:
    machine = request.machine
    moving = {*machine.linear, *machine.rotary}
    lines = ["BEGIN KINEMATICS ENTRIES"]
    for axis in (*reversed(machine.tool_branch), *machine.workpiece_branch):  # from the tool to the table
        if axis not in moving:
            continue
        point = point_of(machine, axis)
        direction = np.array(machine.axis(axis).direction)
        place = np.array([numbers.get(f"Trans {c} of {axis}", point[i]) for i, c in enumerate("XYZ")]) - point
        way = np.array([numbers.get(f"direction {c} of {axis}", direction[i]) for i, c in enumerate("XYZ")]) - direction
        rotation: Array = np.cross(direction, way) * 180 / math.pi
        # Directly taken back behind the axis: what follows stands where it stood, the linear axes too.
        before = [(c, v, 6) for c, v in zip("XYZ", place, strict=True) if abs(v) > 5e-7]
        before += [(c, v, 8) for c, v in zip("ABC", rotation, strict=True) if abs(v) > 5e-9]
        lines += [f"Trans {c} {v:+.{digits}f}" for c, v, digits in before]
        lines.append(f"MachAxis {axis}")
        lines += [f"Trans {c} {-v:+.{digits}f}" for c, v, digits in reversed(before)]
    return "\r\n".join([*lines, "[END]"]) + "\r\n"


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    return [
        *(counting_on(request.machine) if request.options["tables"] == "yes" else []),
        "Back up the .COM and .CMA files and the kinematics description first.",
        COMPARE,
        SIGN_TRIAL,
        "Copy the .COM files and add the line of AXIS.CMA; make it the only active line.",
        "Add the Trans entries of kinematics.txt to the description: those above a MachAxis directly before it, those below it "
        "directly behind it, so that no other axis is moved.",
        "Reset the control, reference the axes.",
    ]
