"""The spindle stands at the angle that it was told: a person has to say so."""

from __future__ import annotations

import re

from ..experiment import Experiment, answered

EXPERIMENT = Experiment(
    "orientation",
    3,
    "the spindle stands at the angle that it was told",
    "look at the machine while the program runs",
    "state orient, or orient: false with one spindle angle in strategy.yaml",
    answered("orientation"),
    settles=re.compile(r"^orient"),
    question="Did the spindle turn to its angle and stand still while the probe moved?",
)
