"""A person who enters the values of the sheet into a control with centres, directions, pitch tables and reversal values."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, Trim, alarm, moved_axes, number, text_of

LINE = re.compile(r"(?P<place>\S.*?) = (?P<value>\S+) (?P<unit>mm|deg|1)")
TABLE = re.compile(
    r"(?:pitch (?P<own>[XYZABC])|(?P<out>[XYZ]) as (?P<by>[XYZ]) moves) at (?P<axis>[XYZABC]) (?P<at>\S+) (?:mm|deg)"
)


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what a control with these values does. Raises InputError for a line that nobody could enter."""
    points: dict[str, Array] = {a: np.array(machine.axis(a).point) for a in machine.rotary}
    directions: dict[str, Array] = {a: np.array(machine.axis(a).direction) for a in machine.rotary}
    reversal: dict[str, float] = {}
    tables: dict[tuple[str, str], list[tuple[float, float]]] = {}

    def scale(axis: str) -> float:
        return 1.0 if axis in machine.linear else math.pi / 180

    for i, line in enumerate(text_of(folder, "values.txt").splitlines(), 1):
        if not line.strip() or line.startswith("[") or re.match(r"(machine|increment): ", line):
            continue
        found = LINE.fullmatch(line)
        if found is None:
            raise alarm("values.txt", i, f"found {line!r}; allowed: PLACE = NUMBER UNIT")
        value = number(found["value"], "values.txt", i)
        one = re.fullmatch(r"([ABC]) (centre|direction) ([XYZ])", found["place"])
        table, back = TABLE.fullmatch(found["place"]), re.fullmatch(r"reversal ([XYZABC])", found["place"])
        if one and one[1] in machine.rotary:
            i = "XYZ".index(one[3])
            if one[2] == "centre":  # what the axes show with the spindle there
                points[one[1]][i] = machine.spindle.point[i] + value
            else:
                directions[one[1]][i] = value
        elif back and back[1] in machine.names:
            reversal[back[1]] = value * scale(back[1])
        elif table:
            out, by = table["own"] or table["out"], table["own"] or table["by"]
            if table["axis"] != by or by not in machine.names:
                raise alarm("values.txt", i, f"found {line!r}: a table of another axis")
            tables.setdefault((out, by), []).append((float(table["at"]) * scale(by), value * scale(out)))
        else:
            raise alarm("values.txt", i, f"found {line!r}: no such place")
    trims = []
    for (out, by), rows in tables.items():
        at, error = np.array(rows).T
        if (np.diff(at) <= 0).any():
            raise InputError(f"values.txt: the simulated control refuses it: points of {out} do not ascend")
        trims.append(Trim(out, by, at, -error, -error))
    return Applied(machine, moved_axes(machine, points, directions) if machine.rotary else None, None, trims, reversal=reversal)
