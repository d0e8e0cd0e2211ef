"""Feed hold stops a probing move; feed override does not: a person has to say so."""

from __future__ import annotations

import re

from ..experiment import Experiment, answered

EXPERIMENT = Experiment(
    "override",
    3,
    "feed hold stops a probing move; feed override does not",
    "look at the machine while the program runs",
    "find the parameter that lets feed hold act on skip moves before anything is touched",
    answered("override"),
    settles=re.compile(r"(?!)"),
    question="Did feed hold stop a slow move at once?",
)
