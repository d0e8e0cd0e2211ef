"""A Haas with its machine rotary zero point."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tango_cnc.records import InputError, Machine

from . import Applied, alarm, moved_axes, number, text_of


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for what it refuses."""
    values = {}
    for i, line in enumerate(text_of(folder, "settings.txt").splitlines(), 1):
        words = line.split()
        if len(words) != 2 or words[0] not in ("255", "256", "257") or words[0] in values:
            raise alarm("settings.txt", i, f"found {line!r}; allowed: 255, 256, 257 with a number, each once")
        values[words[0]] = number(words[1], "settings.txt", i)
    if len(values) != 3:
        raise InputError("settings.txt: the simulated control refuses it: three settings are wanted")
    swing, table = (a for a in machine.workpiece_branch if a in machine.rotary)
    home = np.array(machine.spindle.point)
    x, y, z = (values[n] + home[i] for i, n in enumerate(("255", "256", "257")))
    here, there = np.array(machine.axis(table).point), np.array(machine.axis(swing).point)
    apart = there - here  # of the two axes: how they lie to each other is not told
    return Applied(
        machine, moved_axes(machine, {table: np.array([x, y, here[2]]), swing: np.array([x + apart[0], y + apart[1], z])}, {})
    )
