"""Stops a little short of where an axis goes: on which side, and how far."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.blockcell import machine

from tango_cnc.plan.preload import LEAST, endless, stop, turned, ways
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


@pytest.mark.parametrize("low", [-300.0, 40.0])
def test_travel_that_begins_elsewhere_moves_everything_with_it(low: float) -> None:
    axis = Axis("X", "linear", (1.0, 0.0, 0.0), travel=(low, low + 100.0))
    assert ways(axis, low + 4.0, 9.0) == [9.0, -4.0] and ways(axis, low + 96.0, 9.0) == [-9.0, 4.0]


def test_a_hundredth_of_the_room_is_room_and_less_is_none() -> None:
    axis = Axis("X", "linear", (1.0, 0.0, 0.0), travel=(0.0, 100.0))
    assert ways(axis, LEAST * 8.0, 8.0) == [8.0, -LEAST * 8.0] and ways(axis, LEAST * 7.9, 8.0) == [8.0]


@pytest.mark.parametrize(
    ("kind", "travel", "expected"),
    [
        ("linear", None, False),
        ("linear", (-5000.0, 5000.0), False),
        ("rotary", None, True),
        ("rotary", (-math.tau, math.tau), False),  # two turns are limits
        ("rotary", (0.0, math.radians(800)), False),
        ("rotary", (0.0, math.radians(801)), True),
        ("rotary", (math.radians(-500), math.radians(301)), True),
    ],
)
def test_an_axis_without_limits_turns_by_the_nearer_way(kind: str, travel: tuple[float, float] | None, expected: bool) -> None:
    axis = Axis("C", kind, (0.0, 0.0, 1.0), travel=travel)  # type: ignore[arg-type]
    assert endless(axis) is expected
    assert turned(axis, math.radians(350)) == pytest.approx(math.radians(-10 if expected else 350))


@pytest.mark.parametrize(
    ("limit", "start", "goal", "at"),
    [
        (400, 0, 170, None),  # less than half a turn: no stop
        (400, 0, 180, 175),  # half a turn: from below
        (400, 180, 0, 5),  # from above
        (400, 0, 350, 345),  # with limits as the numbers say
        (1440, 0, 350, 355),  # without by the nearer way, which is from above
        (1440, 350, 0, -5),
        (1440, 0, 360, 355),  # there is no nearer way: as the numbers say
        (1440, 360, 0, 5),
        (1440, 1100, 1440, None),  # there is no room beyond the end
    ],
)
def test_an_axis_that_may_turn_either_way_stops_short_of_it(limit: float, start: float, goal: float, at: float | None) -> None:
    m = machine("wCBXfZY(S)t")
    bound = math.radians(limit)
    m = replace(m, axes=tuple(replace(a, travel=(-bound, bound)) if a.name == "C" else a for a in m.axes))
    before = np.arange(len(m.axes), dtype=float) * 0.1
    before[m.column("C")] = math.radians(start)
    after = before.copy()
    after[m.column("C")], after[m.column("S")] = math.radians(goal), 3.0
    found = stop(m, before, after)
    if at is None:
        assert found is None
    else:
        expected = after.copy()
        expected[m.column("C")] = math.radians(at)
        assert found == pytest.approx(expected)
