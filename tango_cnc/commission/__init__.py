"""What is believed of a control, tried on it high above the table: a plan in the air, and what its records prove.

`experiments/` has one file an experiment; `flight.py` makes the plan that all of them share, `verdicts.py` turns what came of it
into proofs, `keys.py` says how long each of them holds.
"""

from .experiment import DIAL, Experiment, Question, Ruling, Seen
from .flight import HELD_FEED, MOST, UNTRIED_FEED, air, held
from .keys import keys
from .rolling import rolling
from .touching import late, pivots, quicker, touching
from .verdicts import Judged, answerable, by_danger, experiments, judge, questions, remaining, stopped_by

__all__ = [
    "DIAL",
    "HELD_FEED",
    "MOST",
    "UNTRIED_FEED",
    "Experiment",
    "Judged",
    "Question",
    "Ruling",
    "Seen",
    "air",
    "answerable",
    "by_danger",
    "experiments",
    "held",
    "judge",
    "keys",
    "late",
    "pivots",
    "questions",
    "quicker",
    "remaining",
    "rolling",
    "stopped_by",
    "touching",
]
