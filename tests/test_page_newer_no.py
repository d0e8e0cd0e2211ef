"""A report whose readings are newer than the newest night, and say No: pages, list, alarms, commands and /metrics all say it."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.alarms import warm
from support.newer import YES
from support.nights import M, knock, night
from support.pages import plain_of, seen
from support.server import cell

pytest.importorskip("starlette")

from tango_cnc.cli import tango
from tango_cnc.history import opened
from tango_cnc.report.answer import Answer, by_newer
from tango_cnc.report.days import day
from tango_cnc.report.morning import context
from tango_cnc.report.newer import NewerAnswer, answer_text, newer_answer
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.web.pages.fleet import brief

PATHS = (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights", "/", "/alarms")
SAYS = "the readings of the report are newer than the newest night, and say No"
CAPITAL = f"T{SAYS[1:]}"
TOLD = NewerAnswer("2026-11-01T09:00:00Z", 50.1, 45.0, "EY0C", -0.0182, "mm")


def reported(folder: Path, after: str) -> Path:
    place = cell(folder, records=[night(M, 7), night(M, 8, "changed", alarms=[knock(night(M, 8)["night"])])])
    ended = night(M, 8 if after == "newest" else 7)["end_utc"]
    says(place, ended if after else "")
    return place


def says(place: Path, no_after: str) -> None:
    """cell, end of the night that its report is newer than and says No after ('': none) → that report, by whatever template."""
    (place / "report.html").write_text("<!DOCTYPE html><html><body>The page of a shop</body></html>", encoding="utf-8")
    (place / "report.json").write_text(answer_text("no", no_after, TOLD), encoding="utf-8")


@pytest.mark.few(1)
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
    assert f'tango_machine_volume_valid{{machine="{M}"}} {int(after != "newest")}' in seen(place, "/metrics")


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


@pytest.mark.few(0)
def test_a_good_night_whose_report_newer_answer_wants_somebody(tmp_path: Path) -> None:
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
    says(place, end)
    assert waits()
    listed = seen(place, "/")
    assert "Make no parts on it" in listed and CAPITAL in listed


def test_old_nights_hide_no_no_of_newer_readings_and_alarms_has_it_without_an_alarm(tmp_path: Path) -> None:
    """Nights of 12 days ago, readings of yesterday at 101 µm, 75 allowed: "Nobody knows", "50 µm", "No alarm is open."."""
    begun, end = "2026-10-24T02:00:00Z", "2026-10-24T02:30:00Z"  # too old on every day
    place = cell(tmp_path / "one", records=[night(M, 0, start_utc=begun, end_utc=end, night="2026-10-24")])
    (place / "nightly.yaml").write_text("nightly: 1\nstale_days: 2\n")
    assert "Nobody knows" in seen(place, f"/machine/{M}")
    says(place, end)
    for path in PATHS:
        text = seen(place, path)
        assert CAPITAL in text or SAYS in text, path
        assert "Make no parts on it" in text and "Nobody knows: not measured" not in text, path
    told = " ".join(CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"]).output.split())
    assert "May I make parts? No." in told and "NOBODY KNOWS" not in told and "50 µm, 45 µm allowed" in told


def test_pages_look_for_what_has_moved_since_the_night_and_not_for_what_the_largest_part_comes_from() -> None:
    """Most of the tool tip came from a location that had stood for weeks; the tilt since the night was on no page."""
    values = {"EY0C": {"value": -0.0182, "std": 0.0003, "unit": "mm"}, "EB0A": {"value": 2.5e-5, "std": 2e-6, "unit": "rad"}}
    no = replace(TOLD, moved=("EB0A", 1.75e-4, "rad"))
    assert by_newer(YES, TOLD, Units(), texts(), night={"night": "2026-11-01", "parameters": values}).moved == ""
    told = by_newer(YES, no, Units(), texts(), night={"night": "2026-11-01", "parameters": values})
    assert told.moved.startswith("A axis tilted about Y: 52 µm over 300 mm by the readings") and "has 7.5 µm" in told.moved
    assert brief(told, (), False, "", texts())[1].endswith(told.moved)


@pytest.mark.parametrize("may", ["no", "unknown"])
def test_a_no_of_the_night_and_what_nobody_knows_stay(may: str) -> None:
    known = Answer(may, "…", "out_of_limits", "50 µm", "")  # type: ignore[arg-type]
    told = by_newer(known, TOLD, Units(), texts())
    assert replace(told, why="", beside="") == known and "They take nothing back, so the answer stays …" in told.why


@pytest.mark.few(0)
def test_a_file_that_is_no_answer_of_a_report_newer_answerthing(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night(M, 8)])
    end = night(M, 8)["end_utc"]
    whole = answer_text("no", end, TOLD).encode()
    deep = b'{"format": "tango-report-answer/1", "no_after": ' + b"[" * 50_000
    for content in (
        b"\xff\xfe\x00",
        b"",
        b"[]",
        b"null",
        whole[:-5],
        whole.replace(b"answer/1", b"answer/9"),
        deep,
        b" " * 3_000_000,
    ):
        says(place, "")
        (place / "report.json").write_bytes(content)
        assert "say No" not in seen(place, f"/machine/{M}") and "say No" not in seen(place, f"/machine/{M}/report")
    (place / "report.json").write_bytes(whole)
    assert newer_answer(place, end)
    (place / "report.html").unlink()  # the report is gone, and its answer with it
    assert not newer_answer(place, end)


def test_the_answer_of_a_report_is_that_of_its_own_folder(tmp_path: Path) -> None:
    place, end = cell(tmp_path / "one", records=[night(M, 8)]), night(M, 8)["end_utc"]
    says(place, "")
    (place / "report.json").unlink()
    (tmp_path / "other.json").write_text(answer_text("no", end, TOLD), encoding="utf-8")
    try:
        (place / "report.json").symlink_to(tmp_path / "other.json")
    except OSError:
        pytest.skip("this computer makes no links")
    assert not newer_answer(place, end)


@pytest.mark.long
def test_a_report_by_a_template_of_the_shop_has_its_no_on_the_pages(tmp_path: Path) -> None:
    """The fact stood in a line of the program's template alone: with a template of its own the shop read Yes, but."""
    place = tmp_path / "cell"
    run = CliRunner()

    def done(*words: str, status: int = 0) -> None:
        told = run.invoke(tango, words, catch_exceptions=False, standalone_mode=False)
        assert int(told.return_value or 0) == status, told.output

    done("init", str(place), "--example", "trunnion")
    done("simulate", "-C", str(place))
    record = night("trunnion", 8, simulated=True, limits=[], volume={"worst_um": 0.1, "rms_um": 0.1, "std_um": 0.01})
    with opened(place / "history.db") as history:
        history.add_night(record)
    own = tmp_path / "templates"
    own.mkdir()
    (own / "report.html").write_text("<html><body>{{ may.word }}</body></html>", encoding="utf-8")
    more = ("--templates", str(own), "--limit-um", "1", "--no-diagnosis", "--no-pictures")
    done("report", "-C", str(place), *more, "-o", str(tmp_path / "elsewhere.html"), status=1)
    assert not (place / "report.json").exists()  # it is of the report of the cell alone
    done("report", "-C", str(place), *more, status=1)
    told = newer_answer(place, record["end_utc"])
    assert (
        told is not None
        and told.limit_um == 1.0
        and (told.tip_um or 0.0) > 1.0
        and told.parameter
        and not newer_answer(place, night("trunnion", 9)["end_utc"])
    )


@pytest.mark.parametrize("newer_no", [False, True])
def test_below_the_no_of_newer_readings_nobody_reads_make_parts(newer_no: bool) -> None:
    """1. Make no parts on it. 3. Make parts while the machine is at its usual temperature."""
    told = context(night(M, 8, "changed", alarms=[warm(8, 15.0)]), (), None, texts(), by_readings=TOLD if newer_no else None)
    text = " ".join(told["todo"])
    assert ("Make parts while the machine" in text) == (not newer_no) and ("Make no parts on it." in text) == newer_no
    assert "temperature" in text


@pytest.mark.few(0)
def test_the_no_has_its_number_and_its_cause_on_every_first_screen(tmp_path: Path) -> None:
    """It had neither: below the No of the readings stood what the night had found, which was another thing."""
    place = reported(tmp_path / "one", "newest")
    for path in PATHS[:3]:
        text = " ".join(seen(place, path).split())
        assert "50 µm, 45 µm allowed (readings of Sun 1 Nov 2026)" in text, path
        assert "The largest part of it comes from C axis off in Y: −18 µm." in text, path
    told = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"], catch_exceptions=False).output
    assert "50 µm, 45 µm allowed (readings of Sun 1 Nov 2026)" in " ".join(told.split())


@pytest.mark.parametrize(
    "own", [{"most": {"parameter": "<b>", "value": 1e400, "unit": "mm"}}, {"most": 7, "tip_um": "50"}, {"most": None}]
)
def test_numbers_that_are_none_leave_the_no_alone(tmp_path: Path, own: dict[str, object]) -> None:
    place = reported(tmp_path / "one", "newest")
    end = night(M, 8)["end_utc"]
    (place / "report.json").write_text(json.dumps(json.loads(answer_text("no", end, TOLD)) | own), encoding="utf-8")
    page = seen(place, f"/machine/{M}")
    assert SAYS in page and "The largest part of it comes from" not in page and "<b>:" not in page


def within_night(folder: Path) -> Path:
    """A good night of 8 Nov at 50 µm of 60 whose EY0C is 0.0020 mm, and newer readings of 214 µm with −18 µm there."""
    limits = [{"what": "volume", "unit": "µm", "value": 50.0, "low": 49.0, "high": 51.0, "limit": 60.0, "passed": True}]
    known = {"EY0C": {"value": 0.002, "std": 0.0002, "unit": "mm", "low": 0.0016, "high": 0.0024}}
    more = {"limits": limits, "parameters": known, "owner": "Ann Meier, 4711"}
    place = cell(folder, records=[night(M, 7, **more), night(M, 8, **more)])
    told = NewerAnswer("2026-11-08T09:00:00Z", 214.0, 60.0, "EY0C", -0.0182, "mm")
    says(place, "")
    (place / "report.json").write_text(answer_text("no", night(M, 8)["end_utc"], told), encoding="utf-8")
    return place


def test_the_pages_say_which_parts_the_no_of_newer_readings_is_about_and_what_moved(tmp_path: Path) -> None:
    """None did: the parts made since the night, which was within its limit, were named nowhere."""
    place, date = within_night(tmp_path / "one"), day(night(M, 8)["night"], texts())
    steps = [
        "Make no parts on it.",
        "Call Ann Meier, 4711.",
        f"Check the parts that were made since the night ending {date}: they may be beyond the limit.",
        "Look for what has moved since the night. C axis off in Y: −18 µm by the readings of the report; "
        f"the night ending {date} has 2 µm.",
        "Have the largest errors compensated or repaired. Then run the full measurement.",
    ]
    for path in PATHS[:3]:
        text = plain_of(seen(place, path))
        assert " ".join(steps) in text, path
    page = plain_of(seen(place, PATHS[0]))
    assert f"Since when The night ending {date} was the last one within the limit." in page
    assert f"Parts to check All that were made since {date}, the last night within the limit." in page
    assert f"What changed C axis off in Y: −18 µm by the readings of the report; the night ending {date} has 2 µm." in page


@pytest.mark.few(0)
def test_below_the_no_of_newer_readings_the_curve_of_the_nights_is_not_that_of_today(tmp_path: Path) -> None:
    """Steady. Within its limit of 60 µm, and No above it."""
    place, date = within_night(tmp_path / "one"), day(night(M, 8)["night"], texts())
    for path in PATHS[:2]:
        text = plain_of(seen(place, path))
        assert f"Until the night ending {date}, by the nights alone: " in text, path
    assert "By the nights" not in plain_of(seen(cell(tmp_path / "two", records=[night(M, 7), night(M, 8)]), PATHS[0]))


def test_the_list_has_the_age_of_the_readings_that_answer(tmp_path: Path) -> None:
    now = datetime.now(UTC)
    began, end, read = ((now - timedelta(minutes=m)).strftime("%Y-%m-%dT%H:%M:%SZ") for m in (13 * 60, 12 * 60, 5))
    place = cell(tmp_path / "one", records=[night(M, 8, start_utc=began, end_utc=end, night=f"{now:%Y-%m-%d}")])
    assert "measured 12 h ago" in seen(place, "/")
    says(place, "")
    (place / "report.json").write_text(answer_text("no", end, NewerAnswer(read, 214.0, 60.0)), encoding="utf-8")
    text = seen(place, "/")
    assert "measured 12 h ago" not in text and "measured 5 min ago" in text


@pytest.mark.few(1)
@pytest.mark.parametrize("entry", [1, 2])
def test_the_page_of_the_newest_night_has_it_and_no_other(tmp_path: Path, entry: int) -> None:
    """The page of the machine said No, its own page of that night "Yes, but"."""
    place = reported(tmp_path / "one", "newest")
    assert (SAYS in seen(place, f"/machine/{M}/night/{entry}").replace(CAPITAL, SAYS)) == (entry == 2)
