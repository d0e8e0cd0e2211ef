"""The ISG kernel and TwinCAT TF5280 reading an ISG_CSV file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, alarm, number, text_of
from ._volumetric import errors, is_component, is_location

FILE = "volcomp.csv"


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → volumetric compensation of the tip's place. Raises InputError for what the kernel refuses."""
    if "file_format[0] ISG_CSV" not in text_of(folder, "volcomp.lis"):
        raise InputError("volcomp.lis: the simulated control refuses it: file_format[0] is not ISG_CSV")
    locations: dict[str, float] = {}
    tables: dict[str, tuple[str, Array, Array]] = {}
    header: list[str] = []
    rows: list[list[float]] = []

    def finish(line: int) -> None:
        if not header:
            return
        arguments = [word for word in header if len(word) == 1]
        if not rows:
            raise alarm(FILE, line, "a header without data")
        table = np.array(rows)
        if not arguments:
            if len(rows) != 1:
                raise alarm(FILE, line, "location errors take one row")
            for name, value in zip(header, rows[0], strict=True):
                locations[f"E{name}"] = value
            return
        if len(arguments) != 1 or header[0] != arguments[0] or arguments[0] not in machine.names:
            raise alarm(FILE, line, f"found arguments {' '.join(arguments)}; this simulated control takes one, first")
        axis = arguments[0]
        where = table[:, 0] * (1.0 if axis in machine.linear else math.pi / 180)
        if (np.diff(where) <= 0).any():
            raise alarm(FILE, line, f"grid points of {axis} do not ascend")
        for j, name in enumerate(header[1:], 1):
            if name[2] != axis:
                raise alarm(FILE, line, f"{name} in a table of {axis}")
            tables[name] = (axis, where, table[:, j])

    lines = text_of(folder, FILE).splitlines()
    for i, line in enumerate(lines, 1):
        words = line.split("//")[0].split()
        if words == ["#"]:
            finish(i)
            header, rows = [], []
        elif words and not header:
            header = words
            known = [len(w) == 1 or is_location(w, machine) or is_component(w, machine) for w in words]
            if not all(known) or len(set(words)) != len(words):
                raise alarm(FILE, i, f"found the header {line!r}; allowed: axes, X0C …, EXX …, each once")
        elif words:
            if len(words) != len(header):
                raise alarm(FILE, i, f"found {len(words)} columns; allowed: {len(header)}")
            rows.append([number(word, FILE, i) for word in words])
    finish(len(lines))
    if not locations and not tables:
        raise InputError(f"{FILE}: the simulated control refuses it: nothing in it")
    return Applied(machine, None, errors(machine, locations, tables))
