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
    ends = [0]  # of the parts, the first of which begins at 0
    for end in _cuts(whole):
        if len(ends) > 1 and end - ends[-2] <= most:
            ends[-1] = end
        else:
            ends.append(end)
    return (whole,) if len(ends) == 2 else tuple(of_rows(whole, np.arange(*rows)) for rows in pairwise(ends))


def can_be_cut(whole: Plan) -> bool:
    """plan → whether `split` makes more than one part of it, however few touches a program may make."""
    return len(_cuts(whole)) > 1


def _cuts(whole: Plan) -> list[int]:
    """plan → rows before which it may be cut, and the number of its touches at the end."""
    at = planned(whole).indexation
    position = [indexation.position for indexation in whole.strategy.indexations]
    changes = [row for row in (1 + np.flatnonzero(np.diff(at))).tolist() if position[at[row - 1]] != position[at[row]]]
    return [*changes, len(at)]
