"""A report whose readings are newer than the newest night, and say less than a plain Yes: all surfaces say what it says."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import cell
from test_page_newer_no import M, plain_of, seen

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.report.days import day
from tango_cnc.report.newer import NewerAnswer, answer_text, newer_answer
from tango_cnc.report.texts import texts

PATHS = (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights", f"/machine/{M}/night/2", "/", "/alarms")
MOVED = "C axis off in Y: 59 µm by the readings of the report; the night ending {date} has 2 µm."
OWNER = "Ann Meier, 4711"


def measured(folder: Path, may: str = "but", tip: float = 101.0, grown: bool = True, **own: Any) -> tuple[Path, str]:
    """Nights at 50 µm of 120 until three hours ago, newer readings at 101 µm whose EY0C is 59 µm → cell, date of the newest."""
    now = datetime.now(UTC)
    limits = [{"what": "volume", "unit": "µm", "value": 50.0, "low": 49.0, "high": 51.0, "limit": 120.0, "passed": True}]
    known = {"EY0C": {"value": 0.002, "std": 0.0002, "unit": "mm", "low": 0.0016, "high": 0.0024}}
    began, end = ((now - timedelta(hours=h)).strftime("%Y-%m-%dT%H:%M:%SZ") for h in (3, 2))
    more: dict[str, Any] = {"limits": limits, "parameters": known, "owner": OWNER, **own}
    first = night(M, 7, **{**more, "verdict": "good", "alarms": []})
    newest = night(M, 8, **more, start_utc=began, end_utc=end) | {"night": f"{now.astimezone():%Y-%m-%d}"}
    place = cell(folder, records=[first, newest])
    told = NewerAnswer(f"{now:%Y-%m-%dT%H:%M:%SZ}", tip, 120.0, "", 0.0, "", ("EY0C", 0.059, "mm"), may, grown)  # type: ignore[arg-type]
    (place / "report.html").write_text("<!DOCTYPE html><html><body>The page of a shop</body></html>", encoding="utf-8")
    (place / "report.json").write_text(answer_text(may, end if may == "no" else None, told, end), encoding="utf-8")
    return place, newest["night"]


def said(*words: str) -> tuple[str, int]:
    """command → what it prints on one line, exit status."""
    done = CliRunner().invoke(tango, words, catch_exceptions=False, standalone_mode=False)
    return " ".join(done.output.split()), int(done.return_value or 0)


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
