"""A result that is too old is no answer of today: pages, report, message, status and exit codes say that nobody knows."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import M, dated, knock, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.files import read_cell
from tango_cnc.files.nightly import Nightly, read_nightly
from tango_cnc.nightly.mail import message
from tango_cnc.report.age import measured_on, nights_old
from tango_cnc.report.answer import answer
from tango_cnc.report.repeated import in_a_row
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import joined, say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

PAGES = ("/", "/alarms", f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights")


def place_of(folder: Path, ago: int, stated: str = "", last: str = "good", then: tuple[int, ...] = ()) -> Path:
    """folder, days since the last measurement, nightly.yaml, its verdict, days since nights that measured nothing → cell."""
    before, now = dated(ago + 1), dated(ago)
    alarm = knock(now["night"]) | {"id": f"{now['night']}-1", "since": before["night"]}
    records = [night(M, 0, **before), night(M, 1, last, alarms=[alarm] if last == "changed" else [], **now)]
    for i, days in enumerate(then):
        nothing: dict[str, Any] = {
            "status": "failed",
            "kind": "none",
            "touches": 0,
            "parameters": None,
            "volume": None,
            "limits": [],
        }
        nothing |= {"why": "the probe did not answer", "last_measured": now["night"]}
        records.append(night(M, 2 + i, "not_measured", **nothing, **dated(days)))
    found = cell(folder, records=records)
    (found / "nightly.yaml").write_text(f"nightly: 1\n{stated}", encoding="utf-8")
    return found


def shown(place: Path, path: str) -> str:
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        return " ".join(re.sub(r"<(title|svg).*?</\1>|<[^>]+>", " ", site.get(path).text, flags=re.DOTALL).split())


@pytest.mark.few(0)
@pytest.mark.parametrize("then", [(), (1, 0)], ids=["no night since", "nights that measured nothing"])
@pytest.mark.parametrize("last", ["good", "changed"])
def test_a_machine_that_was_not_measured_for_weeks_has_no_answer_of_today(tmp_path: Path, last: str, then: tuple[int, ...]) -> None:
    place = place_of(tmp_path / "one", 20, last=last, then=then)
    for path in PAGES:
        text = shown(place, path)
        if path == "/alarms" and last == "good":
            continue
        assert "Nobody knows" in text and "not measured for 20 nights" in text, path
        assert not re.search(r"May I make parts\? Yes", text) and "Measure the first part" not in text, path
        if path != "/":
            assert re.search("What to do:? Have it measured first: run the full measurement", text), path
    fleet = shown(place, "/")
    assert "Nobody knows: 1." in fleet and "Yes: 0. Yes, but: 0." in fleet


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("ago", "stated", "old"),
    [
        (6, "", 0),
        (7, "", 0),
        (8, "", 8),
        (8, "stale_days: 30\n", 0),
        (3, "stale_days: 2\n", 3),
        (12, "every_days: 7\n", 0),  # two rounds
        (15, "every_days: 7\n", 15),
        (12, "late_hours: 336\n", 0),
    ],
)
def test_how_old_a_result_may_be_goes_by_the_rhythm_that_is_stated(tmp_path: Path, ago: int, stated: str, old: int) -> None:
    place = place_of(tmp_path / "one", ago, stated)
    last = dated(ago)["night"]
    assert nights_old(last, dated(0)["night"], read_nightly(place).answers_for) == old
    assert ("Nobody knows" in shown(place, f"/machine/{M}")) == bool(old)


@pytest.mark.few(1)
@pytest.mark.parametrize("ago", [20, 0])
def test_status_fleet_metrics_and_report_agree(tmp_path: Path, ago: int) -> None:
    place, old = place_of(tmp_path / "one", ago), ago > 7
    status = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(place)], standalone_mode=False)
    fleet = CliRunner().invoke(tango, ["fleet", str(place)], standalone_mode=False)
    for found in (status, fleet):
        assert found.exception is None and found.return_value == int(old)
        assert ("not measured for 20 nights" in found.output) == ("obody knows" in found.output.lower()) == old
    for arguments in (["nightly", "--status", "-C"], ["fleet"]):
        data = json.loads(CliRunner().invoke(tango, [*arguments, str(place), "--json", "-"], standalone_mode=False).output)
        assert data.get("machines", [data])[0]["stale_nights"] == (20 if old else 0)
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        assert f'tango_machine_stale_nights{{machine="{M}"}} {20 if old else 0}' in site.get("/metrics").text
    from tango_cnc.commands.report import nights

    found_nights = nights(place, read_cell(place).machine, Units(), texts())
    assert found_nights is not None and found_nights.answer(Units(), texts(), read_cell(place).machine).may == (
        "unknown" if old else "yes"
    )
    assert (found_nights.todo[0] == texts()("morning.old_todo")) == old


def test_a_limit_that_was_crossed_stays_crossed_however_long_ago() -> None:
    limit = {"what": "volume", "value": 51.0, "low": 50.0, "high": 52.0, "limit": 45.0, "unit": "µm", "passed": False}
    told = answer(night(M, 1, "out_of_limits", limits=[limit]), Units(), texts(), old=30)
    assert (told.may, told.word, told.old) == ("no", "No", "not measured for 30 nights")
    assert "nobody has measured it since" in told.why and "(night ending Sun 25 Oct 2026)" in told.numbers
    doubted = answer(night(M, 1, "doubtful"), Units(), texts(), old=30)
    assert doubted.may == "unknown" and "were in doubt" in doubted.why and not doubted.numbers


def test_the_message_of_a_night_that_did_not_measure_says_how_long_nobody_knows() -> None:
    record = night(M, 20, "not_measured", status="failed", kind="none", why="no answer", touches=0, limits=[], change=None)
    record |= {"last_measured": "2026-10-25", "preflight": []}
    assert "NOBODY KNOWS" not in message(record, (), ())[1]
    told = message(record | {"stale_nights": 19}, (), ())[1]
    assert "NOBODY KNOWS how this machine is: not measured for 19 nights, since 2026-10-25." in told


def test_the_age_is_that_of_the_last_night_that_measured() -> None:
    good, nothing = night(M, 3), night(M, 9, "not_measured", last_measured="2026-10-20")
    assert measured_on(good) == measured_on(nothing, good) == good["night"] and measured_on(nothing) == "2026-10-20"
    assert measured_on(nothing, nothing) == "2026-10-20" and nights_old("", "2026-11-01", 7) == 0
    assert replace(Nightly(), every_days=10).answers_for == 20 and Nightly().answers_for == 7


@pytest.mark.few(0)
def test_a_night_that_was_cut_off_is_in_the_answer_and_in_what_to_do_on_every_page(tmp_path: Path) -> None:
    place = place_of(tmp_path / "one", 0)
    (place / "nights" / "begun").mkdir(parents=True)
    (place / "nights" / "begun" / "2026-11-23T020000Z").write_text("", encoding="utf-8")
    sent = place / "nights" / "2026-11-23T020000Z" / "planned.json"  # written before anything is sent
    sent.parent.mkdir()
    sent.write_text("{}", encoding="utf-8")
    for path in ("", "/trend", "/nights"):
        text = shown(place, f"/machine/{M}{path}")
        assert "Look at the machine first: last night was cut off, and the control may still execute the program. Then" in text
        assert "What changed Nothing." not in text
        assert "The night ending Mon 23 Nov 2026 was cut off" in text and "2026-11-23T" not in text
        assert re.search("What to do:? Look at the machine first: its control may still execute the program.", text), path
    assert "No: 0. Not yet: 1." in shown(place, "/")
    sent.unlink()  # refused before anything was sent, on a disk that is full
    for path in ("", "/trend", "/nights"):
        text = shown(place, f"/machine/{M}{path}")
        assert "ended before anything was sent" in text and "is the disk full?" in text and "may still execute" not in text
        assert "nothing was measured last night" in text
    assert "Yes, but: 1." in shown(place, "/")


@pytest.mark.few(0)
def test_where_only_the_probe_has_changed_other_parts_are_not_in_question(tmp_path: Path) -> None:
    before, now = dated(1), dated(0)
    bent = knock(now["night"]) | {"cause": "stylus", "parameter": "stylus", "since": before["night"], "text": "The tip has moved"}
    place = cell(tmp_path / "one", records=[night(M, 0, **before), night(M, 1, "changed", alarms=[bent], **now)])
    text = shown(place, f"/machine/{M}").partition("For the engineer")[0]
    assert "Those that were set up or measured with the probe since" in text and "All that were made" not in text
    for path in PAGES:
        assert "Measure the first part that is set up with the probe" in shown(place, path), path


def test_a_row_of_a_list_of_nights_speaks_of_its_own_night() -> None:
    text = say("changed.unnamed", name="EX0C", size="9 µm", since=say("night.alarms.last_night"))
    text = joined("; ", (text, say("night.alarms.now", told="9 µm"), say("night.alarms.confirmed", told="9 µm")))
    row = texts().of(in_a_row(text))
    assert "since the night before" in row and "9 µm that night" in row and "confirmed by the full measurement" in row
    assert not re.search("tonight|last night|now", row) and in_a_row("as it was") == "as it was"


def test_a_message_dates_a_change_as_pages_do() -> None:
    text = say("changed.unnamed", name="EX0C", size="20 µm", since=say("night.alarms.last_night"))
    one = knock("2026-11-05") | {"text": text, "since": "2026-11-04", "on_part": "Parts are off."}
    record = night(M, 12, "changed", alarms=[one], headline=text)
    told = message(record, (), ())[1]
    (parts,) = (line for line in told.splitlines() if "parts to check" in line)  # those of the day before the night that found it
    assert parts.endswith("All that were made since 2026-11-04, the last night without it.")
    told = told.replace(parts, "")
    assert told.count("since the night ending 2026-11-05") == 3 and "last night" not in told and "2026-11-04" not in told
    drift = one | {"rate_per_day": 0.002, "since": "2026-10-30", "text": text.but(since="2026-10-30")}
    assert "since 2026-10-30" in message(record | {"alarms": [drift], "headline": drift["text"]}, (), ())[1]


@pytest.mark.parametrize("zone", ["Europe/Berlin", "America/Los_Angeles"])
def test_a_machine_that_measures_in_the_evening_is_as_old_as_its_night(zone: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A night of 22:30 is of the next morning; its age began the day before, and a result was too old a night too early."""
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        end = datetime(2026, 11, 20, 22, 30).astimezone().astimezone(UTC)
        assert measured_on({"verdict": "good", "night": "2026-11-21", "end_utc": end.isoformat()}) == "2026-11-21"
        early = datetime(2026, 11, 21, 2, 30).astimezone().astimezone(UTC)
        assert measured_on({"verdict": "good", "night": "2026-11-21", "end_utc": early.isoformat()}) == "2026-11-21"
    finally:
        monkeypatch.undo()
        time.tzset()


def test_under_an_alarm_stands_how_that_one_is_answered_at_the_computer(tmp_path: Path) -> None:
    """All of a machine stood under the first one, and who copied the last answered another."""
    before, now = dated(1), dated(0)
    one = knock(now["night"]) | {"since": before["night"], "text": "C axis has moved", "on_part_um": 40.0}
    other = one | {"id": f"{now['night']}-2", "parameter": "EX0S", "text": "head has moved", "on_part_um": 4.0}
    place = cell(tmp_path / "one", records=[night(M, 0, **before), night(M, 1, "changed", alarms=[one, other], **now)])
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        parts = site.get("/alarms").text.split('<section class="one">')[1:]
    assert [re.findall(r"tango history decide (\S+)", part) for part in parts] == [[one["id"]], [other["id"]]]
