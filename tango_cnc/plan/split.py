"""A long plan → several that are complete each: cut between indexations only, where the probe is clear of everything."""

from __future__ import annotations

from itertools import groupby

from ..records import InputError, Plan
from .build import of_rows


def split(whole: Plan, most: int) -> tuple[Plan, ...]:
    """plan, touches that one program may make → its parts in their order, each with its own safe way in and out.

    Touches keep their numbers. An indexation is never cut: one with more touches than that is a part of its own.
    Raises InputError for less than one touch.
    """
    if most < 1:
        raise InputError(f"split: found {most}; allowed: 1 touch a program or more")
    parts: list[list[int]] = []
    poses = (whole.strategy.indexations[touch.indexation].position for touch in whole.touches)
    for _, found in groupby(enumerate(poses), key=lambda item: item[1]):
        rows = [row for row, _ in found]
        if parts and len(parts[-1]) + len(rows) <= most:
            parts[-1] += rows
        else:
            parts.append(rows)
    return (whole,) if len(parts) == 1 else tuple(of_rows(whole, rows) for rows in parts)
