"""Numbers that a control spoils without a word: it drops digits before the point (−412.5 is recorded as −12.5), or the point."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from ..records import Plan
from .experiment import Seen

WORD = re.compile(r"([A-Z]) *([+-]? *\d*\.?\d+)")
SAME = 0.05  # mm or deg
LARGE = 1.0  # mm or deg: smaller numbers do not show a factor
EQUAL = 0.01  # relative: a factor that is so near a power of ten is one
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


def pointless(seen: Seen) -> dict[int, str]:
    """what came → {touch: sentence on a lost point}: its linear numbers are all one power of ten too large, its angles likewise."""
    machine, found = seen.plan.machine, dict[int, str]()
    for touch in seen.plan.touches:
        place = seen.records[touch.number][1] if touch.number in seen.records else {}
        sent = {n: touch.end[machine.column(n)] for n in machine.linear}
        turned = {n: math.degrees(touch.end[machine.column(n)]) for n in machine.rotary}
        powers = [_powers(kind, place) for kind in (sent, turned)]
        if any(powers) and all(len(each) <= 1 and 0 not in each for each in powers):
            name = max(sent, key=lambda n: abs(sent[n]))
            found[touch.number] = f"{name} of move {touch.number} was sent to {sent[name]:.3f} and is recorded as {place[name]:.0f}"
    return found


def _powers(sent: Mapping[str, float], place: Mapping[str, float]) -> set[int]:
    """{axis: mm or deg}, what was recorded → powers of ten by which numbers are too large; 0 for any other factor."""
    found = set()
    for name, value in sent.items():
        if name in place and abs(value) >= LARGE:
            factor = place[name] / value
            power = round(math.log10(factor)) if factor > 0 else 0
            found.add(power if power > 0 and abs(factor / 10.0**power - 1) < EQUAL else 0)
    return found


def refused(seen: Seen) -> Iterator[tuple[int, Mapping[str, float]]]:
    """what came → touch and {letter: number} of each line that was refused and has numbers."""
    for line in seen.refused:
        if "," not in line and "P" in (values := {k: float(v.replace(" ", "")) for k, v in WORD.findall(line)}):
            yield int(values["P"]), values
