"""A report whose readings are newer than the newest night, and say No: pages, list, alarms, commands and /metrics all say it."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.report.answer import Answer, by_newer_no
from tango_cnc.report.texts import texts
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

M = "HU40T-like"
PATHS = (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights", "/", "/alarms")
SAYS = "the readings of the report are newer than the newest night, and say No"
CAPITAL = f"T{SAYS[1:]}"


def seen(place: Path, path: str) -> str:
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        return client.get(path).text


def reported(folder: Path, after: str) -> Path:
    place = cell(folder, records=[night(M, 7), night(M, 8, "changed", alarms=[knock(night(M, 8)["night"])])])
    ended = night(M, 8 if after == "newest" else 7)["end_utc"]
    head = f'<meta name="tango-no-after" content="{ended}">' if after else ""
    (place / "report.html").write_text(f"<!DOCTYPE html><html><head>{head}</head><body>No</body></html>", encoding="utf-8")
    return place


@pytest.mark.parametrize("after", ["newest", "earlier", ""])
def test_every_page_has_the_no_of_a_report_that_is_newer_than_the_newest_night(tmp_path: Path, after: str) -> None:
    place = reported(tmp_path / "one", after)
    framed = seen(place, f"/machine/{M}/report").partition('class="today')[2].partition("</p>")[0]
    assert (SAYS in framed and framed.startswith(" stop")) == (after == "newest")
    for path in PATHS:
        text = seen(place, path)
        assert (SAYS in text or CAPITAL in text) == (after == "newest"), path
        assert ("Make no parts on it" in text) == (after == "newest"), path
        assert ("Measure the first part" in text) == (after != "newest"), path
    assert (f'tango_machine_newer_no{{machine="{M}"}} 1' in seen(place, "/metrics")) == (after == "newest")


@pytest.mark.parametrize("after", ["newest", "earlier"])
def test_commands_have_it_too(tmp_path: Path, after: str) -> None:
    place, wanted = reported(tmp_path / "one", after), after == "newest"
    told = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"], catch_exceptions=False)
    assert (SAYS in " ".join(told.output.split())) == wanted
    every = CliRunner().invoke(tango, ["fleet", str(place)], catch_exceptions=False)
    assert ("by newer readings" in every.output) == wanted
    listed = CliRunner().invoke(tango, ["fleet", str(place), "--json", "-"], catch_exceptions=False)
    machine = json.loads(listed.output)["machines"][0]
    assert machine["newer_no"] == wanted


def test_a_good_night_whose_report_says_no_wants_somebody(tmp_path: Path) -> None:
    now = datetime.now(UTC)
    began, end = ((now - timedelta(hours=hours)).strftime("%Y-%m-%dT%H:%M:%SZ") for hours in (3, 2))
    place = cell(tmp_path / "one", records=[night(M, 8, start_utc=began, end_utc=end, night=f"{now:%Y-%m-%d}")])
    every = ["fleet", str(place), "--late", "10000", "--json", "-"], ["nightly", "-C", str(place), "--status", "--json", "-"]

    def waits() -> bool:
        done = [CliRunner().invoke(tango, words, catch_exceptions=False, standalone_mode=False) for words in every]
        told = json.loads(done[0].output)["machines"][0]["newer_no"], json.loads(done[1].output)["newer_no"]
        assert told == tuple(bool(one.return_value) for one in done) and told[0] == told[1]
        return bool(told[0])

    assert not waits()
    (place / "report.html").write_text(f'<html><head><meta name="tango-no-after" content="{end}"></head></html>', encoding="utf-8")
    assert waits()
    listed = seen(place, "/")
    assert "Make no parts on it" in listed and CAPITAL in listed


@pytest.mark.parametrize("may", ["no", "unknown"])
def test_a_no_of_the_night_and_what_nobody_knows_stay(may: str) -> None:
    known = Answer(may, "…", "out_of_limits", "50 µm", "")  # type: ignore[arg-type]
    assert by_newer_no(known, texts()) is known


def test_a_file_that_is_no_report_says_nothing(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night(M, 8)])
    for content in (b"\xff\xfe\x00", b"", b'<meta name="tango-no-after" content="<script>">', b"x" * 3_000_000):
        (place / "report.html").write_bytes(content)
        assert "say No" not in seen(place, f"/machine/{M}") and "say No" not in seen(place, f"/machine/{M}/report")
