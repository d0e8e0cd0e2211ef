"""Feed hold stops a probing move: a person has to say so."""

from __future__ import annotations

from ...records import Plan
from ..experiment import Experiment, Question, answered


def asks(plan: Plan) -> dict[str, Question]:
    """plan in the air → the one question; the first move at least is one to try it on."""
    text = "Did feed hold, pressed during a slow move in the air, stop it at once?"
    return {"feed hold": Question(text, (plan.touches[0].number,))}


EXPERIMENT = Experiment(
    "override",
    3,
    "feed hold stops a probing move",
    "press feed hold during a slow move in the air, then start again",
    "find the parameter that lets feed hold act on skip moves before anything is touched",
    answered("override", asks),
    asks=asks,
)
