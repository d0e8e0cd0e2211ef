"""A Fagor with user offsets of its kinematics."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tango_cnc.records import InputError, Machine

from . import Applied, alarm, moved_axes, number, text_of

MOST = 0.2  # mm, MAX OFFSET of the maker: more is cut off


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for what it refuses."""
    points = {a: np.array(machine.axis(a).point) for a in machine.rotary}
    switched = False
    for i, line in enumerate(text_of(folder, "offsets.nc").splitlines(), 1):
        bare = line.split(";")[0].strip()
        found = re.fullmatch(r"V\.G\.OFTDATA(\d+)\[(\d+)\]\s*=\s*(\S+)", bare)
        if found:
            axis, component = divmod(int(found[2]) - 1, 3)
            if axis >= len(machine.rotary):
                raise alarm("offsets.nc", i, f"no dimension {found[2]}")
            points[machine.rotary[axis]][component] += np.clip(number(found[3], "offsets.nc", i), -MOST, MOST)
        elif re.fullmatch(r"#KIN ID \[\d+\]", bare):
            switched = True
        elif bare not in ("", "M30"):
            raise alarm("offsets.nc", i, f"found {line!r}")
    if not switched:
        raise InputError("offsets.nc: the simulated control refuses it: no #KIN ID, nothing takes effect")
    return Applied(machine, moved_axes(machine, points, {}))
