"""A long plan → several that are complete each: cut between indexations only, where the probe is clear of everything."""

from __future__ import annotations

from itertools import groupby

from ..records import InputError, Plan, Touch
from .build import of_touches


def split(whole: Plan, most: int) -> tuple[Plan, ...]:
    """plan, touches that one program may make → its parts in their order, each with its own safe way in and out.

    Touches keep their numbers. An indexation is never cut: one with more touches than that is a part of its own.
    Raises InputError for less than one touch.
    """
    if most < 1:
        raise InputError(f"split: found {most}; allowed: 1 touch a program or more")
    parts: list[list[Touch]] = []
    for _, found in groupby(whole.touches, key=lambda touch: whole.strategy.indexations[touch.indexation].position):
        touches = list(found)
        if parts and len(parts[-1]) + len(touches) <= most:
            parts[-1] += touches
        else:
            parts.append(touches)
    return (whole,) if len(parts) == 1 else tuple(of_touches(whole, touches) for touches in parts)
