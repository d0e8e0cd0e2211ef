"""Records arrive whole: digits, decimal points and letters are those that the reader expects."""

from __future__ import annotations

import re

import numpy as np

from ..digits import lost, pointless
from ..experiment import Experiment, Ruling, Seen

COARSE = 0.004  # mm: steps of positions from here on are useless; 0.0001 inch is none of them
USUAL = (1.0, 0.5, 0.25, 0.2, 0.125)  # steps in powers of ten of mm and of inches, which rounded records still show
EXACT = 1e-6  # mm
FEW = 6  # numbers that a step has to be seen in
FINE = 0.001  # mm: by so much a fine control may round


def judge(seen: Seen) -> Ruling:
    """→ FAIL where a line came that is no record."""
    if seen.refused and not lost(seen):  # else that is what has to be mended: widths
        return Ruling("FAIL", f"not a record: {seen.refused[0]!r}", float(len(seen.refused)), "lines")
    if not seen.records:
        return Ruling("OPEN", "nothing was recorded")
    if found := pointless(seen):
        return Ruling("FAIL", f"{next(iter(found.values()))}: the decimal point is lost", float(len(found)), "records")
    if step := coarse(seen):
        return Ruling("FAIL", f"positions come in steps of {step:.5g} mm; allowed: 0.001 mm or finer", step, "mm")
    return Ruling("PASS", f"{len(seen.records)} records read", float(len(seen.records)), "records")


def coarse(seen: Seen) -> float | None:
    """→ mm between two positions that the control can store, where that is `COARSE` or more, the largest of them; else None.

    Recorded places are multiples of it, and axes are beside where they were sent by parts of it. Of few places of a fine control
    all may be multiples of something; but these are where they were sent to.
    """
    names, linear = seen.plan.machine.names, seen.plan.machine.linear
    pairs = [
        (seen.records[touch.number][1][name], touch.end[names.index(name)])
        for touch in seen.plan.touches
        if touch.number in seen.records
        for name in linear
    ]
    if len(pairs) < FEW:
        return None
    recorded, sent = np.array(pairs).T
    apart = np.diff(np.unique(recorded))
    apart = apart[apart > EXACT]
    least = float(apart.min()) if len(apart) else 0.0  # a whole number of steps
    parts = least / np.arange(1, int(least / COARSE + EXACT) + 1)
    usual = [unit * share * 10.0**-power for unit in (1.0, 25.4) for share in USUAL for power in range(4)]
    digit = next((d for d in (0.01, 0.001, 0.0001) if _off(recorded, d).max() < EXACT), 0.0)
    off = np.abs(recorded - sent)
    for step in sorted({*parts.tolist(), *(s for s in usual if s >= COARSE)}, reverse=True):
        rounded = digit / 2 if digit < step / 5 and _off(np.array([step]), digit or step)[0] > EXACT else 0.0
        if _off(recorded, step).max() < rounded + EXACT and np.count_nonzero((off > FINE) & (off < step / 2 + FINE)) >= FEW // 2:
            return float(step)
    return None


def _off(values: np.ndarray, step: float) -> np.ndarray:
    """(n,) mm, mm → (n,) mm to the nearest multiple of the step."""
    return np.asarray(np.abs(values - step * np.round(values / step)))


EXPERIMENT = Experiment(
    "records",
    3,
    "numbers come with a decimal point, all their digits and a sum that is right",
    "look at the first line that the control prints",
    "where the steps are too coarse, the increment system of the control (IS-B or finer on a Fanuc); "
    "else set the control to a decimal point; state print_format, places, conversion or output; "
    "check line ends and parity of the port",
    judge,
    re.compile(r"IDENTIFIERS|FORMAT ERROR|DECIMAL COMMA"),
    settles=re.compile(r"DPRNT|SPRINT|^print_format|^places|^conversion|^output|PUT of a number|decimal point|mask|#WRITE"),
    rests=("print_format", "places", "conversion", "output", "mask", "readings", "log"),
    on=("port",),
    raw=True,
)
