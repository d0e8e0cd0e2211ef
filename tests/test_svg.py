"""What a chart or a map may hide: nothing that somebody has to see."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tango_cnc.report.svg import Canvas, Mark, Plotted, apart, chart

ROOM, FRAME = (30.0, 36.0), (14.0, 30.0, 406.0, 376.0)
PLACES = st.lists(st.tuples(st.floats(14, 406), st.floats(30, 376)), min_size=1, max_size=40)


def clear(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return abs(a[0] - b[0]) >= ROOM[0] or abs(a[1] - b[1]) >= ROOM[1]


@given(PLACES)
def test_no_square_lies_on_another_one_and_who_has_room_stays(points: list[tuple[float, float]]) -> None:
    found = apart(np.array(points), ROOM, FRAME)
    assert all(clear(a, b) for i, a in enumerate(found) for b in found[:i])
    for i, there in enumerate(points):
        if all(clear(there, other) for k, other in enumerate(points) if k != i):
            assert found[i] == there


def test_five_facets_of_a_ball_stand_around_it_and_the_others_where_they_are() -> None:
    """They were pushed to the right, and from the edge of the map to its left: beside the other ball of the bar."""
    alone, ball = [(50.0, 60.0), (350.0, 340.0)], [(330.0, 200.0), (334.0, 200.0), (330.0, 196.0), (326.0, 200.0), (330.0, 204.0)]
    found = apart(np.array([*ball, *alone]), ROOM, FRAME)
    assert found[5:] == alone
    assert max(np.hypot(x - 330, y - 200) for x, y in found[:5]) < 60


def test_what_was_written_into_the_control_stands_above_all_points() -> None:
    nights = np.arange(13.0)
    series = [Plotted(nights, np.where(nights > 10, 79.0, 52.0), "squares")]
    drawn = chart(series, Canvas(400, 240), [Mark("comp. 1 written", x=11.0), Mark("comp. 2 kept", x=12.0, row=1)])
    texts = [float(y) for y in re.findall(r'<text [^>]*y="([\d.]+)"[^>]*>comp', drawn)]
    points = [float(y) for y in re.findall(r'<rect x="[\d.]+" y="([\d.]+)"', drawn)]
    assert len(texts) == 2 and len(points) == 13
    assert max(texts) < min(points)
