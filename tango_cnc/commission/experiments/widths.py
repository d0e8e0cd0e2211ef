"""A number of a record has room for all its digits: some controls drop those that do not fit, without a word."""

from __future__ import annotations

from ..digits import lost
from ..experiment import Experiment, Ruling, Seen


def judge(seen: Seen) -> Ruling:
    """→ FAIL where a recorded number is the end of the one that was sent; OPEN where the run has longer numbers than the air."""
    if found := lost(seen):
        return Ruling("FAIL", f"{next(iter(found.values()))}: digits are lost", float(len(found)), "records")
    if not seen.records:
        return Ruling("OPEN", "nothing was recorded")
    largest = max(abs(value) for _, place in seen.records.values() for value in place.values())
    shown, needed = digits(largest), digits(seen.largest)
    if shown < needed:
        return Ruling("OPEN", f"the run has numbers of {needed} digits before the point, the moves in the air of {shown} only")
    return Ruling("PASS", f"numbers of {shown} digits before the point are whole", float(shown), "digits")


def digits(value: float) -> int:
    """mm or deg → digits before the point."""
    return len(str(int(abs(value))))


EXPERIMENT = Experiment(
    "widths",
    3,
    "a number of a record has room for all its digits before the point",
    "compare the longest number of a record with the position on the display",
    "state print_format, conversion or places with room for more digits before the point (Fanuc: 44 has four, 53 has five)",
    judge,
    rests=("print_format", "places", "conversion", "decimals", "mask"),
)
