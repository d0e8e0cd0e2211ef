"""The machine as a state that is followed from night to night.

    last night ──predict──▶ tonight before the touches ──judge──▶ one decision ──update──▶ tonight

`frame` says what is followed, `filter` carries it in square-root form, `rates` learns how fast it wanders, `naming`
says what changed, `within` and `warming` what changed while it was measured, `choose` which touches tell most tonight, `charts` are
the control charts of old.
"""

from .choose import Choice, choose
from .filter import NOISY, Alone, State, Tonight, as_scattered, grown, judge, predicted, reopened, start, updated
from .frame import Frame, Seen, frame, seen
from .naming import Hypothesis, Named, hypotheses, name_change
from .rates import learn
from .smooth import smoothed
from .warming import warmed
from .within import Within, stepped

__all__ = [
    "NOISY",
    "Alone",
    "Choice",
    "Frame",
    "Hypothesis",
    "Named",
    "Seen",
    "State",
    "Tonight",
    "Within",
    "as_scattered",
    "choose",
    "frame",
    "grown",
    "hypotheses",
    "judge",
    "learn",
    "name_change",
    "predicted",
    "reopened",
    "seen",
    "smoothed",
    "start",
    "stepped",
    "updated",
    "warmed",
]
