"""Records arrive whole: digits, decimal points and letters are those that the reader expects."""

from __future__ import annotations

import re

from ..experiment import Experiment, Seen, Verdict


def judge(seen: Seen) -> Verdict:
    """→ FAIL where a line came that is no record."""
    if seen.refused:
        return Verdict("FAIL", f"not a record: {seen.refused[0]!r}", float(len(seen.refused)), "lines")
    if not seen.records:
        return Verdict("OPEN", "nothing was recorded")
    return Verdict("PASS", f"{len(seen.records)} records read", float(len(seen.records)), "records")


EXPERIMENT = Experiment(
    "records",
    3,
    "numbers come with a decimal point, all their digits and a sum that is right",
    "look at the first line that the control prints",
    "set the control to a decimal point; state print_format, places, conversion or output; check line ends and parity of the port",
    judge,
    re.compile(r"IDENTIFIERS|FORMAT ERROR"),
    settles=re.compile(r"DPRNT|SPRINT|^print_format|^places|^conversion|^output|PUT of a number|decimal point|mask|#WRITE"),
    rests=("print_format", "places", "conversion", "output", "mask", "readings", "log"),
    on=("port",),
)
