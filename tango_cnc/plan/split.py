"""A long plan → several that are complete each: cut between indexations only, where the probe is clear of everything."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..records import InputError, Plan
from .build import of_rows, planned


def split(whole: Plan, most: int) -> tuple[Plan, ...]:
    """plan, touches that one program may make → its parts in their order, each with its own safe way in and out.

    Touches keep their numbers. An indexation is never cut: one with more touches than that is a part of its own.
    Raises InputError for less than one touch.
    """
    if most < 1:
        raise InputError(f"split: found {most}; allowed: 1 touch a program or more")
    at = planned(whole).indexation
    position = [indexation.position for indexation in whole.strategy.indexations]
    changes = (row for row in (1 + np.flatnonzero(np.diff(at))).tolist() if position[at[row - 1]] != position[at[row]])
    ends = [0]  # of the parts, the first of which begins at 0
    for end in (*changes, len(at)):
        if len(ends) > 1 and end - ends[-2] <= most:
            ends[-1] = end
        else:
            ends.append(end)
    return (whole,) if len(ends) == 2 else tuple(of_rows(whole, np.arange(*rows)) for rows in pairwise(ends))
