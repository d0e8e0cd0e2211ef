"""Positions of the records are machine coordinates in millimetres: they are where the axes were sent."""

from __future__ import annotations

import re

from ..experiment import Experiment, Seen, Verdict

TOLERANCE = 0.05  # mm


def judge(seen: Seen) -> Verdict:
    """→ the largest difference between the end of a measuring move that met nothing and its record."""
    names, worst, which = seen.plan.machine.names, 0.0, ""
    for touch in seen.plan.touches:
        if touch.number in seen.records:
            place = seen.records[touch.number][1]
            for name in seen.plan.machine.linear:
                off = abs(place[name] - touch.end[names.index(name)])
                worst, which = max((worst, which), (off, name))
    if not seen.records:
        return Verdict("OPEN", "nothing was recorded")
    if worst > TOLERANCE:
        return Verdict("FAIL", f"{which} is recorded {worst:.3f} mm from where it was sent", worst, "mm")
    return Verdict("PASS", f"recorded where the axes were sent, within {worst:.4f} mm", worst, "mm")


EXPERIMENT = Experiment(
    "frames",
    1,
    "recorded positions are machine coordinates in mm, whatever offset, tool length and unit is active",
    "compare a record with the machine position on the display",
    "state axis_numbers; cancel scaling, rotation and tool length; check the names of the position variables",
    judge,
    re.compile(r"OFFSET|UNITS|FRAME|MACHINE COORDINATES|MET SOMETHING|MISFIT|DOES NOT FIT|LATCHED|OLD ONE|TRIPPED ON THE WAY"),
    re.compile(
        r"differ by constants|^axis_numbers|^machine_position|^position =|^contact|machine coordinates|millimetres|"
        r"machine positions|positions of the axes|#24301|^machine_frame|^frame_check|^programmed_position|work positions"
    ),
)
