"""A move that begins with the stylus deflected does not go anywhere."""

from __future__ import annotations

import re

from ..experiment import Experiment, Ruling, Seen


def judge(seen: Seen) -> Ruling:
    """→ what came of the program while somebody held the stylus aside."""
    if seen.held is None:
        return Ruling("OPEN", "nobody held the stylus")
    if seen.held:
        return Ruling("PASS", "the program stopped while the stylus was held aside")
    return Ruling("FAIL", "the program went on although the stylus was held aside")


EXPERIMENT = Experiment(
    "deflected",
    1,
    "a skip move that begins with the probe deflected ends at once, or is an alarm",
    "hold the stylus aside and start the program of one move of 0.5 mm that tango commission writes for it (--held): it has to "
    "stop by itself. Feed hold ready; let go if it moves more than 1 mm",
    "what is looked at is not the input that the probe is wired to, or nothing looks: state probe_state, and probe_input where "
    "there are two, by what changes while the stylus is pushed aside. Where the control shows nothing, watch every run: a guarded "
    "move that begins deflected guards nothing",
    judge,
    settles=re.compile(r"deflected|^alarm =|IF and THEN|\$IF and|IF … THEN|DoOEMButton 1003|M125 cancels|^probe_state ="),
    rests=("skip", "probe_on", "probe_state", "probe_input", "distance", "alarm"),
)
