"""ISG kernel and Beckhoff TwinCAT TF5280: volumetric compensation from an ISG_CSV file and its configuration list."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..space import Held
from . import COMPARE, SIGN_TRIAL, Fact, Option, Request, any_machine, none_derived
from ._parts import component_errors, position_errors, rows, scale_of, tables

TEXT = "ISG kernel, Beckhoff TwinCAT TF5280: volumetric compensation (ISG_CSV) with its configuration list"
SOURCE = "Beckhoff TF5280 manual and ISG kernel documentation, volumetric compensation"
FACTS = (
    Fact(
        "columns parted by white space under a header of names; // to the end of the line is a comment; # begins a new header",
        SOURCE,
    ),
    Fact("errors in mm or rad; X Y Z in mm, A B C in degrees", SOURCE),
    Fact("only the place of the tool tip is corrected, not its direction", SOURCE),
    Fact("#VOLCOMP [ID0 UPDATE] reads the files again; files in virtual file systems are not reachable", SOURCE),
    Fact("errors are entered as they are, actual minus commanded; 'negate' turns single axes round", SOURCE, confirmed=False),
    Fact("angles of a linear axis turn about the origin of its frame as docs/model.md has it", SOURCE, confirmed=False),
    Fact("names of the location errors are E, component, 0, axis, without the E: X0C, B0Z", SOURCE, confirmed=False),
)
UNIT_BESIDE = False
OPTIONS = {
    "points": Option(17, "grid points an axis"),
    "sign": Option(1, "1: errors as they are; -1: turned round, as a sign trial may find", (1, -1)),
    "folder": Option("C:\\vc", "folder of the files on the control"),
}
check = any_machine
derived = none_derived


def held(request: Request) -> list[Held]:
    """job → location errors and component errors of every axis."""
    sign = int(request.options["sign"])
    found = [
        *position_errors(request, (1e-7, 1e-10)),
        *component_errors(request, int(request.options["points"]), (1e-7, 1e-10)),
    ]
    return [replace(h, sign=sign * h.sign) for h in found]


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → volcomp.csv, volcomp.lis."""
    machine = request.machine
    locations = rows(held, "axis locations")
    lines = [
        "// location errors, mm and rad",
        " ".join(h.place[1:] for h in locations),
        " ".join(f"{numbers[h.place]:.10f}" for h in locations),
    ]
    names = tables(held)
    for axis in (*machine.linear, *machine.rotary):
        own = [rows(held, t) for t in names if len(t) == 3 and t[2] == axis]
        lines += ["#", f"{axis} {' '.join(entries[0].table for entries in own)}"]
        for entries in zip(*own, strict=True):
            at = entries[0].at
            assert at is not None
            lines.append(f"{at * scale_of(machine, axis):.6f} {' '.join(f'{numbers[h.place]:.10f}' for h in entries)}")
    work, tool = machine.workpiece_branch, tuple(a for a in machine.tool_branch if a != "S")
    numbers_of = {name: i + 1 for i, name in enumerate((*machine.linear, *machine.rotary))}
    chain = "".join((*reversed(work), *tool))
    settings = [
        *(f"{name} {numbers_of.get(name, 0)}" for name in "XYZABC"),
        f"chain {chain}",
        f"workpiece_axes {len(work)}",
        f"file[0] {request.options['folder']}\\volcomp.csv",
        "file_format[0] ISG_CSV",
        "interpolation GRID",
        "enable_splicing FALSE",
        "manual_activation TRUE",
    ]
    text = "\r\n".join
    return {"volcomp.csv": text(lines) + "\r\n", "volcomp.lis": text(settings) + "\r\n"}


def steps(request: Request) -> list[str]:
    """job → what a person does with the files."""
    return [
        COMPARE,
        SIGN_TRIAL,
        f"Copy volcomp.csv into {request.options['folder']} on the control; "
        "enter the lines of volcomp.lis in the list of the channel.",
        "Check the logical axis numbers of volcomp.lis: they are 1, 2, 3 … until you change them.",
        "In MDI: #VOLCOMP OFF [ID0], #VOLCOMP [ID0 UPDATE], #VOLCOMP ON [ID0].",
        "Watch the axes at the first ON: they move by the correction.",
    ]
