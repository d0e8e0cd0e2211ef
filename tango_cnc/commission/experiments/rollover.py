"""350° to 10°: an axis with limits turns back by 340°, and not on over 360°; a person has to say so, axis by axis."""

from __future__ import annotations

from ...records import Plan
from ..experiment import Experiment, Question, Ruling, Seen, answered
from ..rolling import limited, rolled


def asks(plan: Plan) -> dict[str, Question]:
    """plan in the air → one question for each rotary axis that goes from 350° to 10° in it."""
    return rolled(plan)


def judge(seen: Seen) -> Ruling:
    """→ the answer of the person for each axis with limits; PASS for a machine without such an axis."""
    axes = [axis.name for axis in seen.plan.machine.axes if limited(axis)]
    if not axes:
        return Ruling("PASS", "no rotary axis with limits reaches 350 deg; one without may turn either way")
    if left := [name for name in axes if name not in asks(seen.plan)]:
        return Ruling("OPEN", f"the plan in the air has no turn of {', '.join(left)} from 350 to 10 deg")
    return answered("rollover", asks)(seen)


EXPERIMENT = Experiment(
    "rollover",
    3,
    "a rotary axis with limits turns the way that its numbers go: from 350 to 10 deg it turns back by 340 deg",
    "look at the turn from 350 to 10 deg: the long way",
    "where the axis has no limits, state endless: true in place of its travel in machine.yaml. Else state nearer: true for it "
    "there: every turn of half a turn or more is then made in steps, which go the way of the numbers on every control",
    judge,
    asks=asks,
    rests=("rollover", "rotary", "shortest", "wrapped"),
    on=("rotary",),
)
