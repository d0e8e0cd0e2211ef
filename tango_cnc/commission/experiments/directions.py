"""X, Y and Z move the way machine.yaml says: a person has to say so, axis by axis."""

from __future__ import annotations

from ...records import Plan
from ..experiment import Experiment, Question, answered
from ..flight import along


def asks(plan: Plan) -> dict[str, Question]:
    """plan in the air → one question for each linear axis that a move of it goes along."""
    return along(plan)


EXPERIMENT = Experiment(
    "directions",
    1,
    "X, Y and Z move the way machine.yaml says",
    "look at the moves in the air one by one: the first goes up, the others along one axis each, 5 mm",
    "correct direction of the axis that is named in machine.yaml",
    answered("directions", asks),
    asks=asks,
    on=("linear",),
)
