"""The spindle stands at the angle that it was told: a person has to say so."""

from __future__ import annotations

import re

from ...records import Plan
from ..experiment import Experiment, Question, answered


def asks(plan: Plan) -> dict[str, Question]:
    """plan in the air → the one question, about the whole of it."""
    text = "Did the spindle stand still at its angle while the probe moved, and turn where the program turns it?"
    return {"spindle": Question(text, tuple(touch.number for touch in plan.touches))}


EXPERIMENT = Experiment(
    "orientation",
    3,
    "the spindle stands at the commanded angle",
    "look at the spindle while the program runs",
    "state orient, or leave orient empty (Siemens, Heidenhain, LinuxCNC: false) with one spindle angle in strategy.yaml",
    answered("orientation", asks),
    asks=asks,
    settles=re.compile(r"^orient|TRACK of the probe table"),
    rests=("orient", "orient_time"),
)
