"""A touch is made at the feed of the plan whatever the feed override says: the same moves with the dial at 25 %."""

from __future__ import annotations

from ..experiment import DIAL, Experiment, Ruling, Seen
from ..timing import search

ENOUGH = 0.5  # of what a move would take longer, or of its own time: nothing else on the way is as long


def judge(seen: Seen) -> Ruling:
    """→ s that a measuring move takes longer with the feed override at `DIAL`."""
    if seen.dialled is None:
        return Ruling("OPEN", "nobody turned the feed override")
    came = sorted(seen.times.keys() & seen.dialled.keys())
    if len(came) < 2:
        return Ruling("OPEN", "fewer than two moves were made with the feed override turned")
    usual, turned = ((times[came[-1]] - times[came[0]]) / (len(came) - 1) for times in (seen.times, seen.dialled))
    alone, longer = search(seen.plan), turned - usual
    if usual < ENOUGH * alone:
        return Ruling("OPEN", f"records come every {usual:.1f} s, faster than the moves: their times say nothing")
    if longer > ENOUGH * alone * (1 / DIAL - 1):
        text = f"at {100 * DIAL:.0f} % a move took {turned:.1f} s instead of {usual:.1f} s"
        if seen.obeys:
            return Ruling("PASS", f"the feed override acts on measuring moves, as the profile says: {text}", longer, "s a touch")
        return Ruling("FAIL", f"the feed override acts on measuring moves: {text}", longer, "s a touch")
    return Ruling("PASS", f"a move takes {usual:.1f} s, and {turned:.1f} s at {100 * DIAL:.0f} %", longer, "s a touch")


EXPERIMENT = Experiment(
    "feed",
    3,
    "the feed override of the panel does not change the feed of a measuring move",
    "turn the feed override to 25 % and look at a slow move in the air: it takes as long as before",
    "state feed_override: acts. Then every program and 'tango run' ask for an override of 100 %, because a touch at another feed "
    "is found in another place. A word that takes it out of the operator's hand goes into reset, where the profile has that key",
    judge,
    rests=("reset", "skip", "contact", "feed_override"),
)
