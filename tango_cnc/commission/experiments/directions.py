"""X, Y and Z move the way machine.yaml says: a person has to say so."""

from __future__ import annotations

import re

from ..experiment import Experiment, answered

EXPERIMENT = Experiment(
    "directions",
    1,
    "X, Y and Z move the way machine.yaml says",
    "look at the machine while the program runs",
    "correct direction of that axis in machine.yaml",
    answered("directions"),
    settles=re.compile(r"(?!)"),
    question="Did the slow move take the probe away from the table?",
)
