"""A typed sheet of values for controls whose parameters are entered by hand: centres, directions, pitch, reversal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..space import Held
from . import COMPARE, SIGN_TRIAL, Fact, Option, Request, any_machine, none_derived
from ._parts import BOTH_WAYS, HALVES, Turning, across, centre, counting_on, in_file, readout, reversal, rows, tables, tilt, trims

TEXT = "any other control (Mitsubishi, Mazak, Okuma, Mach4 …): a sheet of values with what each of them means"
FACTS = (
    Fact("centers of the rotary axes: what X, Y, Z show with the spindle on it, all axes at zero, mm", "docs/model.md"),
    Fact("your control has a place for each of these values; which one is in its manual", "your manual", confirmed=False),
    Fact("the sign of every table is as the sheet says: error, actual minus commanded", "your manual", confirmed=False),
    HALVES,
)
OPTIONS = {
    "points": Option(11, "points of each table"),
    "centres": Option("yes", "centers of the rotary axes", ("yes", "no")),
    "directions": Option("no", "directions of the rotary axes", ("yes", "no")),
    "pitch": Option("yes", "positioning error of each axis", ("yes", "no")),
    "straightness": Option("no", "straightness and squareness of each linear axis", ("yes", "no")),
    "reversal": Option("yes", "reversal values", ("yes", "no")),
    "increment": Option(0.001, "what the control stores in steps of, mm or degrees", within=(1e-7, 0.01)),
}
UNIT_BESIDE = True
TURNING = Turning(BOTH_WAYS)
check = any_machine
derived = none_derived


def held(request: Request) -> list[Held]:
    """job → what the options ask for."""
    machine, o, result = request.machine, request.options, []
    step = float(o["increment"])
    for axis in machine.rotary:
        for c in across(machine, axis):
            if o["centres"] == "yes":
                place = f"{axis} centre {'XYZ'[c]}"
                result.append(centre(machine, axis, c, place, "centres", increment=step, base=float(readout(machine, axis)[c])))
            if o["directions"] == "yes":
                result.append(
                    tilt(machine, axis, c, f"{axis} direction {'XYZ'[c]}", "directions", base=machine.axis(axis).direction[c])
                )
    for axis in (*machine.linear, *machine.rotary):
        if o["pitch"] == "yes":
            result += trims(request, f"pitch {axis}", axis, axis, int(o["points"]), increment=step, turning=TURNING)
        if o["straightness"] == "yes" and axis in machine.linear:
            for out in machine.linear:
                if out != axis:
                    result += trims(request, f"{out} as {axis} moves", out, axis, int(o["points"]), increment=step)
        if o["reversal"] == "yes":
            result.append(reversal(request, f"reversal {axis}", axis, increment=step))
    return result


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → values.txt."""
    words = {
        "centres": "what X, Y, Z show with the spindle on the axis, all axes at zero; in a head: from the spindle to it",
        "directions": "unit vector about which the axis turns, machine coordinates",
        "reversal values": "whole reversal value; positive: the axis stops short of where its scale says",
    }
    lines = [f"machine: {request.machine.name}, {request.machine.topology}", f"increment: {request.options['increment']:g}", ""]
    for table in tables(held):
        lines.append(f"[{table}] {words.get(table, 'error: actual minus commanded; a correction is its negative')}")
        lines += [f"{place} = {numbers[h.place]:.9g} {h.unit}" for place, h in _lines(request, rows(held, table))]
        lines.append("")
    return {"values.txt": "\n".join(lines)}


def _lines(request: Request, entries: Sequence[Held]) -> list[tuple[str, Held]]:
    """job, entries of a table or group → what stands in each line before its number, and the entry that has it."""
    by = entries[0].axis
    if by is None:
        return [(h.place, h) for h in entries]
    unit = "mm" if by in request.machine.linear else "deg"
    placed = in_file(request, by, entries, int(request.options["points"]), TURNING)
    return [(f"{h.table} at {by} {at + 0.0:.6g} {unit}", h) for at, h in placed]


def steps(request: Request) -> list[str]:
    """job → what a person does with the sheet."""
    return [
        *(counting_on(request.machine) if request.options["pitch"] == "yes" else []),
        "Write down the present value of every parameter before you change it.",
        COMPARE,
        SIGN_TRIAL,
        "Enter the values of values.txt where the manual of the control has them. Centers are what X, Y and Z show with the "
        "spindle on the axis; in a head they lead from the spindle to it.",
        "Where the manual keeps a center in two places (TCP and fixture offset, say), enter both: one alone is a systematic error.",
    ]
