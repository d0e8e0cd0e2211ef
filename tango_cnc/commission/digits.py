"""Digits before the point that a control drops without a word: −412.5 is recorded as −12.5."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from ..records import Plan
from .experiment import Seen

WORD = re.compile(r"([A-Z]) *([+-]? *\d*\.?\d+)")
SAME = 0.05  # mm or deg
FIELDS = (10.0, 100.0, 1000.0, 10_000.0)  # what a field of 1 to 4 digits cannot hold


def clipped(plan: Plan, number: int, place: Mapping[str, float]) -> str:
    """plan, touch, {axis: recorded mm or deg} → a sentence that names the number with lost digits; empty where all digits came."""
    touch = next((touch for touch in plan.touches if touch.number == number), None)
    if touch is None:
        return ""
    for name in (*plan.machine.linear, *plan.machine.rotary):
        sent = touch.end[plan.machine.column(name)]
        sent = math.degrees(sent) if name in plan.machine.rotary else sent
        for most in FIELDS:
            left = math.copysign(abs(sent) % most, sent)
            if name in place and abs(sent) >= most and abs(place[name] - left) < SAME < abs(place[name] - sent):
                return f"{name} of move {number} was sent to {sent:.3f} and is recorded as {place[name]:g}"
    return ""


def lost(seen: Seen) -> dict[int, str]:
    """what came → {touch: sentence on lost digits}, for records, and for lines whose sum is wrong because of them."""
    found = {number: clipped(seen.plan, number, place) for number, (_, place) in seen.records.items()}
    found |= {number: clipped(seen.plan, number, place) for number, place in refused(seen)}
    return {number: text for number, text in found.items() if text}


def refused(seen: Seen) -> Iterator[tuple[int, Mapping[str, float]]]:
    """what came → touch and {letter: number} of each line that was refused and has numbers."""
    for line in seen.refused:
        if "," not in line and "P" in (values := {k: float(v.replace(" ", "")) for k, v in WORD.findall(line)}):
            yield int(values["P"]), values
