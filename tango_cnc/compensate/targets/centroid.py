"""Centroid CNC11 and CNC12: `cnc-?.tab` of each axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..space import Held
from . import COMPARE, SIGN_TRIAL, Fact, Option, Request, any_machine, none_derived
from ._parts import BOTH_WAYS, Turning, counting_on, in_file, rows, tables, trims

TEXT = "Centroid CNC11, CNC12: cnc-?.tab, correction forward and reverse of each axis"
SOURCE = "cncsnw.com, LaserComp"
FACTS = (
    Fact(
        "one file an axis; header with axis, travel, interval and unit, then a correction forward and reverse for each point",
        SOURCE,
    ),
    Fact(
        "there are three versions of the file; how the third is laid out was not read: compare with a file of your control",
        SOURCE,
        False,
    ),
    Fact("corrections are added to the commanded position", SOURCE, confirmed=False),
)
OPTIONS = {
    "points": Option(33, "points of each table"),
    "sign": Option(-1, "-1: corrections; 1: errors, as a sign trial may find", (1, -1)),
}
UNIT_BESIDE = True
TURNING = Turning(BOTH_WAYS)
check = any_machine
derived = none_derived


def held(request: Request) -> list[Held]:
    """job → forward and reverse table of every axis."""
    result: list[Held] = []
    for axis in (*request.machine.linear, *request.machine.rotary):
        name = f"cnc-{axis.lower()}.tab"
        result += trims(
            request,
            name,
            axis,
            axis,
            int(request.options["points"]),
            senses=(1, -1),
            sign=int(request.options["sign"]),
            increment=1e-5,
            turning=TURNING,
        )
    return result


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → cnc-x.tab …"""
    result = {}
    for table in tables(held):
        entries = rows(held, table)
        half = len(entries) // 2
        axis, points = entries[0].axis, int(request.options["points"])
        assert axis is not None
        ups, downs = (in_file(request, axis, part, points, TURNING) for part in (entries[:half], entries[half:]))
        first, last = ups[0][0], ups[-1][0]
        step = (last - first) / (len(ups) - 1)
        unit = "MM" if axis in request.machine.linear else "DEG"
        lines = [f"{axis} {first:.6f} {last:.6f} {step:.9f} {unit}"]
        lines += [f"{numbers[u.place]:.5f} {numbers[d.place]:.5f}" for (_, u), (_, d) in zip(ups, downs, strict=True)]
        result[table] = "\r\n".join(lines) + "\r\n"
    return result


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    return [
        *counting_on(request.machine),
        "Keep copies of cnc-?.tab of the control, and compare their layout with these files before you replace anything.",
        COMPARE,
        SIGN_TRIAL,
        "Copy the files, switch laser compensation on, home the machine.",
    ]
