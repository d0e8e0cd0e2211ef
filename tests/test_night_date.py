"""A night has one date on every page: that of the morning after it."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone

import pytest

from tango_cnc.nightly.dates import night_of
from tango_cnc.nightly.standing import _urgency
from tango_cnc.report.days import local_day

FAR = timezone(timedelta(hours=9))


@pytest.mark.parametrize(
    ("begun", "date"),
    [
        ("2026-11-03T17:59:00", "2026-11-03"),  # somebody measures in the afternoon
        ("2026-11-03T18:00:00", "2026-11-04"),
        ("2026-11-03T23:30:00", "2026-11-04"),
        ("2026-11-04T02:00:00", "2026-11-04"),
        ("2026-12-31T22:00:00", "2027-01-01"),
    ],
)
def test_what_begins_in_the_evening_is_of_the_morning_after_it(begun: str, date: str) -> None:
    for zone in (FAR, timezone(timedelta(hours=-8))):
        assert night_of(datetime.fromisoformat(begun).replace(tzinfo=zone)) == date


def test_a_moment_without_a_zone_is_of_utc_and_what_is_none_keeps_its_date() -> None:
    assert local_day("2026-11-03T12:00:00") == local_day("2026-11-03T12:00:00Z")
    assert local_day("2026-11-03, some time") == "2026-11-03" and local_day(None) == ""


def test_of_alarms_that_wait_the_one_that_matters_most_to_a_part_comes_first() -> None:
    usual = {"decision": None, "cause": "axis_location", "on_part_um": 40.0, "size": 0.02, "total": 0.02}
    gone = usual | {"total": 0.002, "on_part_um": 60.0}
    warm = usual | {"cause": "temperature", "on_part_um": 16.0, "total": None}
    probe = usual | {"cause": "stylus", "on_part_um": 90.0}
    answered = usual | {"decision": "acknowledge", "on_part_um": 80.0}
    assert sorted([answered, probe, gone, warm, usual], key=_urgency) == [usual, warm, gone, probe, answered]
