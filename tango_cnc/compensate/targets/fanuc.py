"""FANUC: vectors of five-axis machining, zero of the dynamic fixture offset, pitch error, straightness, backlash."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...records import InputError, Machine
from ..space import Held
from . import SIGN_TRIAL, Derived, Fact, Option, Request
from ._parts import (
    BOTH_WAYS,
    HALVES,
    Turning,
    across,
    centre,
    counting_on,
    in_file,
    readout,
    reversal,
    rotary_order,
    rows,
    tables,
    trims,
)

TEXT = "FANUC: parameters of the rotary axes (19700 ff.), zero of the dynamic fixture offset, pitch error, straightness, backlash"
FIVE = "FANUC A-79348E p. 72-82, A-78712E p. 61-62"
FACTS = (
    Fact("19680: 2 two tool axes, 12 two table axes, 21 mixed", FIVE),
    Fact("19703-19705: vector A to B, from the first table axis to the second, rotary axes at 0", FIVE),
    Fact("19709-19711: D to E, tool axis to tool rotary axis; 19712-19714: E to F, second to first tool axis", FIVE),
    Fact("straightness: four points a b c d of the moving axis with values, linear between them", "FANUC B-63522EN p. 222-223"),
    Fact("at most 128 points of pitch error; acts after power off and reference return", "FANUC B-63522EN"),
    Fact("two tilts of a rotary axis cannot be entered: squareness of rotary axes stays", FIVE, confirmed=False),
    Fact(
        "19700-19702: place of the rotary table, point A from machine zero: what X, Y, Z show with the spindle on it",
        "memory",
        confirmed=False,
    ),
    Fact("pitch, straightness and backlash values are corrections: what is added to the command", "memory", confirmed=False),
    Fact(
        "pitch error is entered here as total values at points; many controls take the difference to the point before",
        "memory",
        False,
    ),
    Fact("1851 (backlash) is the whole reversal value", "memory", confirmed=False),
    HALVES,
    Fact("G10 L52 writes parameters, values in mm of a radius", "memory", confirmed=False),
    Fact("7580-7588: rotary axis and its two linear axes, three groups; no center is in them", "FANUC B-63944EN-2/02 p. 221"),
    Fact(
        "TCP, dynamic fixture offset and post-processor each keep the center: where they differ, parts are off by the difference",
        "10.1177/09544054211019668",
    ),
    Fact(
        "G54.2 turns its vector about the zero of the work offset that is active: the center of the table",
        "memory",
        confirmed=False,
    ),
    Fact(
        "G10 L2 P1 to P6 writes G54 to G59, machine coordinates with the spindle on the center, no length in them",
        "memory",
        confirmed=False,
    ),
)
TURNING = Turning(BOTH_WAYS, most=128)
WORK_OFFSETS = tuple(f"G{n}" for n in range(54, 60))
UNIT_BESIDE = False
OPTIONS = {
    "points": Option(33, "points of pitch error, at most 128", tuple(range(2, 129))),
    "sign": Option(-1, "-1: corrections; 1: errors, as a sign trial may find", (1, -1)),
    "vectors": Option("yes", "write the vectors of the rotary axes", ("yes", "no")),
    "tables": Option("yes", "write pitch error, straightness and backlash", ("yes", "no")),
    "fixture_offset": Option(
        "unused",
        "G54.2: unused; the work offset whose zero is the center of the table: fixture.nc; by hand: you enter it there",
        ("unused", "by hand", *WORK_OFFSETS),
    ),
}
FIRST = {"A": 19700, "AB": 19703, "DE": 19709, "EF": 19712}


def vectors(request: Request) -> dict[str, tuple[str, str]]:
    """job → parameter group: axis that it leads to and axis that it leads from; '': machine zero, the spindle."""
    work, tool = rotary_order(request.machine)
    found: dict[str, tuple[str, str]] = {}
    if work:
        found["A"] = (work[0], "")
    if len(work) == 2:
        found["AB"] = (work[1], work[0])
    if tool:
        found["DE"] = (tool[-1], "")
    if len(tool) == 2:
        found["EF"] = (tool[0], tool[1])
    return found


def check(request: Request) -> None:
    """job → nothing. Raises InputError for options that leave nothing, and for a table that no one zero of G54.2 can follow."""
    if request.options["fixture_offset"] in WORK_OFFSETS and not turntable(request.machine):
        raise InputError(
            f"--set fixture_offset: found {request.options['fixture_offset']} for {request.machine.topology}; allowed: for one "
            "table axis parallel to X, Y or Z, on linear axes that are. Two table axes that do not meet have no common zero: state "
            "'by hand', or use tool center point control"
        )
    if request.options["tables"] == "no" and not centred(request):
        raise InputError("--target fanuc: found neither tables nor rotary axes with vectors; allowed: one of them")


def turntable(machine: Machine) -> str:
    """machine → its one table axis, where the zero of a work offset can be its center; empty where it cannot."""
    work, _ = rotary_order(machine)
    if len(work) != 1 or len(across(machine, work[0])) != 2:
        return ""
    for i in across(machine, work[0]):
        name, ideal = "XYZ"[i], np.eye(3)[i]
        sign = -1.0 if name in machine.workpiece_branch else 1.0
        if name not in machine.linear or not np.allclose(sign * np.array(machine.axis(name).direction), ideal, atol=1e-12):
            return ""
    return work[0]


def centred(request: Request) -> tuple[str, ...]:
    """job → the rotary axes whose centers are written: all in vectors.nc, the table in fixture.nc alone."""
    if request.options["vectors"] == "yes":
        return request.machine.rotary
    return (turntable(request.machine),) if request.options["fixture_offset"] in WORK_OFFSETS else ()


def held(request: Request) -> list[Held]:
    """job → centres of the rotary axes, pitch error and backlash of each axis, straightness of linear axes."""
    machine, result = request.machine, []
    sign = int(request.options["sign"])
    for axis in centred(request):
        for c in range(3) if request.options["vectors"] == "yes" else across(machine, axis):
            place = f"centre of {axis}, {'XYZ'[c]}"
            result.append(centre(machine, axis, c, place, "centres", increment=1e-4, base=float(readout(machine, axis)[c])))
    if request.options["tables"] == "yes":
        for axis in (*machine.linear, *machine.rotary):
            points = int(request.options["points"])
            result += trims(request, f"pitch {axis}", axis, axis, points, sign=sign, increment=1e-4, turning=TURNING)
            result.append(reversal(request, f"1851 of {axis}", axis, increment=1e-4))
        for by in machine.linear:
            for out in machine.linear:
                if out != by:
                    result += trims(request, f"straightness {by} to {out}", out, by, 4, sign=sign, increment=1e-4)
    return result


def _written(request: Request, numbers: Mapping[str, float]) -> list[tuple[int, str, float]]:
    """job, numbers → parameter, which component of which vector it is, mm."""
    machine, found = request.machine, []

    def place(axis: str) -> np.ndarray:
        if axis == "":  # machine zero is where the spindle stands with all axes at zero
            return np.zeros(3)
        point = readout(machine, axis)
        return np.array([numbers.get(f"centre of {axis}, {c}", point[i]) for i, c in enumerate("XYZ")])

    for group, (to, start) in vectors(request).items():
        vector = place(to) - place(start)
        found += [(FIRST[group] + i, f"VECTOR {group} {'XYZ'[i]}", float(vector[i])) for i in range(3)]
    return found


def derived(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, Derived]:
    """job, entries, numbers → the vectors of vectors.nc, by parameter."""
    vectors = _written(request, numbers) if request.options["vectors"] == "yes" else []
    found = {f"{parameter} ({what})": Derived(value, "mm") for parameter, what, value in vectors}
    return found | {
        f"{request.options['fixture_offset']} {axis}": Derived(at, "mm") for axis, at in _zero(request, numbers).items()
    }


def _zero(request: Request, numbers: Mapping[str, float]) -> dict[str, float]:
    """job, numbers → {axis: mm} where the spindle stands on the center of the table; nothing where no work offset is stated."""
    if request.options["fixture_offset"] not in WORK_OFFSETS:
        return {}
    machine, axis = request.machine, turntable(request.machine)
    return {"XYZ"[i]: numbers[f"centre of {axis}, {'XYZ'[i]}"] for i in across(machine, axis)}


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → vectors.nc, fixture.nc, compensation.txt."""
    machine, result = request.machine, {}
    if machine.rotary and request.options["vectors"] == "yes":
        lines = ["%", "O9190 (CENTRES OF THE ROTARY AXES)", "G10 L52"]
        lines += [f"N{parameter} R{value:.4f} ({what})" for parameter, what, value in _written(request, numbers)]
        result["vectors.nc"] = "\n".join([*lines, "G11", "M30", "%"]) + "\n"
    if zero := _zero(request, numbers):
        which = request.options["fixture_offset"]
        words = " ".join(f"{axis}{at:.4f}" for axis, at in zero.items())
        head = f"O9191 (CENTER OF TABLE {turntable(machine)} AS ZERO OF {which})"
        result["fixture.nc"] = f"%\n{head}\nG21 G90\nG10 L2 P{WORK_OFFSETS.index(which) + 1} {words}\nM30\n%\n"
    if request.options["tables"] == "yes":
        lines = []
        for table in (t for t in tables(held) if t.startswith(("pitch", "straightness"))):
            lines.append(f"[{table}]")
            entries = rows(held, table)
            by = entries[0].axis
            assert by is not None
            placed = in_file(request, by, entries, int(request.options["points"]), TURNING)
            lines += [f"{at:.4f} {numbers[h.place]:+.4f}" for at, h in placed]
        lines.append("[backlash]")
        lines += [f"{h.place} = {numbers[h.place]:+.4f}" for h in rows(held, "reversal values")]
        result["compensation.txt"] = "\n".join(lines) + "\n"
    return result


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    result = ["Save all parameters and the pitch error data first.", SIGN_TRIAL]
    if request.machine.rotary and request.options["vectors"] == "yes":
        result += [
            "Compare every N of vectors.nc with the value in the control: hundredths of a millimeter may differ. N19700 to N19702 "
            "are what X, Y and Z show with the spindle on the center, all axes at zero. If millimeters differ, the control counts "
            "from another zero: load nothing, and propose anew with --present.",
            "Allow parameters to be written, run vectors.nc, switch the power off and on.",
            "Write the same center wherever it is kept once more: post-processor, work offset that G54.2 turns about. "
            "One alone is an error.",
        ]
    if (which := request.options["fixture_offset"]) in WORK_OFFSETS:
        result += [
            f"Compare fixture.nc with {which} in the control: its zero has to be the center of the table, hundredths of a "
            "millimeter may differ. If millimeters do, the zero is that of a part: load nothing.",
            f"Run fixture.nc. The fixture offset of a part is the way from the center to its zero: measure it anew, or take the "
            f"change of {which} off it, or its zero moves with the center.",
        ]
    if request.options["tables"] == "no":
        return result
    return [
        *result,
        *counting_on(request.machine),
        "Enter compensation.txt in the pitch error and straightness pages, switch the power off and on, go to reference points.",
    ]
