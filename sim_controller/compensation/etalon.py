"""A control that reads the exchange form of Etalon, variant Vendor."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, alarm, number, text_of
from ._volumetric import errors, is_component, is_location

FILE = "etalon.txt"


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → volumetric compensation of the tip's place. Raises InputError for what it refuses."""
    locations: dict[str, float] = {}
    tables: dict[str, tuple[str, Array, Array]] = {}
    points: list[list[float]] = []
    section, open_ = "", False
    for i, line in enumerate(text_of(folder, FILE).splitlines(), 1):
        text = line.strip()
        head, value = re.fullmatch(r"\[(\w+)\]", text), re.fullmatch(r"VALUE\s*=\s*(\S+)", text)
        if not text:
            continue
        if open_:
            if text == "}":
                axis = section[2]
                table = np.array(points)
                where = table[:, 0] * (1.0 if axis in machine.linear else math.pi / 180)
                if (np.diff(where) <= 0).any():
                    raise alarm(FILE, i, f"grid points of {section} do not ascend")
                tables[section], open_ = (axis, where, table[:, 1]), False
                continue
            words = text.split()
            if len(words) != 2:
                raise alarm(FILE, i, f"found {text!r}; allowed: position and value")
            points.append([number(word, FILE, i) for word in words])
        elif head:
            section = head[1]
            if not (is_location(section, machine) or is_component(section, machine)):
                raise alarm(FILE, i, f"found [{section}]; allowed: names of errors of this machine")
            if section in tables or f"E{section}" in locations:
                raise alarm(FILE, i, f"[{section}] twice")
        elif value and is_location(section, machine):
            locations[f"E{section}"] = number(value[1], FILE, i)
        elif re.fullmatch(r"Gridpoints\s*=\s*\{", text) and is_component(section, machine):
            points, open_ = [], True
        else:
            raise alarm(FILE, i, f"found {text!r} in [{section}]")
    if open_ or not (locations or tables):
        raise InputError(f"{FILE}: the simulated control refuses it: it ends too early")
    return Applied(machine, None, errors(machine, locations, tables))
