"""Rotary axes turn in the sense that machine.yaml says: a person has to say so."""

from __future__ import annotations

import re

from ..experiment import Experiment, answered

EXPERIMENT = Experiment(
    "sense",
    2,
    "rotary axes turn in the sense that machine.yaml says",
    "look at the machine while the program runs",
    "correct direction of that axis in machine.yaml",
    answered("sense"),
    settles=re.compile(r"(?!)"),
    question="Did every rotary axis turn in the sense that machine.yaml says (counterclockwise about + of its direction is plus)?",
)
