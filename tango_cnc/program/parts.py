"""Plan → the parts that become programs: of as many touches as asked for, or as few parts as the control's memory lets be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import postprocessors as posts

from .. import plan as planner
from ..records import InputError, Plan

KB = 1000  # characters
LINE_END = 2  # characters, as on a share or over a serial line


def parts(post: posts.Post, whole: Plan, options: Mapping[str, Any], most: int | None = None) -> tuple[Plan, ...]:
    """post, plan, `controller` keys, touches a program may make → the parts of the plan in their order, often the whole alone.

    Without `most` no program is longer than `memory` of the profile, where the post has one. Raises InputError where an
    indexation alone is longer, and for options and numbers that cannot be written.
    """
    if most is not None:
        return planner.split(whole, most)
    room = posts.settings(post, options).get("memory", "none")
    if room == "none":
        return (whole,)
    found: tuple[Plan, ...] = (whole,)
    most = len(whole.touches)
    while (largest := max(sizes := _sizes(post, whole, options, found))) > room * KB:
        longest = found[sizes.index(largest)]
        if not planner.can_be_cut(longest):
            first, last = longest.touches[0].number, longest.touches[-1].number
            raise InputError(
                f"controller.memory: found {room} kB; touches {first} … {last} are of one indexation, which is never cut, and take "
                f"{-(-largest // KB)} kB; allowed: that at least, or none where the program is drip-fed or runs from a disk"
            )
        most = max(1, min(most - 1, len(longest.touches) * room * KB // largest))
        found = planner.split(whole, most)
    return found


def _sizes(post: posts.Post, whole: Plan, options: Mapping[str, Any], found: tuple[Plan, ...]) -> list[int]:
    """→ characters of each program, line ends with them."""
    mark, many = planner.plan_hash(whole), len(found)
    given = [posts.of_part(post, options, (number, many), whole.machine.stylus) for number in range(1, many + 1)]
    return [posts.length(post, plan, given[number - 1], mark, (number, many), LINE_END) for number, plan in enumerate(found, 1)]
