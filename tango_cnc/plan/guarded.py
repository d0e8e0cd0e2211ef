"""Whether a plan that somebody has changed still keeps off what is declared on the machine."""

from __future__ import annotations

from ..records import Plan
from . import guard
from .places import scene


def refuse(plan: Plan) -> None:
    """plan → nothing. Raises InputError for a move that is not proven to keep off the obstacles of machine.yaml, by name."""
    if plan.machine.obstacles:
        guard.refuse(plan, scene(plan.machine, plan.artefact, plan.strategy).guard)
