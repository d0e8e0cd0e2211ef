"""The control takes the time that moves need: reading blocks, waiting and drip-feeding add little to it."""

from __future__ import annotations

from ..experiment import Experiment, Ruling, Seen
from ..timing import expected

LIMIT = 5.0  # s a touch beside what its moves need
SLOWER = 1.5  # times what was expected
FASTER = 0.5  # of what was expected: no machine makes these moves in less


def judge(seen: Seen) -> Ruling:
    """→ s a touch beside what its moves need, from the first record to the last one."""
    came = sorted(seen.times)
    if len(came) < 2:
        return Ruling("OPEN", "fewer than two records have come")
    needed = expected(seen.plan, seen.feed)
    planned = sum(needed[number] for number in came[1:])
    took = seen.times[came[-1]] - seen.times[came[0]]
    each = (took - planned) / (len(came) - 1)
    numbers = f"{took:.0f} s from the first record to the last, {planned:.0f} s expected"
    if each > LIMIT and took > SLOWER * planned:
        return Ruling("FAIL", f"a touch takes {each:.1f} s more than its moves need: {numbers}", each, "s a touch")
    if took < FASTER * planned:
        return Ruling("OPEN", f"{numbers}: faster than the program asked for; a dry run, or a control that moves nothing?")
    return Ruling("PASS", numbers, each, "s a touch")


EXPERIMENT = Experiment(
    "pace",
    4,
    "a touch takes the time of its moves: the control loses little between blocks",
    "compare the time of a touch with the prediction of 'tango plan'",
    "turn rapid and feed override to 100 %, single block and dry run off; where the program is drip-fed, a faster line, or run it "
    "from memory; correct rapid, acceleration and clamp_time in machine.yaml. What is left is the control's own: state it as "
    "overhead in machine.yaml, s a touch; predicted times and the patience of 'tango run' go by it",
    judge,
    rests=("wait",),
    on=("port", "overhead"),
)
