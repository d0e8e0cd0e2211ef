"""What a chart may hide: nothing that somebody has to see."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tango_cnc.report.svg import Canvas, Mark, Plotted, chart


def test_what_was_written_into_the_control_stands_above_all_points() -> None:
    nights = np.arange(13.0)
    series = [Plotted(nights, np.where(nights > 10, 79.0, 52.0), "squares")]
    drawn = chart(series, Canvas(400, 240), [Mark("comp. 1 written", x=11.0), Mark("comp. 2 kept", x=12.0, row=1)])
    texts = [float(y) for y in re.findall(r'<text [^>]*y="([\d.]+)"[^>]*>comp', drawn)]
    points = [float(y) for y in re.findall(r'<rect x="[\d.]+" y="([\d.]+)"', drawn)]
    assert len(texts) == 2 and len(points) == 13
    assert max(texts) < min(points)


@pytest.mark.parametrize(("at", "width"), [(6.0, 300), (11.0, 300), (5.0, 180)])
def test_the_words_of_a_line_are_not_cut_at_the_edge(at: float, width: int) -> None:
    """On a phone "comp. 1 kept as far as seen" ended after "kept as far": what was lost is the reservation."""
    series, words = [Plotted(np.arange(15.0), np.arange(15.0), "squares")], "comp. 1 kept as far as seen"
    drawn = chart(series, Canvas(width, 240), [Mark(words, x=at)])
    place, end = re.findall(rf'<text x="([\d.]+)"( text-anchor="end")?[^>]*>{words}<', drawn)[0]
    left = float(place) - (6.1 * len(words) if end else 0.0)
    assert left >= 0 and left + 6.1 * len(words) <= width


def test_a_tick_of_a_curve_in_inches_is_a_number_that_people_read() -> None:
    """−5e−05 stood at the axis."""
    drawn = chart([Plotted(np.arange(3.0), np.array([-6e-5, 0.0, 6e-5]), "line")], Canvas(400, 240, y_label="in"))
    assert ">−0.00005<" in drawn and "e−" not in drawn
