"""grblHAL with rtcp_ac."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tango_cnc.records import Machine

from . import Applied, alarm, moved_axes, number, text_of


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for a line that it answers with an error."""
    home = np.array(machine.spindle.point)
    points = {a: np.array(machine.axis(a).point) for a in "AC"}
    for i, line in enumerate(text_of(folder, "settings.txt").splitlines(), 1):
        found = re.fullmatch(r"\$(64[0-5])=(\S+)", line.strip())
        if not found or not -1000 <= (value := number(found[2], "settings.txt", i)) <= 1000:
            raise alarm("settings.txt", i, f"found {line!r}: error:3")
        place = int(found[1]) - 640
        points["A" if place < 3 else "C"][place % 3] = value + home[place % 3]
    return Applied(machine, moved_axes(machine, points, {}))
