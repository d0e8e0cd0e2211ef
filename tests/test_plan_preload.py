"""Stops a little short of where an axis goes: on which side, and how far."""

from __future__ import annotations

import pytest

from tango_cnc.plan.preload import ways
from tango_cnc.records import Axis


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        (50.0, [-9.0, 9.0]),  # room on both sides: below
        (4.0, [9.0, -4.0]),  # more above
        (96.0, [-9.0, 4.0]),
        (91.5, [-9.0, 8.5]),
        (0.0, [9.0]),  # none below at all
        (100.0, [-9.0]),
    ],
)
def test_a_stop_is_below_where_there_is_room_and_else_where_there_is_more(goal: float, expected: list[float]) -> None:
    assert ways(Axis("X", "linear", (1.0, 0.0, 0.0), travel=(0.0, 100.0)), goal, 9.0) == expected


def test_too_little_room_on_both_sides_leaves_the_larger_first() -> None:
    narrow = Axis("X", "linear", (1.0, 0.0, 0.0), travel=(0.0, 10.0))
    assert ways(narrow, 8.0, 9.0) == [-8.0, 2.0] and ways(narrow, 2.0, 9.0) == [8.0, -2.0] and ways(narrow, 5.0, 9.0) == [-5.0, 5.0]
