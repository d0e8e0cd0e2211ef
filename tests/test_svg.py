"""What a chart may hide: nothing that somebody has to see."""

from __future__ import annotations

import re

import numpy as np

from tango_cnc.report.svg import Canvas, Mark, Plotted, chart


def test_what_was_written_into_the_control_stands_above_all_points() -> None:
    nights = np.arange(13.0)
    series = [Plotted(nights, np.where(nights > 10, 79.0, 52.0), "squares")]
    drawn = chart(series, Canvas(400, 240), [Mark("comp. 1 written", x=11.0), Mark("comp. 2 kept", x=12.0, row=1)])
    texts = [float(y) for y in re.findall(r'<text [^>]*y="([\d.]+)"[^>]*>comp', drawn)]
    points = [float(y) for y in re.findall(r'<rect x="[\d.]+" y="([\d.]+)"', drawn)]
    assert len(texts) == 2 and len(points) == 13
    assert max(texts) < min(points)
