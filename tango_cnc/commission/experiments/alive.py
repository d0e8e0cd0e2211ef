"""A finger at the stylus stops the slow move: probe, skip word and skip input are right."""

from __future__ import annotations

import re

from ..experiment import Experiment, Ruling, Seen


def judge(seen: Seen) -> Ruling:
    """→ PASS where anything was recorded: nothing is, before the finger has been noticed."""
    if seen.records or seen.ended:
        return Ruling("PASS", "the finger stopped the slow move")
    if seen.unheard:
        return Ruling("FAIL", "the slow move went on although the stylus was touched")
    if not seen.begun:
        return Ruling("OPEN", "the program has not begun: no start mark has come")
    if seen.said:
        return Ruling("OPEN", f"the program stopped before anything was recorded: {seen.said}")
    return Ruling("OPEN", "the program stopped before anything was recorded, and nobody has passed on what the screen shows")


EXPERIMENT = Experiment(
    "alive",
    1,
    "the skip signal of the probe stops the skip move",
    "touch the stylus while the probe moves up slowly: the axis has to stop",
    "look at battery, receiver and cable; state probe_on; state skip (G31 P1 … P4) or probe_input for the input it is wired to. "
    "Where the signal is on while nobody touches the stylus, turn its polarity round at the control or at the receiver",
    judge,
    re.compile(
        r"NOT TOUCHED|NO FINGER|NO CONTACT(?!\))|NO PROBE CONTACT|P601|MULTI STEP SKIP|PROBE IS DEFLECTED|SIGNAL IS ON|"
        r"ALREADY IN CONTACT"
    ),
    re.compile(
        r"^skip =|^control =|^distance =|#9011 is the input|text of TCH PROBE 4|subprograms may stand|"
        r"^probe_on =|^probe_input =|a probe that is off stops nothing|ends at the contact"
    ),
    rests=("skip", "probe_on", "probe_input", "distance", "alarm"),
)
