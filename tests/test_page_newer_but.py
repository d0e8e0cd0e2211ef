"""A report whose readings are newer than the newest night, and say less than a plain Yes: all surfaces say what it says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.commands import said
from support.newer import OWNER, PATHS, measured
from support.nights import M, knock, night
from support.pages import plain_of, seen

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.report.days import day
from tango_cnc.report.newer import newer_answer
from tango_cnc.report.texts import texts

MOVED = "C axis off in Y: 59 µm by the readings of the report; the night ending {date} has 2 µm."


def test_the_yes_but_of_newer_readings_is_that_of_every_page(tmp_path: Path) -> None:
    """The report said: measure the first part, 101 of 120 µm. Every page said: Yes, good, 50 µm, nothing to do."""
    place, date = measured(tmp_path / "one")
    moved = MOVED.format(date=day(date, texts()))
    steps = f"Measure the first part before you go on. Call {OWNER}. Look for what has moved since the night. {moved}"
    for path in PATHS:
        text = plain_of(seen(place, path))
        assert "Yes, but" in text and "101 µm, 120 µm allowed (readings of" in text, path
        assert moved in text and "Measure the first part" in text and "50 µm, 120" not in text, path
        assert steps in text or path in PATHS[4:], path
        assert "the error is larger than in that night" in text, path
    page = plain_of(seen(place, PATHS[0]))
    assert f"Parts to check All that were made since {day(date, texts())}, the last night without it." in page
    assert f"Since when The night ending {day(date, texts())} was the last one without it." in page
    assert f"What changed {moved}" in page and "What changed Nothing." not in page and "Make no parts" not in page
    assert f"Until the night ending {day(date, texts())}, by the nights alone: " in page


@pytest.mark.few(1)
@pytest.mark.parametrize("may", ["but", "no"])
def test_commands_and_metrics_have_it_too(tmp_path: Path, may: str) -> None:
    """Exit status 0 of both, 50 µm, volume_valid 1."""
    place, _ = measured(tmp_path / "one", may, 101.0 if may == "but" else 130.0)
    number = "101 µm, 120 µm allowed" if may == "but" else "130 µm, 120 µm allowed"
    text, status = said("nightly", "-C", str(place), "--status")
    assert status == 1 and number in text and "C axis off in Y: 59 µm by the readings" in text
    text, status = said("fleet", str(place), "--late", "10000")
    assert status == 1 and "by newer readings" in text and number in text and "C axis off in Y: 59 µm" in text
    for words in (("fleet", str(place), "--json", "-"), ("nightly", "-C", str(place), "--status", "--json", "-")):
        told = json.loads(CliRunner().invoke(tango, words, catch_exceptions=False).output)
        told = told["machines"][0] if "machines" in told else told
        assert (told["newer_no"], told["newer_but"]) == (may == "no", may == "but")
    lines = seen(place, "/metrics").splitlines()
    for name, value in (("newer_no", int(may == "no")), ("newer_but", int(may == "but")), ("volume_valid", 0)):
        assert f'tango_machine_{name}{{machine="{M}"}} {value}' in lines
    assert f'tango_machine_newer_volume_um{{machine="{M}"}} {number.partition(" ")[0]}' in lines


def test_an_open_alarm_keeps_its_answer_and_the_number_is_that_of_the_newer_readings(tmp_path: Path) -> None:
    """Report 86 of 90 µm and a tilt; every page 56 µm and no tilt. "This axis" followed the order about another one."""
    alarm = {**knock(night(M, 8)["night"]), "rate_per_day": 0.004}
    place, _ = measured(tmp_path / "one", verdict="changed", alarms=[alarm])
    for path in PATHS:
        text = plain_of(seen(place, path))
        assert "101 µm, 120 µm allowed" in text and "50 µm, 120" not in text, path
        assert "C axis off in Y: 59 µm by the readings of the report" in text, path
    page = plain_of(seen(place, PATHS[0]))
    assert (
        "nobody has answered" in page and "The readings of the report are newer, and show a larger error than that night." in page
    )
    after = page.partition("Look for what has moved since the night.")[2]
    assert after.partition("this axis")[0].count("has moved along") == 1
    with opened(place / "history.db") as history:
        history.decide(M, Decision(alarm["id"], "acknowledge", "Ann"))
    assert said("fleet", str(place), "--late", "10000")[1] == 1  # somebody has the alarm, and nobody what came after it


@pytest.mark.few(1)
@pytest.mark.parametrize("verdict", ["out_of_limits", "changed"])
def test_readings_that_say_as_much_as_the_night_and_show_no_larger_error_change_no_answer(tmp_path: Path, verdict: str) -> None:
    place, _ = measured(tmp_path / "one", grown=False, verdict=verdict, alarms=[knock(night(M, 8)["night"])])
    assert newer_answer(place, json.loads((place / "report.json").read_text())["after"]) is not None
    for path in PATHS[:4]:
        text = plain_of(seen(place, path))
        assert "readings of the report" not in text and "101 µm, 120 µm" not in text, path
        assert "say Yes, but, with 101 µm at the tool tip. They take nothing back, so the answer stays" in text, path
