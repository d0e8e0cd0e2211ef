"""Plan in the air → how long each of its moves should take, from one record to the next."""

from __future__ import annotations

from ..duration import of_moves
from ..records import Plan


def expected(plan: Plan, feed: float) -> dict[int, float]:
    """plan in the air, mm/min of guarded moves → {touch: s from the record before it to its own}; nothing stops a move there."""
    found = dict.fromkeys((touch.number for touch in plan.touches), search(plan) + plan.machine.overhead)
    for move, seconds in zip(plan.moves, of_moves(plan, feed), strict=True):
        if move.kind != "probe":
            found[move.touch] += seconds
    return found


def search(plan: Plan) -> float:
    """plan in the air → s of one measuring move."""
    approach = plan.strategy.approach
    return (approach.standoff + approach.search) / (approach.feed / 60)
