"""A night that broke off: the control's own sentence comes first, and no guess beside it."""

from __future__ import annotations

from collections.abc import Sequence

from ..report.look import keys
from ..texts import say, unstopped

BY_USER = "stopped by"
EXPLAINED = (  # reasons that say no more than that touches are missing, and guess why
    "look.plausible.readings.planned_touches_missing_made_no",
    "look.plausible.judge.few_to_spare",
)


def stopped(why: str, made: int, planned: int) -> str:
    """why it broke off, as the connection says it, touches made and planned → the first reason not to believe the night."""
    first = unstopped(why.partition(". ")[0])
    key = "by_user" if first.startswith(BY_USER) else "broke_off"
    return say(f"night.broken.{key}", why=first, made=made, planned=planned)


def unexplained(reasons: Sequence[str]) -> list[str]:
    """reasons → those that the end of the run does not explain."""
    return [reason for reason in reasons if not any(key in EXPLAINED for key in keys(reason))]
