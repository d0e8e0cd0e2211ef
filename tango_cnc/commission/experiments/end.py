"""The program comes to its end: the end mark arrives, probe off and port closed."""

from __future__ import annotations

import re

from ..experiment import Experiment, Ruling, Seen


def judge(seen: Seen) -> Ruling:
    """→ PASS where the end mark has come; the number is the time of one block of moves."""
    many = len(seen.plan.touches)
    if seen.ended or seen.marked:
        each = seen.seconds / many if seen.seconds is not None else None
        return Ruling("PASS", "the end mark has come", each, "s a touch" if each is not None else "")
    if len(seen.records) == many:
        return Ruling("FAIL", "all records have come, and no end mark")
    return Ruling("OPEN", "the program did not get there")


EXPERIMENT = Experiment(
    "end",
    4,
    "the program comes to its end, switches the probe off and closes its port",
    "look whether the control is ready for the next program, and the probe dark",
    "look at what stands on the screen; check probe_off, and whether the port or the file of the records is closed",
    judge,
    settles=re.compile(r"^probe_off ="),
    rests=("probe_off", "output", "readings", "log"),
    on=("port",),
)
