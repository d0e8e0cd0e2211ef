"""The message names the parts to check as the page of its night does, and what was known before a night without a measurement."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import M, knock, night
from support.pages import plain_of, seen
from support.server import cell

from tango_cnc.cli import tango
from tango_cnc.history import opened
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.suspects import to_check
from tango_cnc.report.days import day
from tango_cnc.report.texts import texts


def beyond(number: int, value: float = 91.0) -> dict[str, Any]:
    limit = {"what": "volume", "unit": "µm", "value": value, "low": value - 1, "high": value + 1, "limit": 75.0}
    volume = {"worst_um": value, "rms_um": 9.8, "std_um": 0.5}
    verdict = "out_of_limits" if value > 75 else "good"
    return night(M, number, verdict, limits=[limit | {"passed": value < 75}], volume=volume, last_measured=None)


def unmeasured(number: int, **more: Any) -> dict[str, Any]:
    nothing: dict[str, Any] = {"kind": "none", "status": "failed", "touches": 0, "parameters": None, "volume": None, "limits": []}
    return night(M, number, "not_measured", **nothing, why="port does not open", change=None, residual=None, **more)


def told(folder: Path, *records: dict[str, Any]) -> tuple[str, str]:
    """cell, its nights, the last one as its message has it → that message, its page."""
    before, record = records[:-1], records[-1]
    with opened(folder / "before.db") as history:
        for one in before:
            history.add_night(one)
        record = record | to_check(history, record)
    place = cell(folder / "one", records=[*before, record])
    return message(record, (), ())[1], plain_of(seen(place, f"/machine/{M}"))


@pytest.mark.parametrize("never", [False, True])
def test_where_a_limit_is_crossed_the_mail_names_the_parts_of_the_page(tmp_path: Path, never: bool) -> None:
    """The mail of the night that crossed it had "parts to check" of smaller changes alone."""
    within, alarm = beyond(7, 80.0 if never else 60.0), knock(night(M, 9)["night"]) | {"since": "2026-11-01"}
    mail, page = told(tmp_path, within, beyond(8, 90.0), beyond(9) | {"alarms": [alarm]})
    date, words = within["night"], "All that were made since {}, the last night within the limit."
    words = "All: no night since {} was within the limit." if never else words
    assert f"parts to check: {words.format(date)}" in mail
    assert f"Parts to check {words.format(day(date, texts()))}" in page


def test_a_night_that_measured_nothing_names_what_was_known_and_which_parts(tmp_path: Path) -> None:
    """It began "Make no parts on it." and had neither 91 µm nor 75, nor which parts."""
    last = beyond(8)
    more = {"last_measured": last["night"], "last_verdict": "out_of_limits"}
    mail, page = told(tmp_path, beyond(7, 60.0), last, unmeasured(9, **more))
    assert f"* volume: 91.0 µm, BEYOND 75 (night ending {last['night']})" in mail
    date = beyond(7)["night"]
    assert f"parts to check: All that were made since {date}, the last night within the limit." in mail
    assert f"All that were made since {day(date, texts())}, the last night within the limit." in page
    line = " ".join(CliRunner().invoke(tango, ["fleet", str(tmp_path / "one")]).output.split())
    assert "not_measured No" in line and f"91 µm, 75 µm allowed (night ending {day(last['night'], texts())})" in line


def test_a_repair_that_went_too_far_leaves_its_parts_to_check() -> None:
    alarm = knock(night(M, 9)["night"]) | {"since": "2026-11-01", "repair": {"alarm": "2026-11-02-1", "found": "2026-11-02"}}
    mail = message(night(M, 9, "changed", alarms=[alarm]), (), ())[1]
    assert "parts to check: All that were made since 2026-11-01, the last night without it." in mail
