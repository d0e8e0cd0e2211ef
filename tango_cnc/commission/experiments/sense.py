"""Rotary axes turn in the sense that machine.yaml says: a person has to say so, axis by axis."""

from __future__ import annotations

from ...records import Plan
from ..experiment import Experiment, Question, answered
from ..flight import turning


def asks(plan: Plan) -> dict[str, Question]:
    """plan in the air → one question for each rotary axis that it turns."""
    return turning(plan)


EXPERIMENT = Experiment(
    "sense",
    2,
    "rotary axes turn in the sense that machine.yaml says",
    "look at each turn: counterclockwise where the direction of machine.yaml points at you is plus",
    "correct direction of the axis that is named in machine.yaml",
    answered("sense", asks),
    asks=asks,
    rests=("rollover", "rotary", "shortest", "wrapped"),
    on=("rotary",),
)
