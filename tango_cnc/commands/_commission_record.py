"""A record as `tango commission` reads it, more leniently than a run: what comes without its decimal point shows something, too."""

from __future__ import annotations

import re

from ..records import Plan

WORD = re.compile(r"([A-Z]) *([+-]? *\d*\.?\d+)")
SUMS = 0.01  # mm: coordinates of a record and their sum K, all rounded


def record_of(text: str, made: Plan) -> tuple[int, int, dict[str, float]] | None:
    """line of a record → touch, flag, {axis: mm or deg}; None for a line that is no record of this plan, or whose sum is wrong."""
    values = {letter: float(value.replace(" ", "")) for letter, value in WORD.findall(text)}
    wanted = [*made.machine.linear, *made.machine.rotary]
    if not {"P", "H", *wanted} <= set(values) or "," in text or values["P"] not in {touch.number for touch in made.touches}:
        return None
    if "K" in values and abs(sum(values[name] for name in (*wanted, "S") if name in values) - values["K"]) > SUMS:
        return None
    return int(values["P"]), int(values["H"]), {name: values[name] for name in wanted}
