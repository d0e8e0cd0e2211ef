"""Records arrive whole: digits, decimal points and letters are those that the reader expects."""

from __future__ import annotations

import re

import numpy as np

from ..digits import lost
from ..experiment import Experiment, Seen, Verdict

COARSE = (1.0, 0.1, 0.01)  # mm: steps of positions that are useless here; 0.0001 inch is none of them
FEW = 6  # numbers that a step has to be seen in


def judge(seen: Seen) -> Verdict:
    """→ FAIL where a line came that is no record."""
    if seen.refused and not lost(seen):  # else that is what has to be mended: widths
        return Verdict("FAIL", f"not a record: {seen.refused[0]!r}", float(len(seen.refused)), "lines")
    if not seen.records:
        return Verdict("OPEN", "nothing was recorded")
    if step := coarse(seen):
        return Verdict("FAIL", f"positions come in steps of {step:g} mm; allowed: 0.001 mm or finer", step, "mm")
    return Verdict("PASS", f"{len(seen.records)} records read", float(len(seen.records)), "records")


def coarse(seen: Seen) -> float | None:
    """→ mm between two positions that the control can store, where that is a step of `COARSE`, the largest of them; else None.

    Recorded places are multiples of it, and the places that the axes were sent to are not.
    """
    names, linear = seen.plan.machine.names, seen.plan.machine.linear
    pairs = [
        (seen.records[touch.number][1][name], touch.end[names.index(name)])
        for touch in seen.plan.touches
        if touch.number in seen.records
        for name in linear
    ]
    recorded, sent = np.array(pairs).T
    for step in COARSE:
        off = [np.abs(values - step * np.round(values / step)) for values in (recorded, sent)]
        if len(pairs) >= FEW and off[0].max() < 1e-6 and np.count_nonzero(off[1] > step / 20) >= FEW // 2:
            return step
    return None


EXPERIMENT = Experiment(
    "records",
    3,
    "numbers come with a decimal point, all their digits and a sum that is right",
    "look at the first line that the control prints",
    "where the steps are too coarse, the increment system of the control (IS-B or finer on a Fanuc); "
    "else set the control to a decimal point; state print_format, places, conversion or output; "
    "check line ends and parity of the port",
    judge,
    re.compile(r"IDENTIFIERS|FORMAT ERROR"),
    settles=re.compile(r"DPRNT|SPRINT|^print_format|^places|^conversion|^output|PUT of a number|decimal point|mask|#WRITE"),
    rests=("print_format", "places", "conversion", "output", "mask", "readings", "log"),
    on=("port",),
)
