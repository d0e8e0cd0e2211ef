"""The exchange form of Etalon (variant Vendor), which TRAC-CAL writes and ISG kernels read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..space import Held
from . import COMPARE, SIGN_TRIAL, Fact, Option, Request, any_machine, none_derived
from ._parts import component_errors, position_errors, rows, scale_of, tables

TEXT = "Etalon exchange form, variant Vendor: what TRAC-CAL writes and ISG kernels and others read"
SOURCE = "Beckhoff TF5280 manual, Etalon exchange format"
FACTS = (
    Fact("[C0B], VALUE = v; [EXY], Gridpoints = { position value … }; errors in mm or rad, arguments in mm or degrees", SOURCE),
    Fact("the variant Kinematic must not be used", SOURCE),
    Fact("only the place of the tool tip is corrected, not its direction", SOURCE),
    Fact("errors are entered as they are, actual minus commanded", SOURCE, confirmed=False),
    Fact("angles of a linear axis turn about the origin of its frame as docs/model.md has it", SOURCE, confirmed=False),
)
UNIT_BESIDE = False
OPTIONS = {
    "points": Option(17, "grid points an axis"),
    "sign": Option(1, "1: errors as they are; -1: turned round, as a sign trial may find", (1, -1)),
}
check = any_machine
derived = none_derived


def held(request: Request) -> list[Held]:
    """job → location errors and component errors of every axis."""
    found = [
        *position_errors(request, (1e-9, 1e-12)),
        *component_errors(request, int(request.options["points"]), (1e-9, 1e-12)),
    ]
    return [replace(h, sign=int(request.options["sign"]) * h.sign) for h in found]


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → etalon.txt."""
    lines = []
    for h in rows(held, "axis locations"):
        lines += [f"[{h.place[1:]}]", f"VALUE = {numbers[h.place]:.12f}", ""]
    for table in (t for t in tables(held) if t != "axis locations"):
        entries = rows(held, table)
        lines += [f"[{table}]", "Gridpoints = {"]
        for h in entries:
            assert h.at is not None and h.axis is not None
            lines.append(f"{h.at * scale_of(request.machine, h.axis):.6f} {numbers[h.place]:.12f}")
        lines += ["}", ""]
    return {"etalon.txt": "\r\n".join(lines)}


def steps(request: Request) -> list[str]:
    """job → what a person does with the file."""
    return [
        COMPARE,
        SIGN_TRIAL,
        "Import etalon.txt where the control takes Etalon files of the variant Vendor.",
        "On an ISG kernel: file_format[0] is then that of Etalon; #VOLCOMP [ID0 UPDATE] reads it.",
    ]
