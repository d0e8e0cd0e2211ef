"""The position of a contact is that of the trigger, not that after the stop: a facet is touched at two feeds."""

from __future__ import annotations

from ..experiment import Experiment, Ruling, Seen

LIMIT = 0.002  # s; a control that samples its probe once a millisecond is right


def judge(seen: Seen) -> Ruling:
    """→ ms by which a position is read late, from touches of the same facets at two feeds."""
    if seen.late is None:
        return Ruling("OPEN", "no facet was touched at two feeds: tango commission --touch")
    ms = 1000.0 * seen.late
    if abs(seen.late) > LIMIT:
        return Ruling("FAIL", f"positions are those of {ms:.1f} ms after the trigger: they change with the feed", ms, "ms")
    return Ruling("PASS", f"positions are those of the trigger, within {abs(ms):.2f} ms", ms, "ms")


EXPERIMENT = Experiment(
    "latched",
    3,
    "the position of a contact is the one at the trigger, not the one after the stop",
    "touch one facet slowly and fast: it is found in the same place",
    "state contact, the variables that are stored at the trigger; the probe has to be at the fast input of the control. Where "
    "there is none, touch slowly, and all touches at the same feed",
    judge,
    rests=("contact", "position", "contact_frame", "skip", "probe_input"),
    touches=True,
)
