"""A measuring move that meets nothing says so."""

from __future__ import annotations

import re

from ..experiment import Experiment, Ruling, Seen


def judge(seen: Seen) -> Ruling:
    """→ FAIL where a move in the air is recorded as a contact."""
    wrong = sorted(number for number, (flag, _) in seen.records.items() if flag != 0)
    if wrong:
        return Ruling("FAIL", f"touch {wrong[0]} in the air is recorded as a contact", float(len(wrong)), "touches")
    if not seen.records:
        return Ruling("OPEN", "nothing was recorded")
    return Ruling("PASS", f"{len(seen.records)} moves in the air are recorded as misses", float(len(seen.records)), "touches")


EXPERIMENT = Experiment(
    "miss",
    2,
    "a measuring move that meets nothing goes on without an alarm, and the program distinguishes it from a contact",
    "look at the flag H of the records in the air: 0",
    "where the control makes an alarm of a miss, its parameter has to allow one; check contact and met",
    judge,
    re.compile(r"DID NOT DETECT|INACCESSIBLE|NOT TRIGGERED|SKIP NOT REACHED|\(NO CONTACT\)|SAYS CONTACT"),
    re.compile(r"meets nothing|text of TCH PROBE 4|nothing is met|goes on when nothing|^met ="),
    rests=("skip", "probe_input", "met", "contact", "distance"),
)
