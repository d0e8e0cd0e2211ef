"""A Centroid with a compensation table of each axis."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, Trim, alarm, number, text_of


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for what it refuses."""
    trims = []
    for axis in (*machine.linear, *machine.rotary):
        file = f"cnc-{axis.lower()}.tab"
        lines = text_of(folder, file).splitlines()
        if not lines:
            continue
        scale, unit = (1.0, "MM") if axis in machine.linear else (math.pi / 180, "DEG")
        head = lines[0].split()
        if len(head) != 5 or head[0] != axis or head[4] != unit:
            raise alarm(file, 1, f"found {lines[0]!r}; allowed: {axis} FIRST LAST INTERVAL {unit}")
        low, high, step = (number(word, file, 1) for word in head[1:4])
        rows = []
        for i, line in enumerate(lines[1:], 2):
            words = line.split()
            if len(words) != 2:
                raise alarm(file, i, f"found {line!r}; allowed: forward and reverse")
            rows.append([number(word, file, i) for word in words])
        if step <= 0 or abs(low + step * (len(rows) - 1) - high) > 1e-3:
            raise InputError(f"{file}: the simulated control refuses it: {len(rows)} points do not fill the travel")
        table = scale * np.array(rows)
        points: Array = np.asarray(scale * (low + step * np.arange(len(rows))), dtype=np.float64)
        trims.append(Trim(axis, axis, points, table[:, 0], table[:, 1]))
    return Applied(machine, None, None, trims)
