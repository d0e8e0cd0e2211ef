"""Rotary axes arrive where they are sent, in machine coordinates, and positions are not read ahead of them."""

from __future__ import annotations

import math
import re

from ..digits import lost
from ..experiment import Experiment, Ruling, Seen

TOLERANCE = 0.02  # deg


def judge(seen: Seen) -> Ruling:
    """→ the largest difference between a recorded angle and the commanded one, whole turns aside."""
    machine, worst, which, clipped = seen.plan.machine, 0.0, "", lost(seen)
    for touch in seen.plan.touches:
        if touch.number in seen.records and touch.number not in clipped:
            place = seen.records[touch.number][1]
            for name in machine.rotary:
                off = abs(math.remainder(place[name] - math.degrees(touch.end[machine.column(name)]), 360.0))
                worst, which = max((worst, which), (off, name))
    if not machine.rotary:
        return Ruling("PASS", "the machine has no rotary axis")
    if not seen.records:
        return Ruling("OPEN", "nothing was recorded")
    if worst > TOLERANCE:
        return Ruling("FAIL", f"{which} is recorded {worst:.3f} deg from where it was sent", worst, "deg")
    if len(seen.records) < len(seen.plan.touches):
        return Ruling("OPEN", "the program did not get through all indexations")
    return Ruling("PASS", f"every indexation reached, within {worst:.4f} deg", worst, "deg")


EXPERIMENT = Experiment(
    "rotary",
    2,
    "rotary axes arrive where they are sent, and nothing is read before they have",
    "look at the displayed angle after each indexation, and whether the program stops there",
    "state unclamp and clamp where a brake holds the axis, axis_numbers where another axis was read, rollover where it stands a "
    "turn off; state wait (G103 P1 on a Haas) where positions are read too early",
    judge,
    re.compile(r"ROTARY AXIS|NOT TURNED|(?<![XYZ] )STANDS AT|MOTOR FAULT|ALARM:17|FOLLOWING ERROR|EXCESS ERROR|SERVO"),
    re.compile(
        r"turns a rotary axis|^rollover|^rotary =|^rotary_position =|^shortest|^wrapped|^wait =|^clamp|^unclamp|reading ahead|"
        r"letters of the rotary|before the next line|wait for the axes"
    ),
    rests=(
        "wait",
        "axis_numbers",
        "rollover",
        "rotary",
        "rotary_position",
        "machine_axes",
        "shortest",
        "wrapped",
        "unclamp",
        "clamp",
        "position",
        "machine_position",
        "machine_frame",
    ),
    on=("rotary",),
)
