"""A machine that rises toward its limit says so beside the answer, in the list and on its page. The truth is the series itself."""

from __future__ import annotations

import re
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.nights import FIRST, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.report.answer import answer
from tango_cnc.report.course import course
from tango_cnc.report.pace import ahead, pace
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

HOST = "http://127.0.0.1"
LIMIT = 45.0


def at(name: str, number: int, um: float, **more: Any) -> dict[str, Any]:
    """name, number of the night, µm at the tool tip → a night with that error, within its limit of 45 µm."""
    limit = {"what": "volume", "value": um, "low": um - 2, "high": um + 2, "limit": LIMIT, "unit": "µm", "passed": True}
    volume = {"worst_um": um, "rms_um": 9.8, "std_um": 0.9}
    return night(name, number, limits=[limit], volume=volume, **more)


def known(values: np.ndarray) -> tuple[dict[str, Any], dict[str, float]]:
    """µm by night → record of the last one, {date: µm}."""
    dates = [f"{FIRST + timedelta(days=i):%Y-%m-%d}" for i in range(len(values))]
    return at("M", len(values) - 1, float(values[-1])), dict(zip(dates, values.tolist(), strict=True))


@pytest.mark.parametrize(
    ("rate", "last", "nights"),
    [(1.0, 39.0, 6.0), (0.5, 40.0, 10.0), (2.0, 44.0, 0.5), (0.2, 40.0, None), (-1.0, 44.0, None), (0.0, 44.9, None)],
)
def test_in_how_many_nights_the_limit_is_reached(rate: float, last: float, nights: float | None) -> None:
    """Five micrometers at 0.2 µm a night are 25 nights: too far away to be told."""
    found = ahead(*known(last + rate * np.arange(-19.0, 1.0)))
    assert (found is None) if nights is None else (found is not None and found.nights == pytest.approx(nights, abs=0.01))


@pytest.mark.few(0)
def test_a_machine_that_has_begun_to_drift_rises_as_fast_as_since_then() -> None:
    """The quiet nights before counted: 5.2 µm a night since a week was 3.6 µm a night, and the limit further away than it is."""
    tip = np.array([51, 51, 51, 51.0, 51.3, 55.7, 61.4, 66.5, 71.9, 76.9, 82.0, 87.4]) - 43.5
    found = ahead(*known(tip))
    assert found is not None and found.rate == pytest.approx(5.2, abs=0.15)
    assert found.nights == pytest.approx((LIMIT - float(tip[-1])) / found.rate, abs=0.01)
    rng = np.random.default_rng(8)
    even = [20 + 0.4 * np.arange(15.0) + rng.normal(0, 0.9, 15) for _ in range(300)]
    even = [y for y in even if abs(np.diff(y)).max() < 3.2]  # others have what counts as a step
    bends = [pace(np.arange(15.0), y, 0.9)[0] for y in even]
    assert len(even) > 200 and sum(b > 0 for b in bends) <= 2, "what rises evenly has no bend"


@pytest.mark.long
def test_a_knock_is_no_pace_and_a_machine_that_stands_still_is_not_said_to_rise() -> None:
    """Of 300 machines a hair below their limit that only scatter by what they are known to, at most 2 % are said to rise."""
    knocked = np.r_[np.full(13, 22.0), np.full(7, 44.0)] + np.random.default_rng(1).normal(0, 0.3, 20)
    assert ahead(*known(knocked)) is None
    rng = np.random.default_rng(5)
    assert sum(ahead(*known(44.0 + rng.normal(0, 0.9, 30))) is not None for _ in range(300)) <= 6
    late = np.r_[np.full(30, 22.0), 22.0 + 1.5 * np.arange(1.0, 13.0)]  # what stood still in spring does not make it slower now
    start, rate = pace(np.arange(42.0), late, 0.9)
    assert start >= 27 and 1.2 < rate < 1.6
    assert ahead(*known(np.array([40.0, 42.0, 44.0]))) is None  # three nights are no pace


def test_nights_that_were_not_measured_count() -> None:
    record, volumes = known(39.0 + np.arange(-19.0, 1.0))
    found = ahead(record, volumes, f"{FIRST + timedelta(days=23):%Y-%m-%d}")
    assert found is not None and found.nights == pytest.approx(2.0)
    told = answer(night("M", 23, "not_measured", limits=[]), Units(), texts(), before=record, ahead=found)
    assert (
        told.may == "but"
        and told.soon == "Each night this error rises by 1 µm: at this pace it reaches its limit of 45 µm, in about 2 nights."
    )


@pytest.mark.parametrize(
    ("last", "may", "soon"),
    [
        (39.0, "yes", "at this pace it reaches its limit of 45 µm, in about 6 nights."),
        (43.5, "but", "at this pace it reaches its limit of 45 µm, by the next night."),
        (44.8, "but", "at this pace it reaches its limit of 45 µm, about now."),
    ],
)
def test_a_yes_that_may_not_last_until_the_next_night_is_a_yes_but(last: float, may: str, soon: str) -> None:
    record, volumes = known(last + np.arange(-19.0, 1.0))
    told = answer(record, Units(), texts(), ahead=ahead(record, volumes))
    assert told.may == may and soon in told.soon
    assert may == "yes" or "Measure the first part" in told.why
    inch = answer(record, Units("inch"), texts(), ahead=ahead(record, volumes)).soon
    assert "by 0.00004 in:" in inch and "limit of 0.0018 in" in inch
    beyond = {**record, "verdict": "out_of_limits", "limits": [{**record["limits"][0], "passed": False}]}
    assert answer(beyond, Units(), texts(), ahead=ahead(record, volumes)).soon == ""  # a no needs no warning


@pytest.mark.long
def test_the_list_the_page_and_the_old_night_say_it(tmp_path: Path) -> None:
    """An old night says what was known then; who has to see to it stands beside it, though the answer is yes."""
    records = [at("HU40T-like", i, 20.0 + 1.0 * i) for i in range(20)]
    place = cell(tmp_path / "one", records=records)
    (place / "nightly.yaml").write_text("nightly: 1\nstale_days: 100000\nowner: J. Roy, 4411\n", encoding="utf-8")
    settings = Settings((place,), late_hours=1e6)
    with TestClient(create(settings), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        late = (date.today() - (FIRST + timedelta(days=19)).date()).days  # the series ends in the past of whoever runs this
        for path in ("/", "/machine/HU40T-like"):
            text = client.get(path).text
            box = text.partition('<dl class="facts">')[0]
            wanted = "in about" if 6 - late >= 2 else "by the next night" if 6 - late >= 1 else "about now"
            assert "Each night this error rises by 1 µm: at this pace it reaches its limit of 45 µm" in box and wanted in box, path
            assert "Call J. Roy, 4411." in text, path
        assert "The error rises night after night." in text and "Have the cause looked for" in text
        old = client.get("/machine/HU40T-like/night/19").text
        assert "in about 7 nights" in re.sub(r"\s+", " ", old)


def test_a_curve_tells_the_last_fortnight_where_it_goes_another_way_and_no_date_far_ahead() -> None:
    days, std = np.arange(60.0), np.full(60, 0.3)
    late = np.r_[np.full(48, 22.0), 22.0 + 1.0 * np.arange(1.0, 13.0)] + np.random.default_rng(2).normal(0, 0.1, 60)

    def said(value: np.ndarray, limit: float) -> str:
        return course(FIRST.date(), days[: len(value)], value, std[: len(value)], [], limit, "µm", texts())

    told = said(late, 45.0)
    assert re.match(r"Rises by [678]\.\d µm a week since (Mon 7|Tue 8|Wed 9|Thu 10|Fri 11) Dec 2026\.", told), told
    assert "at this rate until about" in told
    slow = 40.0 + 0.05 * days  # 43 µm now: 57 at this rate after nine months
    assert said(slow, 57.0).endswith("Within its limit of 57 µm.")
    falling = 60.0 - 0.1 * days[:20]  # 58 µm: within 45 µm only after four months, seen for three weeks
    assert said(falling, 45.0).endswith("Beyond its limit of 45 µm.")
