"""The sign of a night is its own verdict: a square where a limit is crossed for certain, an open one where nobody knows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from support.nights import M, knock, night
from support.pages import seen
from support.server import cell

from tango_cnc.report.morning import context
from tango_cnc.report.signs import strip
from tango_cnc.report.texts import texts

LIMIT = 50.0
OPEN = "Not certain to be within the limit"


def judged(number: int, value: float, passed: bool | None, verdict: str = "good", **more: Any) -> dict[str, Any]:
    """number, µm at the tool tip, whether within 50 µm for certain, verdict → a night."""
    limit = {"what": "volume", "value": value, "unit": "µm", "limit": LIMIT, "low": value - 1, "high": value + 1, "passed": passed}
    return night(M, number, verdict, limits=[limit], volume={"worst_um": value, "std_um": 0.5, "rms_um": value / 2}, **more)


RECORDS = (
    judged(1, 40.0, True),
    judged(2, 49.6, None),  # its number is within, and nobody knows
    judged(3, 50.4, None),  # its number is beyond, and nobody knows
    judged(4, 50.3, None, "changed", alarms=[knock(night(M, 4)["night"])]),
    judged(5, 52.0, False, "out_of_limits"),
    judged(6, 53.0, False, "out_of_limits"),
)
WANTED = ("Good", OPEN, OPEN, "Changed, not certain to be within the limit", "Out of limits", "Out of limits")
SHAPES = ("<circle", "<rect", "<rect", '<path d="M49 1.5l6 12h-12z"', "h10v10h-10z", "h10v10h-10z")


@pytest.mark.few(1)
@pytest.mark.parametrize("path", [f"/machine/{M}", "/"])
def test_the_sign_of_a_night_is_its_own_verdict(tmp_path: Path, path: str) -> None:
    """The row had "Out of limits" for a night of which the list below it says Good, not certain."""
    text = seen(cell(tmp_path / "one", records=RECORDS), path)
    signs = re.findall(r"<g><title>(?:\w+ \d+ \w+ \d+): ([^<]+)</title>(<[^>]+>)", text)
    assert tuple(title for title, _ in signs) == WANTED
    assert all(shape in sign for shape, (_, sign) in zip(SHAPES, signs, strict=True))
    assert "□ not certain to be within a limit" in text


def test_the_curve_of_the_tool_tip_has_the_sign_of_the_row(tmp_path: Path) -> None:
    text = seen(cell(tmp_path / "one", records=RECORDS), f"/machine/{M}")
    curve = text.partition('class="desk-only"')[2].partition("</svg>")[0]
    titled = {number: kind for kind, number in re.findall(r"<(\w+) [^>]*><title>[^<]*: ([\d.]+) µm</title>", curve)}
    assert titled == {"40.0": "circle", "49.6": "rect", "50.4": "rect", "50.3": "path", "52.0": "rect", "53.0": "rect"}
    hollow = re.findall(r'<rect [^>]*fill="none"[^>]*><title>[^<]*: ([\d.]+) µm', curve)
    assert hollow == ["49.6", "50.4"] and "not certain to be within the limit" in curve


def test_an_open_square_is_no_full_one_without_color() -> None:
    (open_, full) = (str(strip([("2026-11-01", v, "")], "", texts())) for v in ("not_certain", "out_of_limits"))
    assert 'fill="none"' in open_ and 'fill="none"' not in full


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("records", "wanted"),
    [
        (RECORDS, "All that were made since Mon 26 Oct 2026 (not certain), the last night within the limit."),
        ((RECORDS[0], *RECORDS[4:]), "All that were made since Sun 25 Oct 2026, the last night within the limit."),
        ((*RECORDS[2:3], *RECORDS[4:]), "All: no night since Tue 27 Oct 2026 (not certain) was within the limit."),
    ],
)
def test_parts_to_check_go_by_the_number_and_say_where_that_night_is_not_certain(
    tmp_path: Path, records: tuple[dict[str, Any], ...], wanted: str
) -> None:
    told = [{**r, "alarms": []} for r in records]
    assert wanted in seen(cell(tmp_path / "one", records=told), f"/machine/{M}")


def test_the_first_of_the_nights_beyond_the_limit_says_it_too() -> None:
    signs = [("2026-11-05", "changed"), ("2026-11-04", "out_of_limits"), ("2026-11-03", "out_of_limits"), ("2026-11-02", "good")]
    record = judged(13, 30.0, True, "changed", alarms=[{**knock("2026-11-05"), "since": "2026-11-04"}])
    for unsure in ({"2026-11-03"}, set[str]()):
        told = context(record, (), None, texts(), signs=signs, unsure=unsure)["suspect"]
        assert ("Those since Tue 3 Nov 2026 (not certain), too" in told) == bool(unsure)
        assert ("Those since Tue 3 Nov 2026, too" in told) != bool(unsure)
