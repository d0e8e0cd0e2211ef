"""Positions of the records are machine coordinates in millimetres: they are where the axes were sent."""

from __future__ import annotations

import re

from ..digits import lost
from ..experiment import Experiment, Ruling, Seen

TOLERANCE = 0.05  # mm


def judge(seen: Seen) -> Ruling:
    """→ the largest difference between the end of a measuring move that met nothing and its record."""
    names, worst, which, clipped = seen.plan.machine.names, 0.0, "", lost(seen)
    for touch in seen.plan.touches:
        if touch.number in seen.records and touch.number not in clipped:
            place = seen.records[touch.number][1]
            for name in seen.plan.machine.linear:
                off = abs(place[name] - touch.end[names.index(name)])
                worst, which = max((worst, which), (off, name))
    if not seen.records:
        return Ruling("OPEN", "nothing was recorded")
    if worst > TOLERANCE:
        return Ruling("FAIL", f"{which} is recorded {worst:.3f} mm from where it was sent", worst, "mm")
    return Ruling("PASS", f"recorded where the axes were sent, within {worst:.4f} mm", worst, "mm")


TURNED_ROUND = (
    ". Nothing is recorded: this was at one of the first moves. If it went down where it had to go up, a mirror image of this axis "
    "may be on: switch it off at the control (see mirror); or machine.yaml has this axis the wrong way round (see directions)"
)


EXPERIMENT = Experiment(
    "frames",
    1,
    "recorded positions are machine coordinates in mm, whatever offset, tool length and unit is active",
    "compare a record with the machine position on the display",
    "look first whether the probe signal is on while nobody touches the stylus: then turn its polarity round. Where an axis went "
    "the other way than it was sent, a mirror image of it is on: switch it off at the control, and state the words that do it in "
    "reset; or machine.yaml has its direction the wrong way round. Else state "
    "axis_numbers; cancel scaling, rotation, mirror image, tool length and a dynamic work offset (G54.2, G254), and state the "
    "words that do it (reset, trafoof, cycle800, off); check the names of the position variables (contact and contact_frame, "
    "position, machine_position). A control that says contact where nothing was met may show the same text: state met. So does one "
    "that reads positions ahead of its moves: state wait. Where positions come in inches, state position_unit: inch; where the "
    "post has no such key, the control has to give them in mm",
    judge,
    re.compile(
        r"OFFSET|UNITS|INCHES|POSITIONS ARE IN MM|FRAME|MACHINE COORDINATES|MET SOMETHING|MISFIT|DOES NOT FIT|LATCHED|OLD ONE|"
        r"TRIPPED ON THE WAY|CANCEL (TOOL|G(?!51))|UNEXPECTED PROBE CONTACT|ROTATED|G68 IS ON"
    ),
    re.compile(
        r"^(reset|length_check|off|trafoof|cycle800|plane_reset|tcpm_reset|positioning_feed|axis_numbers|machine_position|"
        r"position|contact|contact_frame|machine_frame|frame_check|metric_check|programmed_position|machine_axes) =|"
        r"differ by constants|machine coordinates|millimetres|machine positions?|positions of the axes|#24301|"
        r"work positions|work coordinates|"
        r"those of Fanuc|text of TCH PROBE 4|^cycles 7 8 10 11|SUPA and MEAS|where the axes (are|stand)"
    ),
    rests=(
        "wait",
        "reset",
        "length_check",
        "axis_numbers",
        "position_unit",
        "decimals",
        "trafoof",
        "cycle800",
        "plane_reset",
        "tcpm_reset",
        "off",
        "contact",
        "contact_frame",
        "position",
        "machine_position",
        "programmed_position",
        "machine_frame",
        "frame_check",
        "metric_check",
        "machine_axes",
    ),
    unrecorded=TURNED_ROUND,
)
