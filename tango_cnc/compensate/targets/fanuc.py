"""FANUC: vectors of five-axis machining, pitch error, straightness and backlash compensation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...records import InputError
from ..space import Held
from . import SIGN_TRIAL, Derived, Fact, Option, Request
from ._parts import HALVES, centre, point_of, reversal, rotary_order, rows, tables, trims

TEXT = "FANUC: parameters of the rotary axes (19700 ff.), pitch error, straightness, backlash"
FIVE = "FANUC A-79348E p. 72-82, A-78712E p. 61-62"
FACTS = (
    Fact("19680: 2 two tool axes, 12 two table axes, 21 mixed", FIVE),
    Fact("19703-19705: vector A to B, from the first table axis to the second, rotary axes at 0", FIVE),
    Fact("19709-19711: D to E, tool axis to tool rotary axis; 19712-19714: E to F, second to first tool axis", FIVE),
    Fact("straightness: four points a b c d of the moving axis with values, linear between them", "FANUC B-63522EN p. 222-223"),
    Fact("at most 128 points of pitch error; acts after power off and reference return", "FANUC B-63522EN"),
    Fact("two tilts of a rotary axis cannot be entered: squareness of rotary axes stays", FIVE, confirmed=False),
    Fact("19700-19702: place of the rotary table, point A from machine zero", "memory", confirmed=False),
    Fact("pitch, straightness and backlash values are corrections: what is added to the command", "memory", confirmed=False),
    Fact(
        "pitch error is entered here as total values at points; many controls take the difference to the point before",
        "memory",
        False,
    ),
    Fact("1851 (backlash) is the whole reversal value", "memory", confirmed=False),
    HALVES,
    Fact("G10 L52 writes parameters, values in mm of a radius", "memory", confirmed=False),
    Fact(
        "TCP, fixture offset that follows the table (7580-7588) and the post-processor each keep the center: this file is for TCP",
        "10.1177/09544054211019668",
        confirmed=False,
    ),
)
OPTIONS = {
    "points": Option(33, "points of pitch error, at most 128", tuple(range(2, 129))),
    "sign": Option(-1, "-1: corrections; 1: errors, as a sign trial may find", (1, -1)),
    "vectors": Option("yes", "write the vectors of the rotary axes", ("yes", "no")),
    "tables": Option("yes", "write pitch error, straightness and backlash", ("yes", "no")),
    "fixture_offset": Option(
        "unused", "G54.2 (7580-7588): unused, or 'by hand': you enter the same center there", ("unused", "by hand")
    ),
}
FIRST = {"A": 19700, "AB": 19703, "DE": 19709, "EF": 19712}


def vectors(request: Request) -> dict[str, tuple[str, str]]:
    """job → parameter group: axis that it leads to and axis that it leads from ('' the machine, 't' the tool)."""
    work, tool = rotary_order(request.machine)
    found: dict[str, tuple[str, str]] = {}
    if work:
        found["A"] = (work[0], "")
    if len(work) == 2:
        found["AB"] = (work[1], work[0])
    if tool:
        found["DE"] = (tool[-1], "t")
    if len(tool) == 2:
        found["EF"] = (tool[0], tool[1])
    return found


def check(request: Request) -> None:
    """job → nothing. Raises InputError for options that leave nothing."""
    if request.options["tables"] == "no" and not (request.machine.rotary and request.options["vectors"] == "yes"):
        raise InputError("--target fanuc: found neither tables nor rotary axes with vectors; allowed: one of them")


def held(request: Request) -> list[Held]:
    """job → centres of the rotary axes, pitch error and backlash of each axis, straightness of linear axes."""
    machine, result = request.machine, []
    sign = int(request.options["sign"])
    if request.options["vectors"] == "yes":
        for axis in machine.rotary:
            for c in range(3):
                place = f"centre of {axis}, {'XYZ'[c]}"
                result.append(centre(machine, axis, c, place, "centres", increment=1e-4, base=machine.axis(axis).point[c]))
    if request.options["tables"] == "yes":
        for axis in (*machine.linear, *machine.rotary):
            result += trims(request, f"pitch {axis}", axis, axis, int(request.options["points"]), sign=sign, increment=1e-4)
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
        if axis == "":
            return np.zeros(3)
        if axis == "t":
            return np.array(machine.spindle.point)
        point = point_of(machine, axis)
        return np.array([numbers.get(f"centre of {axis}, {c}", point[i]) for i, c in enumerate("XYZ")])

    for group, (to, start) in vectors(request).items():
        vector = place(to) - place(start)
        found += [(FIRST[group] + i, f"VECTOR {group} {'XYZ'[i]}", float(vector[i])) for i in range(3)]
    return found


def derived(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, Derived]:
    """job, entries, numbers → the vectors of vectors.nc, by parameter."""
    if request.options["vectors"] == "no":
        return {}
    return {f"{parameter} ({what})": Derived(value, "mm") for parameter, what, value in _written(request, numbers)}


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → vectors.nc, compensation.txt."""
    machine, result = request.machine, {}
    if machine.rotary and request.options["vectors"] == "yes":
        lines = ["%", "O9190 (CENTRES OF THE ROTARY AXES)", "G10 L52"]
        lines += [f"N{parameter} R{value:.4f} ({what})" for parameter, what, value in _written(request, numbers)]
        result["vectors.nc"] = "\n".join([*lines, "G11", "M30", "%"]) + "\n"
    if request.options["tables"] == "yes":
        lines = []
        for table in (t for t in tables(held) if t.startswith(("pitch", "straightness"))):
            lines.append(f"[{table}]")
            for h in rows(held, table):
                assert h.at is not None and h.axis is not None
                scale = 1.0 if h.axis in machine.linear else 180 / np.pi
                lines.append(f"{h.at * scale:.4f} {numbers[h.place]:+.4f}")
        lines.append("[backlash]")
        lines += [f"{h.place} = {numbers[h.place]:+.4f}" for h in rows(held, "reversal values")]
        result["compensation.txt"] = "\n".join(lines) + "\n"
    return result


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    result = ["Save all parameters and the pitch error data first.", SIGN_TRIAL]
    if request.machine.rotary and request.options["vectors"] == "yes":
        result += [
            "Compare every N of vectors.nc with the value in the control: hundredths of a millimeter may differ. If "
            "millimeters do, the zero of machine.yaml is another one: load nothing, and propose anew with --present.",
            "Allow parameters to be written, run vectors.nc, switch the power off and on.",
            "Write the same center wherever it is kept once more: fixture offset 7580-7588, post-processor. One alone is an error.",
        ]
    return [
        *result,
        "Enter compensation.txt in the pitch error and straightness pages, switch the power off and on, go to reference points.",
    ]
