"""Pages, terminal and message say the same of one machine: what to do, whether parts may be made, one size, one count of nights."""

from __future__ import annotations

import re
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import M, knock, night
from support.pages import site_of, words_of
from support.server import Recorded, cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.words import changed, headline, value
from tango_cnc.report.age import due, nights_old
from tango_cnc.report.days import day
from tango_cnc.report.plain import plain
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import joined, say

TABS = ("", "/trend", "/nights", "/run", "/report", "/files")


def read(site: TestClient, path: str) -> str:
    """pages, path → what a person reads there."""
    return words_of(site.get(path).text)


def steps(html: str) -> list[str]:
    """page → what to do, step by step."""
    return re.findall(r"<li>(.*?)</li>", html.partition('<ol class="steps">')[2].partition("</ol>")[0])


def broken_off(place: Path) -> None:
    """cell → it has a run of twenty touches that ended after the first."""
    run = Recorded(place, 20)
    run.begin()
    run.touch()
    run.gone()


@pytest.mark.long
def test_a_run_that_broke_off_asks_for_the_same_on_its_own_page(tmp_path: Path) -> None:
    """The page of the run asked for the missing touches first; nobody else did."""
    place = cell(tmp_path / "one", records=[night(M, 0)])
    (place / "nightly.yaml").write_text("nightly: 1\nstale_days: 100000\nowner: Ann, 4711\n", encoding="utf-8")
    broken_off(place)
    with site_of(place) as site:
        page, own = site.get(f"/machine/{M}/run").text, site.get(f"/machine/{M}").text
        assert len(steps(own)) > 1 and steps(page) == steps(own)
        assert steps(page)[0].startswith("Look at the machine first")
        assert "tango run --resume" in page.partition("<details")[2] and "Make the missing touches" not in page
        assert re.search(r"broke off on .{8,20} at \d\d:\d\d [A-Z]{3}", read(site, f"/machine/{M}"))  # the zone, as of other times


def struck(**more: Any) -> list[dict[str, Any]]:
    """two nights of yesterday and the days before, the first of which found a knock that nobody has answered → their records."""
    found = []
    for number, ago in ((1, 6), (2, 1)):
        start = datetime.now(UTC).replace(microsecond=0) - timedelta(days=ago)
        stamp = f"{start:%Y-%m-%dT%H:%M:%SZ}"
        found.append(night(M, number, "changed", night=f"{start:%Y-%m-%d}", start_utc=stamp, end_utc=stamp))
    alarm = {**knock(found[0]["night"]), "since": found[0]["night"], "owner": "Ann, 4711", "parameter": "EX0C"}
    found[0]["alarms"] = [alarm]
    standing = {**alarm, "night": found[0]["night"], "now": "", "total": None, "confirmed": None, "steady": True}
    found[1] |= {"standing": [standing], "owner": "Ann, 4711", "deputy": "Bob, 4712"} | more
    return found


@pytest.mark.few(0)
def test_everybody_is_sent_to_the_same_person(tmp_path: Path) -> None:
    """The page of a run called the owner, who had not answered for days; beside a cause of a crossed limit, what to do did."""
    most = {"what": "volume", "parameter": "EX0C", "unit": "mm", "text": "most of it comes from EX0C", "since": "", "size": -0.094}
    limit = {"what": "volume", "value": 141.0, "unit": "µm", "low": 140.0, "high": 142.0, "limit": 60.0, "passed": False}
    more: dict[str, Any] = {"verdict": "out_of_limits", "limits": [limit], "behind": [{**most, "rate_per_day": None, "do": ""}]}
    for name, records in (("one", struck()), ("two", struck(**more))):
        place = cell(tmp_path / name, records=records)
        (place / "nightly.yaml").write_text("nightly: 1\nowner: Ann, 4711\ndeputy: Bob, 4712\n", encoding="utf-8")
        broken_off(place)
        with site_of(place) as site:
            for path in ("/", f"/machine/{M}", f"/machine/{M}/run", f"/machine/{M}/nights", "/alarms"):
                text = read(site, path)
                assert "Call Bob, 4712: Ann, 4711 was asked first" in text and "Call Ann" not in text, (name, path)


@pytest.mark.long
def test_the_next_night_stands_in_for_a_full_measurement_that_is_asked_for(tmp_path: Path) -> None:
    coming = {"kind": "full", "why": "tonight's check found a change"}
    for do, said in (
        ("Run the full measurement.", "A full measurement, by itself. Where that is soon enough"),
        ("Ask.", "Full measurement."),
    ):
        records = struck(next=coming)
        records[0]["alarms"][0]["do"] = records[1]["standing"][0]["do"] = do
        with site_of(cell(tmp_path / do[:3], records=records)) as site:
            assert f"Next night {said}" in read(site, f"/machine/{M}")


def test_a_headline_has_the_size_of_the_box(tmp_path: Path) -> None:
    """Of one knock the box had +20 µm, as it was found, and the row of the night +22, as it stood, though both are one step."""
    record = night(M, 20, "out_of_limits")
    since = "2026-11-04"
    sizes = {"found": value(0.020386, "mm", 0.000456), "stands": value(0.022179, "mm", 0.00059)}
    text = {name: changed("EX0C", size, since) for name, size in sizes.items()}
    limit = {"what": "volume", "value": 84.5, "unit": "µm", "low": 83.0, "high": 86.0, "limit": 60.0, "passed": False}
    alarm = {**knock("2026-11-05"), "size": 0.020386, "std": 0.000456, "text": text["found"], "total": 0.022179}
    alarm |= {"night": "2026-11-05", "now": say("night.alarms.still_there", told=sizes["stands"]), "confirmed": None}
    behind = {"what": "volume", "parameter": "EX0C", "unit": "mm", "since": since, "size": 0.022179, "text": text["stands"]}
    record |= {"limits": [limit], "standing": [alarm], "behind": [{**behind, "rate_per_day": None}]}
    assert "by +20.4 ± 0.5 µm" in headline(record) and "22.2" not in headline(record)
    warm = {**knock(record["night"]), "parameter": "temperature", "text": "it is warmer", "since": ""}
    assert "by +20.4 ± 0.5 µm" in headline(record | {"alarms": [warm]})  # beside an alarm of tonight, too
    alarm |= {"std": 0.0003}  # surely another number: the box has that, too
    assert "by +22.2 ± 0.6 µm" in headline(record) and "20.4" not in headline(record)


def test_a_run_without_a_touch_draws_nothing(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    run = Recorded(place, 20)
    run.begin()
    run.gone()
    with site_of(place) as site:
        page = site.get(f"/machine/{M}/run").text
        assert "0 of 20 touches" in page and "Last touches" not in page and "Deviation" not in page


@pytest.mark.long
def test_a_machine_that_was_never_measured_has_its_answer_everywhere(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    (place / "history.db").unlink()
    said = "May I make parts? Nobody knows"
    with site_of(place) as site:
        for tab in TABS:
            assert said in read(site, f"/machine/{M}{tab}"), tab
    status = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"]).output.splitlines()
    assert status[0].endswith("no night yet") and status[1].strip() == f"{said}. {texts()('may.never')}"
    run = Recorded(place, 1)
    run.begin()
    run.touch()
    run.end()
    status = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"]).output.splitlines()
    with site_of(place) as site:
        assert "23 Nov 2026" in status[1] and status[1].strip().partition("? ")[2].partition(". ")[2] in read(site, f"/machine/{M}")


def test_a_night_that_was_cut_off_before_the_first_one_is_not_yet_in_the_terminal_too(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    stamp = f"{datetime.now(UTC) - timedelta(hours=5):%Y-%m-%dT%H%M%SZ}"
    (place / "nights" / "begun").mkdir(parents=True)
    (place / "nights" / "begun" / stamp).write_text("", encoding="utf-8")
    (place / "nights" / stamp).mkdir()
    (place / "nights" / stamp / "planned.json").write_text("{}", encoding="utf-8")
    status = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"]).output
    with site_of(place) as site:
        assert "May I make parts? Not yet" in read(site, f"/machine/{M}") and "May I make parts? Not yet. " in status


def test_a_list_of_cells_calls_no_machine_late_that_was_never_measured(tmp_path: Path) -> None:
    """The terminal said LATE beside never, and the list of the pages did not count it."""
    place = cell(tmp_path / "one", records=[])
    (place / "history.db").unlink()
    other = cell(tmp_path / "two", "Fir", records=[night("Fir", 0)])
    lines = CliRunner().invoke(tango, ["fleet", str(place), str(other)]).output.splitlines()
    (never,), (late,) = ([x for x in lines if x.startswith(name)] for name in (M, "Fir"))
    assert "never" in never and "LATE" not in never and "LATE" in late


def test_each_check_that_failed_has_its_step(tmp_path: Path) -> None:
    """The gate had a step; who did that found the port closed."""
    now = datetime.now(UTC).replace(microsecond=0)
    stamps = {"night": f"{now:%Y-%m-%d}", "start_utc": f"{now:%Y-%m-%dT%H:%M:%SZ}", "end_utc": f"{now:%Y-%m-%dT%H:%M:%SZ}"}
    gate = {"check": "gate", "passed": False, "found": "the program waits for a finger", "do": "measure once with a person"}
    port = {"check": "control", "passed": False, "found": "socket://127.0.0.1:8193 does not open", "do": ""}
    nothing: dict[str, Any] = {"status": "failed", "kind": "none", "touches": 0, "parameters": None, "volume": None, "limits": []}
    record = night(M, 1, "not_measured", preflight=[gate, port], why="the program waits", **nothing, **stamps)
    place = cell(tmp_path / "one", records=[record])
    with site_of(place) as site:
        found = steps(site.get(f"/machine/{M}").text)
        assert "Measure once with a person." in found
        assert "See to the control of this machine: socket://127.0.0.1:8193 does not open." in found


def drifting() -> dict[str, Any]:
    """a night on which an alarm of a drift stands, which has gone on since → its record."""
    record = night(M, 20, "changed")
    moved = changed("EX0C", value(0.0124, "mm", 0.0003), "2026-11-07")
    text = texts()("changed.drift", moved=moved, rate=value(0.0041, "mm"))
    now = joined("; ", (say("night.alarms.now", told=value(0.02807, "mm", 0.0002)), say("night.words.stands", since="2026-11-10")))
    alarm = {**knock("2026-11-08"), "since": "2026-11-07", "size": 0.0124, "std": 0.0003, "text": text, "rate_per_day": 0.0041}
    alarm |= {"night": "2026-11-08", "now": now, "total": 0.02807, "steady": True, "confirmed": None}
    record |= {"standing": [alarm]}
    return record | {"headline": headline(record)}


def test_a_message_begins_with_the_size_that_the_page_has() -> None:
    """It began with that of the night of the alarm, 12.4 µm, and had today's 28.1 in brackets."""
    record = drifting()
    first = next(line for line in message(record, (), ())[1].splitlines() if line.startswith("Still changed"))
    assert "by +28.1 ± 0.2 µm since" in first and "12.4" not in first and "it is" not in first
    assert "+4.1 µm a day" in first and say("night.words.stands", since="2026-11-10") in first
    assert "+28 µm" in plain(record["standing"][0]["now"], Units(), texts())


def test_the_row_of_a_drift_has_size_and_date_of_its_alarm(tmp_path: Path) -> None:
    """The row had the size of the night of the alarm, and the night before it as its date."""
    place = cell(tmp_path / "one", records=[drifting()])
    with site_of(place) as site:
        row = read(site, f"/machine/{M}/nights").partition("All 1 nights")[2]
        assert "Still changed: C axis has moved along X by +28 µm since the night ending Sun 8 Nov 2026, +4.1 µm a day" in row
        assert "12 µm" not in row and "7 Nov" not in row and "that night" not in row


def test_an_alarm_has_one_size_on_a_page_in_the_fleet_and_in_the_status(tmp_path: Path) -> None:
    """Pages had +21 µm of an alarm, `tango fleet` and the status +19 µm, which was the number of its own night."""
    record = drifting()
    record["standing"][0] |= {"rate_per_day": None, "size": 0.0191, "total": 0.0212, "std": 0.0003}
    record["standing"][0] |= {"text": changed("EX0C", value(0.0191, "mm", 0.0003), "2026-11-07")}
    record["standing"][0] |= {"now": say("night.alarms.still_there", told=value(0.0212, "mm", 0.0003))}
    record["headline"] = headline(record)
    place = cell(tmp_path / "one", records=[record])
    with site_of(place) as site:
        assert "along X by +21 µm since" in read(site, f"/machine/{M}/nights")
    for words in (["fleet", str(place)], ["nightly", "-C", str(place), "--status"], ["history", "list", "-C", str(place)]):
        row = next(line for line in CliRunner().invoke(tango, words).output.splitlines() if "along X" in line)
        assert "along X by +21.2 ± 0.3 µm since" in row and "19.1" not in row, words


@pytest.mark.few(0)
def test_pages_show_the_history_that_was_put_in_place_of_another(tmp_path: Path) -> None:
    """The server kept the file open that `tango history restore` had renamed, and showed its nights until it was started again."""
    place = cell(tmp_path / "one", records=[night(M, i) for i in range(9)])
    other = cell(tmp_path / "two", records=[night(M, i) for i in range(3)])
    with site_of(place) as site:
        assert "All 9 nights" in read(site, f"/machine/{M}/nights")
        (place / "history.db").rename(place / "history.db.before")
        (other / "history.db").rename(place / "history.db")
        site.app.state.tango.places.forget()  # type: ignore[attr-defined] # five seconds later
        assert "All 3 nights" in read(site, f"/machine/{M}/nights") and read(site, f"/machine/{M}").count("2 Nov") == 0
        assert day(night(M, 2)["night"], texts()) in read(site, f"/machine/{M}")


def test_a_message_keeps_the_size_of_what_is_as_it_was_found() -> None:
    record = drifting()
    alarm = record["standing"][0]
    alarm |= {"rate_per_day": None, "total": 0.0126, "now": say("night.alarms.still_there", told=value(0.0126, "mm", 0.0003))}
    record["headline"] = headline(record)
    first = next(line for line in message(record, (), ())[1].splitlines() if line.startswith("Still changed"))
    assert "by +12.4 ± 0.3 µm since" in first and "still there: +12.6 ± 0.3 µm" in first


def test_a_message_says_of_a_drift_that_goes_on_what_it_made_since_last_night() -> None:
    """ "+3.6 µm of it since 2026-11-19", the night before it began, though that is what it made in one night; and two dates."""
    record = night(M, 30, "out_of_limits")  # of 2026-11-23
    size = value(0.0406, "mm", 0.0002)
    text = texts()("changed.drift", moved=changed("EX0C", size, "2026-11-12"), rate=value(0.0037, "mm"))
    step = say("night.goes_on.text", step=value(0.0036, "mm", 0.0002), since=say("night.alarms.last_night"), night="2026-11-13")
    alarm = {**knock(record["night"]), "id": "2026-11-13-020005-1", "since": "2026-11-12", "size": 0.0406, "std": 0.0002}
    alarm |= {"text": text, "rate_per_day": 0.0037, "steady": True, "goes_on": {"step": 0.0036, "std": 0.0002, "text": step}}
    limit = {"what": "volume", "value": 103.8, "unit": "µm", "low": 103.0, "high": 104.0, "limit": 90.0, "passed": False}
    behind = {"what": "volume", "parameter": "EX0C", "unit": "mm", "since": "2026-11-12", "size": 0.0406, "text": text}
    behind |= {"night": "2026-11-13", "rate_per_day": 0.0037, "cause": "axis_location"}
    record |= {"alarms": [alarm], "limits": [limit], "behind": [behind]}
    record["headline"] = headline(record)
    told = message(record, (), ())[1]
    first = next(line for line in told.splitlines() if line.startswith("Volume is"))
    assert "+3.6 ± 0.2 µm of it since last night" in first and "since the night ending 2026-11-13" in first
    assert told.count("since the night ending 2026-11-13 (EX0C)") == 3 and "2026-11-12" not in told


@pytest.mark.long
def test_a_drift_has_one_date_and_is_no_jump(tmp_path: Path) -> None:
    """Rows of its later nights had the last night without it; the curve called what its first night found a jump."""
    records, start = [], datetime.now(UTC).replace(microsecond=0) - timedelta(days=14)
    for i in range(14):
        now = start + timedelta(days=i)
        stamp, step = f"{now:%Y-%m-%dT%H:%M:%SZ}", 4.0 * max(0, i - 5)
        more: dict[str, Any] = {"volume": {"worst_um": 40.0 + step, "rms_um": 9.8, "std_um": 0.3}, "limits": []}
        record = night(M, i, "changed" if step else "good", night=stamp[:10], start_utc=stamp, end_utc=stamp, **more)
        record["parameters"]["EX0C"]["value"] = -0.1 + 1e-3 * step
        if step:
            since = f"{start + timedelta(days=5):%Y-%m-%d}"
            alarm = {**knock(f"{start + timedelta(days=6):%Y-%m-%d}"), "since": since, "size": 1e-3 * step, "std": 0.0003}
            text = changed("EX0C", value(1e-3 * step, "mm", 0.0003), since)
            if i > 7:
                text = texts()("changed.drift", moved=text, rate=value(0.004, "mm"))
                told = say(
                    "night.goes_on.text",
                    step=value(0.004, "mm", 0.0003),
                    since=say("night.alarms.last_night"),
                    night=alarm["id"][:10],
                )
                alarm |= {"rate_per_day": 0.004, "steady": True, "goes_on": {"step": 0.004, "std": 0.0003, "text": told}}
            record["alarms"] = [{**alarm, "text": text}] if i in (6, 8, 9, 10, 11, 12, 13) else []
        records.append(record | {"headline": headline(record | {"repaired": [], "standing": []})})
    place = cell(tmp_path / "one", records=records)
    found = f"{start + timedelta(days=6):%Y-%m-%d}"
    with site_of(place) as site:
        rows = read(site, f"/machine/{M}/nights").partition("All 14 nights")[2]
        assert rows.count(f"since the night ending {day(found, texts())}") == 6  # those of later nights
        for path in (f"/machine/{M}", f"/machine/{M}/trend"):
            assert "Jumped" not in read(site, path) and "rises by 2" in read(site, path).lower(), path


@pytest.fixture
def berlin(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.parametrize(
    ("now", "begun", "newest", "nights"),
    [
        ("2026-11-30T06:00:00+00:00", "2026-11-05T01:00:00Z", "2026-11-30", 25),  # 07:00: that of today is missing
        ("2026-11-30T23:10:00+00:00", "2026-11-05T01:00:00Z", "2026-11-30", 25),  # 00:10 of 1 Dec: its night begins at two
        ("2026-12-01T01:10:00+00:00", "2026-11-05T01:00:00Z", "2026-12-01", 26),
        ("2026-11-30T23:10:00+00:00", "2026-11-04T21:30:00Z", "2026-12-01", 26),  # of nights at half past ten in the evening
        ("2026-11-30T06:00:00+00:00", "2026-11-05T13:00:00Z", "2026-11-30", 25),  # measured by hand in the afternoon
        ("2026-11-30T06:00:00+00:00", "", "2026-11-30", 25),
    ],
)
def test_a_night_is_missing_once_it_should_have_begun(now: str, begun: str, newest: str, nights: int, berlin: Any) -> None:
    found = due(datetime.fromisoformat(now), begun)
    assert found == newest and nights_old("2026-11-05", found, 7.0) == nights


def test_the_server_says_that_it_reads_templates_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import uvicorn

    monkeypatch.setattr(uvicorn.Server, "run", lambda self, sockets: None)
    place = cell(tmp_path / "one", records=[])
    (tmp_path / "own").mkdir()
    said = CliRunner().invoke(tango, ["serve", "-C", str(place), "--port", "0", "--templates", str(tmp_path / "own")]).output
    assert f"templates and texts of {tmp_path / 'own'} were read just now: restart the server after you change one" in said
    assert "restart" not in CliRunner().invoke(tango, ["serve", "-C", str(place), "--port", "0"]).output
