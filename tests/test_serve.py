"""Pages for a browser, asked for without a network: what they show, who may do what, and a run that is followed."""

from __future__ import annotations

import asyncio
import json
import os
import re
import socket
import time
from collections.abc import Iterator
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import PASSWORD, Recorded, cell

pytest.importorskip("starlette")
from starlette.exceptions import HTTPException
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.commands.report import nights
from tango_cnc.files import read_cell
from tango_cnc.history import Decision, opened
from tango_cnc.link.lock import holding
from tango_cnc.nightly.words import changed
from tango_cnc.records import InputError
from tango_cnc.report import morning, suspects
from tango_cnc.report.answer import answer
from tango_cnc.report.days import at
from tango_cnc.report.days import day as spoken
from tango_cnc.report.plain import plain
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import english, say
from tango_cnc.web.app import create
from tango_cnc.web.listening import listening
from tango_cnc.web.live import Looks
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import IDLE, WHOLE, SignIns, User, add_user

PAGES = ("", "/run", "/trend", "/nights", "/files", "/night/1", "/night/13")
HOST = "http://127.0.0.1"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cell(tmp_path_factory.mktemp("serve") / "hu40t")


@pytest.fixture(scope="module")
def site(folder: Path) -> Iterator[TestClient]:
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        yield client


def signed_in(app_folder: Path, users: Path, role: str = "operate") -> TestClient:
    add_user(users, "ann", PASSWORD, role)  # type: ignore[arg-type]
    client = TestClient(create(Settings((app_folder,), users=users)), base_url=HOST, client=("127.0.0.1", 5000))
    answer = client.post("/sign-in", data={"user": "ann", "password": PASSWORD}, follow_redirects=False)
    assert answer.status_code == 303, answer.text
    return client


@pytest.mark.long
def test_the_fleet_shows_every_machine_with_its_verdict(site: TestClient) -> None:
    text = site.get("/").text
    assert (
        "Yes, but: 1." in text and "The axis of C moved along X" in text and "NOBODY is named" in text
    )  # although the last night was good
    assert 'href="/machine/HU40T-like"' in text and ">Yes<" not in text
    assert len(re.findall(r"<title>\w{3} \d+ \w{3} 2026: ", text)) == 30  # a sign a night, with its day


@pytest.mark.few(2)
@pytest.mark.parametrize("path", PAGES)
def test_every_page_of_a_machine_answers(path: str, site: TestClient) -> None:
    answer = site.get(f"/machine/HU40T-like{path}")
    assert answer.status_code == 200, answer.text
    assert "HU40T-like" in answer.text
    assert not re.findall(r'(?:src|href|action)="(?:https?:)?//', answer.text)


def test_the_morning_page_answers_the_six_questions(site: TestClient) -> None:
    text = site.get("/machine/HU40T-like/night/13").text
    for wanted in (
        *("Changed", "EX0C moved by +19.8 ± 0.4 µm since last night", "The axis of C moved along X, all at once"),
        *(
            "The night ending Thu 5 Nov 2026. The night before was without it.",
            "40 µm apart",
            "Look for a collision",
            "NOBODY is named",
        ),
        "All that were made since Wed 4 Nov 2026, the last night without it.",
    ):
        assert wanted in text, wanted
    assert text.index("Whom to ask") < text.index("For the engineer")


def test_a_night_that_was_not_measured_says_why_and_what_to_do(site: TestClient) -> None:
    text = site.get("/machine/HU40T-like/night/6").text
    assert "Not measured" in text and "Change the battery of the probe." in text


def test_the_morning_page_stands_alone_in_inch_too() -> None:
    record = night("M <b>", 12, "changed", alarms=[knock("2026-11-05")])
    text = morning.render(record, units=Units("inch"))
    assert "M &lt;b&gt;" in text and "µin" in text and "+779.5" in text
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")


def test_a_night_without_a_diagnosis_and_one_that_was_missed_have_a_page() -> None:
    """Not every night diagnoses; of one that never began only its date is known."""
    record = night("M", 3)
    del record["diagnosis"], record["plausible"], record["next"], record["change"]
    assert re.findall("What changed</dt><dd>Nothing.</dd>", morning.render(record))
    bare = {k: record[k] for k in ("format", "machine", "night", "start_utc", "end_utc", "kind")}
    text = morning.render(
        {**bare, "status": "missed", "verdict": "not_measured", "headline": "no night began", "why": "no night began"}
    )
    assert "No night began" in text and "tango nightly --status" in text


@pytest.mark.parametrize(
    ("metric", "inch"),
    [
        ("C axis has moved along X by +20.3 ± 0.5 µm", "C axis has moved along X by +799 ± 20 µin"),
        ("at X −250.0 mm, 45 µm are allowed", "at X −9.843 in, 1772 µin are allowed"),
        ("a scale of 13.7 µm/m", "a scale of 13.7 µin/in"),
    ],
)
def test_sentences_are_told_in_inch(metric: str, inch: str) -> None:
    assert Units("inch").sentence(metric) == inch and Units().sentence(metric) == metric


@pytest.mark.long
def test_no_page_of_an_inch_shop_has_a_length_in_metric(folder: Path) -> None:
    app = create(Settings((folder,)))
    app.state.tango.units = Units("inch")
    with TestClient(app, base_url=HOST, client=("127.0.0.1", 5000)) as client:
        for path in ("/", "/alarms", *(f"/machine/HU40T-like{p}" for p in PAGES)):
            text = re.sub(r"<[^>]*>", " ", client.get(path).text)
            assert not re.findall(r".{20}µm.*|.{20}\d mm\b.*", text), path
            assert path != "/machine/HU40T-like/trend" or not re.findall(
                r"µin(?!/in)", text
            )  # one unit of lengths beside the tool tip


def test_a_trend_says_what_to_do_and_who_is_asked(site: TestClient) -> None:
    for path in ("/trend", "/trend?parameter=EX0C"):
        text = site.get(f"/machine/HU40T-like{path}").text
        above = text.partition("<form")[0]
        for wanted in ("May I make parts?", "Yes, but", "moved along X, all at once", "Look for a collision", "NOBODY is named"):
            assert wanted in above, (path, wanted)


def test_the_page_of_a_run_names_who_is_asked(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        Recorded(folder, 20).begin()
        assert "NOBODY is named for this machine." in site.get("/machine/HU40T-like/run").text
    (folder / "nightly.yaml").write_text("nightly: 1\nowner: Ann, 4711\n", encoding="utf-8")
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert "Call Ann, 4711." in site.get("/machine/HU40T-like/run").text


def test_a_machine_that_only_a_run_has_measured_is_not_called_unmeasured(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    run = Recorded(folder, 1)
    run.begin()
    run.touch()
    run.end()
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("/", "/machine/HU40T-like"):
            text = site.get(path).text
            assert "No night has measured this machine yet. A run has: " in text and "never measured" not in text, path
        assert "Have the report of the run written" in text and "tango report -C one" in text
        assert "in the folder that holds the folder one of this machine:" in text or path == "/"


@pytest.mark.few(1)
@pytest.mark.parametrize("reported", [False, True])
def test_a_run_after_the_newest_night_without_a_report_is_named_beside_its_answer(tmp_path: Path, reported: bool) -> None:
    """Nobody wrote a report of the run of 06:00: no page said that the machine had been measured since the night."""
    folder = cell(tmp_path / "one", records=[night("HU40T-like", 8)])
    run = Recorded(folder, 1)
    run.begin()
    run.touch()
    run.end()
    if reported:
        (folder / "report.html").write_text("<html></html>", encoding="utf-8")
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("", "/trend", "/nights"):
            text = " ".join(site.get(f"/machine/HU40T-like{path}").text.split())
            assert ("A run has measured this machine since that night (Mon 23 Nov 2026" in text) == (not reported), path
            assert ("tango report -C one" in text) == (not reported), path
        text = " ".join(site.get("/").text.split())
        for wanted in ("A run has measured this machine since that night (Mon 23 Nov 2026", "a run since then has no report"):
            assert (wanted in text) == (not reported), wanted
    for words in (("nightly", "-C", str(folder), "--status"), ("fleet", str(folder))):
        found = CliRunner().invoke(tango, [*words], catch_exceptions=False)
        assert ("no report is written of it" in " ".join(found.output.split())) == (not reported), words
        told = json.loads(CliRunner().invoke(tango, [*words, "--json", "-"], catch_exceptions=False).output)
        assert bool(told.get("machines", [told])[0]["run_without_report"]) == (not reported)


@pytest.mark.few(1)
@pytest.mark.parametrize("late", [False, True])
def test_a_report_that_is_older_than_the_newest_run_says_so(tmp_path: Path, late: bool) -> None:
    """Who opened the tab took the report of the week before for that of this morning."""
    folder = cell(tmp_path / "one", records=[])
    (folder / "report.html").write_text("<html></html>", encoding="utf-8")
    os.utime(folder / "report.html", (1e9, 1e9))
    run = Recorded(folder, 1)
    run.begin()
    run.touch()
    run.end()
    if late:
        os.utime(folder / "report.html", None)
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        text = " ".join(site.get("/machine/HU40T-like/report").text.split())
    assert ("This report is older than the newest run (Mon 23 Nov 2026" in text) == (not late)
    assert ("Have its report written" in text) == (not late)


def test_no_page_is_green_while_an_alarm_waits(site: TestClient) -> None:
    text = site.get("/machine/HU40T-like").text
    assert (
        "Measure the first part before you go on: the machine has changed, and nobody has answered since Thu 5 Nov 2026."
        in re.sub("<[^>]+>", "", text)
        and 'class="verdict good"' not in text
    )
    wanted = (
        "moved along X, all at once",
        "The night ending Thu 5 Nov 2026. The night before was without it.",
        "40 µm apart",
        "Look for a collision",
        "NOBODY is named",
    )
    assert [w for w in wanted if w not in text.partition("For the engineer")[0]] == []


def test_a_night_without_an_alarm_of_its_own_tells_of_the_open_one_and_of_what_stands_behind_a_limit() -> None:
    open_one = knock("2026-11-05") | {"night": "2026-11-05", "now": "still there: +19.9 µm"}
    page = morning.render(night("M", 12, "changed", headline="still changed", standing=[open_one])).partition("For the engineer")[0]
    wanted = (
        "The night ending Thu 5 Nov 2026. The night before was without it.",
        "Still there: +20 µm",
        "40 µm apart",
        "Look for a collision",
    )
    assert [w for w in wanted if w not in page] == []
    drift = {"what": "volume", "parameter": "EY0C", "unit": "mm", "text": "EY0C drifts by +2.1 µm a day", "since": "2026-11-01"}
    drift |= {"size": 0.02, "std": 0.0004, "rate_per_day": 0.0021, "on_part": "Holes are off by 20 µm.", "do": "Have C looked at."}
    page = morning.render(night("M", 12, "out_of_limits", behind=[drift], owner="Ann", standing=[open_one])).partition(
        "For the engineer"
    )[0]
    assert [
        w
        for w in (
            "C axis off in Y drifts by +2.1 µm a day",
            "The night ending Sun 1 Nov 2026 was the last one without it",
            "Holes are off by 20 µm.",
            "Have C looked at.",
            "Ann",
        )
        if w not in page
    ] == []


def test_the_engineers_part_has_the_date_of_the_first_screen() -> None:
    """Two alarms about one parameter are one cause: it has the date of the first everywhere, whichever is answered."""
    both = [knock(day) | {"id": f"{day}-1", "night": day} for day in ("2026-11-05", "2026-11-14")]
    page = morning.render(night("M", 25, "changed", standing=both))
    first, engineer = page.split("For the engineer")
    assert "The night ending Thu 5 Nov 2026." in first and "first seen on Thu 5 Nov 2026." in engineer
    assert "14 Nov" not in first.partition("Who has it")[0] and "2026-11-14" not in engineer and "14 Nov" not in engineer


@pytest.mark.long
def test_a_machine_out_of_limits_says_what_to_do_though_nothing_has_changed(tmp_path: Path) -> None:
    """A slow drift ends beyond a limit on a night without an alarm of its own."""
    limit = {"what": "volume", "value": 75.9, "low": 74.0, "high": 77.8, "limit": 60.0, "unit": "µm", "passed": False}
    last = night("HU40T-like", 4, "out_of_limits", headline="volume is 75.9 µm, 60 µm are allowed", limits=[limit])
    older = [night("HU40T-like", i, "changed", alarms=[knock(f"2026-11-0{i + 1}")]) for i in range(4)]
    for records, alarms in ([*older, last], True), ([last], False):
        place = cell(tmp_path / str(alarms), records=records)
        with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
            text = client.get("/machine/HU40T-like").text.partition("For the engineer")[0]
        assert "Largest error at the tool tip: 76 µm, 60 µm allowed" in text
        assert re.findall(r"<b>No <i>Out of limits", text) and "What to do" in text and "Whom to ask" in text
        assert ("What it does to parts" in text) == alarms and ("moved 4 times the same way" in text) == alarms


def test_an_answer_of_last_week_is_no_yes_of_today(tmp_path: Path) -> None:
    place = cell(tmp_path / "old", records=[night("HU40T-like", 0), night("HU40T-like", 1)])
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        for path in ("/", "/machine/HU40T-like"):
            text = client.get(path).text
            assert "Yes, but" in text and "nothing complete was measured since Sun 25 Oct 2026" in text


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        ({}, "yes"),
        ({"verdict": "changed"}, "but"),
        ({"status": "partial"}, "but"),
        ({"limits": [{"what": "volume", "value": 44.9, "limit": 45.0, "unit": "µm", "passed": None}]}, "but"),
        ({"verdict": "changed", "limits": [{"what": "volume", "value": 46, "limit": 45, "unit": "µm", "passed": False}]}, "no"),
        ({"verdict": "doubtful"}, "no"),
        ({"verdict": "not_measured"}, "unknown"),
    ],
)
def test_may_i_make_parts(change: dict[str, Any], wanted: str) -> None:
    """A crossed limit is a no, whatever else was found; nothing that is known of tonight is not a yes."""
    assert answer(night("M", 1) | change, Units(), texts()).may == wanted


def test_a_night_that_did_not_measure_tells_the_one_before_with_its_date() -> None:
    missed = night("M", 1, "not_measured", limits=[], volume=None)
    for before, wanted in ((night("M", 0), "but"), (night("M", 0, "out_of_limits"), "no")):
        told = answer(missed, Units(), texts(), before=before)
        assert (
            told.may == wanted
            and told.numbers == "Largest error at the tool tip: 21 µm, 45 µm allowed (night ending Sat 24 Oct 2026)"
        )


@pytest.mark.parametrize(
    ("recorded", "shop", "inch"),
    [
        (
            "C axis tilted about Y has changed by +40.3 ± 1.0 µrad since last night (EB0C)",
            "by 12 µm over 300 mm since",
            "0.00048 in over 12 in",
        ),
        ("most of it comes from EX0C: -115.5 ± 0.2 µm", "from C axis off in X: −116 µm", "−0.0045 in"),
        ("scale of Y has changed by +13.7 µm/m (EYY1)", "by 4.1 µm over 300 mm", "0.00016 in over 12 in"),
        ("See it with 'tango history plot EY0C'.", "'tango history plot EY0C'", "'tango history plot EY0C'"),
    ],
)
def test_the_first_screen_speaks_the_words_of_the_shop(recorded: str, shop: str, inch: str) -> None:
    told = plain(recorded, Units(), texts())
    assert shop in told and "±" not in told and "(E" not in told and "µrad" not in told
    assert inch in plain(recorded, Units("inch"), texts())


def test_a_change_is_named_by_its_axis_before_its_symbol() -> None:
    assert changed("EX0C", "+20.3 ± 0.5 µm") == "C axis has moved along X by +20.3 ± 0.5 µm since last night (EX0C)"
    assert changed("EA0B", "+9 µrad") == "B axis tilted about X has changed by +9 µrad since last night (EA0B)"


def test_without_a_report_the_page_says_how_to_write_one(site: TestClient, folder: Path) -> None:
    never = site.get("/machine/HU40T-like/report").text  # nothing that a report could be made of
    assert "no whole run has measured this machine. Have it measured." in never and "tango report" not in never
    (folder / "readings.csv").write_text("", encoding="utf-8")
    assert "tango report -C hu40t" in site.get("/machine/HU40T-like/report").text
    (folder / "report.html").write_text("<p>mine</p>", encoding="utf-8")
    answer = site.get("/machine/HU40T-like/report/alone")
    assert answer.text == "<p>mine</p>"
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("sandbox allow-scripts;") and "frame-ancestors 'self'" in policy
    framed = site.get("/machine/HU40T-like/report")
    assert 'href="/machine/HU40T-like">Back to the newest night' in framed.text and "<p>mine</p>" not in framed.text
    assert 'src="/machine/HU40T-like/report/alone"' in framed.text and 'sandbox="allow-scripts"' in framed.text
    assert framed.headers["content-security-policy"].endswith("; frame-src 'self'")
    assert "frame-src" not in site.get("/machine/HU40T-like").headers["content-security-policy"]


def test_an_old_night_says_so_and_leads_to_the_newest(site: TestClient) -> None:
    old, newest = (site.get(f"/machine/HU40T-like/night/{n}").text for n in (13, 30))
    assert "This is an old night" in old and 'class="button" href="/machine/HU40T-like">Go to the newest night' in old
    assert "this morning" not in old and "Might parts be made then?" in old and "Next night" not in old
    assert "old night" not in newest and "May I make parts?" in newest


def test_files_are_offered_and_nothing_else(site: TestClient, folder: Path) -> None:
    (folder / "program").mkdir(exist_ok=True)
    (folder / "program" / "O0001.nc").write_text("%\n", encoding="utf-8")
    assert "program/O0001.nc" in site.get("/machine/HU40T-like/files").text
    answer = site.get("/machine/HU40T-like/files/program/O0001.nc")
    assert answer.text == "%\n" and answer.headers["content-disposition"].startswith("attachment")
    for name in ("machine.yaml", "history.db", "../hu40t/report.html", "program", "program/", "program/../machine.yaml"):
        assert site.get(f"/machine/HU40T-like/files/{name}").status_code == 404, name


def test_a_run_says_when_it_began_as_every_other_page_says_a_date(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    Recorded(place).begin()
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        text = client.get("/machine/HU40T-like/run").text
    assert re.search(r"started Mon 23 Nov 2026, \d\d:\d\d", text) and "2026-11-23" not in text.partition("<details")[0]


@pytest.mark.few(0)
def test_a_run_is_followed_while_it_goes_on(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    with TestClient(create(Settings((folder,))), base_url=HOST) as site:
        waiting = site.get("/machine/HU40T-like/run").text
        assert (
            "There is no run" in waiting
            and "as soon as it starts" in waiting
            and 'data-follow="/machine/HU40T-like/run/step"' in waiting
        )
        assert site.get("/machine/HU40T-like/run/step").headers["x-run-state"] == "none"
        run = Recorded(folder, 20)
        with holding(folder, "tango run"):
            assert "Waiting for the control to start" in site.get("/machine/HU40T-like/run").text
        run.begin()
        for _ in range(5):
            run.touch()
        first = site.get("/machine/HU40T-like/run/step")
        assert "5 of 20 touches, about 1 min to go" in first.text and first.headers["x-run-state"] == "running"
        same = site.get("/machine/HU40T-like/run/step", headers={"if-none-match": first.headers["etag"]})
        assert same.status_code == 304 and not same.content
        run.touch(status="miss", deviation=None)
        run.touch(drift=3.25)
        text = site.get("/machine/HU40T-like/run/step").text
        assert "7 of 20" in text and "miss" in text and "+3.2" in text and "Facets touched again" in text
        run.end(False, "the line was lost")
        last = site.get("/machine/HU40T-like/run/step")
        assert last.headers["x-run-state"] == "stopped" and "tango run --resume" in last.text and "the line was lost" in last.text


def test_a_run_that_falls_silent_says_so_to_who_follows_it(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    run = Recorded(folder, 20)
    run.begin()
    run.touch()
    with TestClient(create(Settings((folder,))), base_url=HOST) as site:
        first = site.get("/machine/HU40T-like/run/step")
        assert "Running" in first.text and "Keep the door shut" in first.text
        long_ago = time.time() - 1500
        os.utime(folder / "readings.journal", (long_ago, long_ago))
        later = site.get("/machine/HU40T-like/run/step", headers={"if-none-match": first.headers["etag"]})
        assert later.status_code == 200 and "25 min" in later.text
        assert "Keep the door shut" not in later.text and "min to go" not in later.text
        assert later.headers["x-run-state"] == "running"  # who follows goes on asking
        assert "Nothing heard" in later.text and ">Running<" not in later.text


@pytest.mark.parametrize("begun", [True, False])
def test_a_run_whose_program_was_killed_is_not_said_to_go_on(tmp_path: Path, begun: bool) -> None:
    """A power cut: the journal has no end, nobody is at work, and the page said Running."""
    folder = cell(tmp_path / "one", records=[])
    run = Recorded(folder, 20)
    if begun:
        run.begin()
        run.touch()
        run.gone()
    with TestClient(create(Settings((folder,))), base_url=HOST) as site:
        page = site.get("/machine/HU40T-like/run").text
    assert "Running" not in page and "Waiting for the control" not in page and "Keep the door shut" not in page
    assert ("Broken off" if begun else "Not begun") in page and "The missing touches can be made afterwards." in page
    stamp = datetime.fromtimestamp((folder / "readings.journal").stat().st_mtime, UTC).isoformat()
    assert at(stamp, texts()) in page  # since when
    assert ("Look at the machine first: its control may still execute the program." in page) == begun


def test_who_asks_while_somebody_looks_gets_what_that_one_sees() -> None:
    looks, seen = Looks(), []

    def look() -> int:
        time.sleep(0.05)
        seen.append(1)
        return len(seen)

    def fails() -> int:
        raise HTTPException(404)

    async def fifty() -> None:
        assert await asyncio.gather(*(looks.at("run", look) for _ in range(50))) == [1] * 50
        assert await looks.at("run", look) == 2  # who comes later looks anew
        first = asyncio.ensure_future(looks.at("run", look))
        others = [asyncio.ensure_future(looks.at("run", look)) for _ in range(3)]
        await asyncio.sleep(0.01)
        first.cancel()  # who goes away takes it from nobody
        assert await asyncio.gather(*others) == [3] * 3
        for refusal in await asyncio.gather(*(looks.at("none", fails) for _ in range(3)), return_exceptions=True):
            assert isinstance(refusal, HTTPException)

    asyncio.run(fifty())


def test_without_users_nothing_can_be_changed(site: TestClient, folder: Path) -> None:
    answer = site.post("/machine/HU40T-like/decide", data={"alarm": "2026-11-05-1", "action": "accept"})
    assert answer.status_code == 403 and "read-only" in answer.text
    with opened(folder / "history.db") as history:
        assert not history.decisions("HU40T-like")


@pytest.mark.long
def test_an_alarm_is_acknowledged_and_has_an_owner(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one")
    site = signed_in(folder, tmp_path / "users.json")
    page = site.get("/alarms").text
    csrf = re.findall(r'name="csrf" value="([^"]+)"', page)[0]
    form = {
        "csrf": csrf,
        "alarm": "2026-11-05-1",
        "action": "acknowledge",
        "owner": "Bob",
        "note": "looking <into> it",
        "until": "",
    }
    answer = site.post("/machine/HU40T-like/decide", data=form)
    assert "No alarm waits for an answer." in answer.text and "looking &lt;into&gt; it (ann)" in answer.text
    assert "Bob (acknowledged)" in site.get("/machine/HU40T-like/night/13").text
    with opened(folder / "history.db") as history:
        assert [d.owner for d in history.decisions("HU40T-like")] == ["Bob"]
        assert not history.verify()


@pytest.mark.long
def test_beside_an_alarm_that_is_closed_pages_lead_to_what_is_open_and_keep_one_date(tmp_path: Path) -> None:
    """Who follows "close this alarm" to the form of another one decides about the wrong one."""
    text = "C axis has moved along X by +20 µm since last night"
    first = knock("2026-10-25") | {"text": text, "since": "2026-10-24"}
    second = first | {"id": "2026-10-25-2", "parameter": "EX0S", "on_part_um": 4.0, "text": "head has moved by +4.0 µm"}
    limit = {"what": "volume", "value": 79.0, "low": 77.0, "high": 81.0, "limit": 30.0, "unit": "µm", "passed": False}
    behind = {**{key: first[key] for key in ("parameter", "cause", "size", "std", "unit", "since", "text", "do")}, "share": 0.8}
    night_ = night("HU40T-like", 1, "out_of_limits", alarms=[first, second], limits=[limit], behind=[behind], owner="Ann")
    folder = cell(tmp_path / "one", records=[night("HU40T-like", 0), night_])
    site = signed_in(folder, tmp_path / "users.json")
    assert "Answer this alarm" in site.get("/machine/HU40T-like").text
    csrf = re.findall(r'name="csrf" value="([^"]+)"', site.get("/alarms").text)[0]
    answer = site.post("/machine/HU40T-like/decide", data={"csrf": csrf, "alarm": first["id"], "action": "accept"}).text
    past = answer.partition("Decisions so far")[2]
    assert "Open alarms: 1" in answer and "Sun 25 Oct 2026" in past and "24 Oct" not in past
    card = answer.partition("Decisions so far")[0]  # what the No rests on stands first; only what is open can be answered
    assert card.index("What stands behind it: <b>C axis has moved") < card.index("<b>Head has moved by +4")
    assert card.count('name="alarm"') == 1 and 'value="2026-10-25-2"' in card and "not closed" not in card
    page = site.get("/machine/HU40T-like").text
    assert "ann (accepted)" in page and "Answer what else is open" in page and "Close this alarm" not in page


@pytest.mark.long
def test_what_is_answered_and_not_closed_stays_among_the_alarms(tmp_path: Path) -> None:
    """Every page says who has it and since when; only accepted and repaired close an alarm."""
    records = [night("HU40T-like", 0), night("HU40T-like", 1, "changed", alarms=[knock("2026-10-25")])]
    place = cell(tmp_path / "one", records=records)
    day = date.today().isoformat()
    steps = (
        (Decision("2026-10-25-1", "acknowledge", "Bob", "after the shift"), "acknowledged, not closed"),
        (Decision("2026-10-25-1", "ignore", "Bob", "", day), f"ignored until {spoken(day, texts())}, not closed"),
        (Decision("2026-10-25-1", "repaired", "Bob"), ""),
    )
    for decision, mark in steps:
        with opened(place / "history.db") as history:
            history.decide("HU40T-like", decision)
        with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
            alarms, fleet, machine = (client.get(path).text for path in ("/alarms", "/", "/machine/HU40T-like"))
        assert (mark in alarms) if mark else ("No alarm is open." in alarms and "not closed" not in alarms)
        assert ("after the shift" in alarms.partition("Decisions so far")[0]) == (decision.action == "acknowledge")
        assert ("Until " in alarms.partition("Decisions so far")[0]) == (decision.action == "ignore")
        for text in (fleet, machine):
            assert "Yes, but" in text and ("Bob has it." in text) == bool(mark) and "nobody has answered" not in text


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("action", "answer", "todo"),
    [("accept", "Yes", "Nothing"), ("repaired", "Yes, but", "Measure the first part before you go on.")],
)
def test_what_was_decided_is_the_answer_until_the_next_night(tmp_path: Path, action: str, answer: str, todo: str) -> None:
    """The machine is what it is: accepted, parts may be made. Repaired, nobody has measured it yet."""
    place = cell(
        tmp_path / "one", records=[night("HU40T-like", 0), night("HU40T-like", 1, "changed", alarms=[knock("2026-10-25")])]
    )
    with opened(place / "history.db") as history:
        history.decide("HU40T-like", Decision("2026-10-25-1", action, "Bob"))
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        fleet, machine = (" ".join(re.sub("<[^>]+>", " ", client.get(p).text).split()) for p in ("/", "/machine/HU40T-like"))
    assert ("Yes, but: 1." in fleet) == (answer == "Yes, but")
    assert f"May I make parts? {answer}" in machine and ("Yes, but" in machine) == (answer == "Yes, but")
    assert f"What to do {todo}" in machine and (action == "accept" or "Run the full measurement: it shows" in machine)


def test_the_history_is_the_one_that_the_nights_write_to(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night("HU40T-like", 0)])
    (place / "history.db").rename(place / "nights.db")
    (place / "nightly.yaml").write_text("nightly: 1\nhistory: nights.db\n", encoding="utf-8")
    other = cell(tmp_path / "other", "Another", records=[])
    (other / "history.db").write_bytes(b"no database" * 99)
    with TestClient(create(Settings((place, other))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        fleet = client.get("/").text
    assert "24 Oct 2026" in fleet and "Another" in fleet and "history.db" in fleet  # the broken one is named and hides nothing
    assert nights(place, read_cell(place).machine, Units(), texts()) is not None


@pytest.mark.long
def test_who_has_not_seen_what_was_decided_decides_nothing(tmp_path: Path) -> None:
    """A tab that was left open shows an alarm as nobody's; somebody has it by now."""
    folder = cell(tmp_path / "one")
    site = signed_in(folder, tmp_path / "users.json")
    page = site.get("/alarms").text
    (seen,) = set(re.findall(r'name="seen" value="([^"]+)"', page))
    form = {"csrf": re.findall(r'name="csrf" value="([^"]+)"', page)[0], "alarm": "2026-11-05-1", "seen": seen, "owner": "Bob"}
    first = site.post("/machine/HU40T-like/decide", data={**form, "action": "acknowledge"})
    assert "Recorded: acknowledged." in first.text
    stale = site.post("/machine/HU40T-like/decide", data={**form, "action": "accept", "owner": "Eve", "note": "fine by me"})
    assert stale.status_code == 400 and "Bob has decided about this alarm meanwhile (acknowledged," in stale.text
    for what in ('value="accept" required checked', 'value="Eve"', 'value="fine by me"'):
        assert what in stale.text, "and what was typed is still there"
    with opened(folder / "history.db") as history:
        assert [d.owner for d in history.decisions("HU40T-like")] == ["Bob"]


@pytest.mark.long
def test_an_answer_that_lacks_something_is_said_in_words_of_the_page(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one")
    site = signed_in(folder, tmp_path / "users.json")
    form = {"csrf": re.findall(r'name="csrf" value="([^"]+)"', site.get("/alarms").text)[0], "alarm": "2026-11-05-1"}
    text = site.post("/machine/HU40T-like/decide", data={**form, "action": "ignore"}).text
    assert "Ignored needs a day until when." in text and "--until" not in text.partition("<h2>")[0]
    odd = site.post("/machine/HU40T-like/decide", data={**form, "action": "accept", "note": "a\x00b\x1b[31m"})
    assert odd.status_code == 400 and "found the character U+0000" in odd.text
    with opened(folder / "history.db") as history:
        assert not history.decisions("HU40T-like")


@pytest.mark.long
def test_a_form_that_comes_after_its_sign_in_says_that_nothing_was_carried_out(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one")
    site = signed_in(folder, tmp_path / "users.json")
    site.cookies.clear()
    asked = site.get("/machine/HU40T-like/nights", follow_redirects=False)
    assert asked.headers["location"] == "/sign-in?next=/machine/HU40T-like/nights"
    late = site.post("/machine/HU40T-like/decide", data={"alarm": "2026-11-05-1", "action": "accept"})
    assert "was not carried out" in late.text and 'name="next" value="/alarms"' in late.text
    for away in ("//evil.example/x", "https://evil.example", "/sign-out", "/a?b=c", "/\\evil"):
        assert 'name="next" value="/"' in site.get("/sign-in", params={"next": away}).text, away


def test_a_cell_that_is_new_is_shown_without_a_new_start(tmp_path: Path) -> None:
    one = cell(tmp_path / "one", records=[])
    find = lambda: tuple(sorted(f.parent for f in tmp_path.glob("*/tango.yaml")))  # noqa: E731
    with TestClient(create(Settings((one,), find=find)), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert "Another" not in site.get("/").text
        cell(tmp_path / "two", "Another", records=[])
        site.app.state.tango.places.forget()  # type: ignore[attr-defined] # five seconds later
        assert "Another" in site.get("/").text


@pytest.mark.long
def test_roles_are_kept(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one")
    (folder / "compensations").mkdir()
    (folder / "compensations" / "pivot.txt").write_text("19700", encoding="utf-8")
    users = tmp_path / "users.json"
    site = signed_in(folder, users, "view")
    assert "Only users with the role operate" in site.get("/alarms").text
    csrf = re.findall(r'name="csrf" value="([^"]+)"', site.get("/").text)[0]
    form = {"csrf": csrf, "alarm": "2026-11-05-1", "action": "accept"}
    assert site.post("/machine/HU40T-like/decide", data=form).status_code == 403
    assert site.get("/machine/HU40T-like/files/compensations/pivot.txt").status_code == 403
    assert signed_in(folder, users, "write-back").get("/machine/HU40T-like/files/compensations/pivot.txt").text == "19700"


@pytest.mark.long
def test_signing_out_ends_the_sign_in(tmp_path: Path) -> None:
    site = signed_in(cell(tmp_path / "one", records=[]), tmp_path / "users.json")
    csrf = re.findall(r'name="csrf" value="([^"]+)"', site.get("/").text)[0]
    key = site.cookies["tango_sign_in"]
    assert site.post("/sign-out", data={"csrf": csrf}, follow_redirects=False).status_code == 303
    site.cookies.set("tango_sign_in", key)
    assert site.get("/", follow_redirects=False).headers["location"] == "/sign-in"


def test_sign_ins_end_by_themselves() -> None:
    now = [0.0]
    sign_ins = SignIns(clock=lambda: now[0])
    key = sign_ins.begin(User("ann", "view"))
    assert sign_ins.of(key) is not None and sign_ins.of(key + "x") is None and sign_ins.of("") is None
    for _ in range(int(WHOLE / IDLE * 2) - 1):
        now[0] += IDLE / 2
        assert sign_ins.of(key) is not None
    now[0] += IDLE / 2 + 1
    assert sign_ins.of(key) is None
    key = sign_ins.begin(User("ann", "view"))
    now[0] += IDLE + 1
    assert sign_ins.of(key) is None


def test_metrics_and_health(site: TestClient) -> None:
    assert site.get("/healthz").text == "ok\n"
    text = site.get("/metrics").text
    assert 'tango_machine_alarms_open{machine="HU40T-like"} 1' in text
    assert 'tango_machine_verdict{machine="HU40T-like",verdict="good"} 1' in text
    for line in text.splitlines():
        assert line.startswith("# TYPE ") or re.fullmatch(r'[a-z_]+(\{([a-z]+="(\\.|[^"\\])*",?)+\})? [0-9.e+-]+', line), line


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--host", "0.0.0.0"], "no --users"),
        (["--host", "0.0.0.0", "--users", "u.json"], "without TLS"),
        (["--host", "0.0.0.0", "--users", "u.json", "--behind-proxy"], "without TLS"),
        (["--certificate", "c.pem"], "--certificate and --key"),
        (["-C", "nowhere"], "found no cell"),
        (["--add-user", "ann"], "found no --users"),
    ],
)
def test_what_the_command_refuses(options: list[str], said: str, folder: Path) -> None:
    found = CliRunner().invoke(tango, ["serve", *(["-C", str(folder)] if "-C" not in options else []), *options])
    assert said in str(found.exception)


def test_a_cell_that_cannot_be_read_is_told_and_hides_no_other(tmp_path: Path) -> None:
    good, bad = cell(tmp_path / "good", records=[]), cell(tmp_path / "bad", records=[])
    (bad / "machine.yaml").write_text("name: [", encoding="utf-8")
    with TestClient(create(Settings((good, bad))), base_url=HOST) as site:
        text = site.get("/").text
        assert "HU40T-like" in text and "machine.yaml" in text
        assert site.get("/machine/bad").status_code == 200


@pytest.mark.long
def test_what_is_simulated_is_marked_on_every_page(tmp_path: Path) -> None:
    """Run, trend, nights, files, machines and alarms: no number of a simulated machine stands without its mark."""
    records = [{**night("HU40T-like", i, "changed" if i == 1 else "good"), "simulated": True} for i in range(3)]
    records[1]["alarms"] = [knock("2026-10-25")]
    folder = cell(tmp_path / "one", records=records)
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        run = Recorded(folder, 20, simulated=True)
        run.begin()
        for path in ("/", "/alarms", *(f"/machine/HU40T-like{p}" for p in ("", "/run", "/trend", "/nights", "/night/2", "/files"))):
            assert "SIMULATED" in site.get(path).text, path


def test_what_was_measured_has_no_such_mark(site: TestClient) -> None:
    for path in ("/", "/alarms", *(f"/machine/HU40T-like{p}" for p in PAGES)):
        assert "SIMULATED" not in site.get(path).text, path


@pytest.mark.few(0)
def test_a_list_of_nights_says_once_what_they_have_in_common(tmp_path: Path) -> None:
    parts = {"text": say("judged.doubtful"), "who": "Ann has it", "more": "", "part": "", "gap": "", "now": ""}
    same = say("night.words.changed_since_night", night="2026-10-24", **parts)
    folder = cell(tmp_path / "one", records=[night("HU40T-like", i, "changed", headline=same) for i in range(4)])
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        text = site.get("/machine/HU40T-like/nights").text
    assert text.count("Ann has it") == 1 and text.count("Still changed since the night ending Sat 24 Oct 2026") == 3


def test_a_night_of_the_list_has_one_date(tmp_path: Path) -> None:
    text = say("changed.off", what="C axis", letter="X", size="+20.0 µm", since="2026-10-26", name="EX0C")
    parts = {"text": text, "who": "Ann has it", "more": "", "part": "", "gap": "", "now": ""}
    same = say("night.words.changed_since_night", night="2026-10-27", **parts)
    folder = cell(tmp_path / "one", records=[night("HU40T-like", 5, "changed", headline=same)])
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        text = site.get("/machine/HU40T-like/nights").text
    assert (
        "Still changed: C axis has moved along X by +20 µm since the night ending Tue 27 Oct 2026" in text
        and "Mon 26 Oct" not in text
    )


def test_why_a_night_is_in_doubt_has_no_symbol_and_no_statistics_for_the_shop(tmp_path: Path) -> None:
    what = say("plausible.lacking.tip", first="31")
    why = say("plausible.lacking.found", what=what, names="EXt, EYt", size="3.1")
    headline = say("night.words.readings_not_be_relied_on", reason=why)
    bare = "The residual of EYt is 3 standard deviations off"  # a record of before sentences had keys
    judged = {"verdict": "doubtful", "reasons": [why, bare]}
    records = [night("HU40T-like", 5, "doubtful", plausible=judged, headline=headline)]
    folder = cell(tmp_path / "one", records=records)
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        pages = {path: site.get(path).text for path in ("/", "/machine/HU40T-like", "/machine/HU40T-like/nights")}
    said = "The touches do not fit together. They look most as if the stylus tip were another one from touch 31 on"
    for path, text in pages.items():
        shop = text.partition('<details class="engineer">')[0]
        assert "EYt" not in shop and "standard deviations" not in shop and "tango diagnose" not in shop, path
    assert said in pages["/machine/HU40T-like"] and "as they should" in pages["/machine/HU40T-like"]
    assert "of their standard deviations" in pages["/machine/HU40T-like"].partition('<details class="engineer">')[2]


def test_every_reason_for_doubt_that_speaks_to_an_engineer_has_words_for_the_shop() -> None:
    t = texts()
    inside = {  # parts of other sentences, and what to change: no reasons
        *("plausible.bounds.at_most_plausible", "plausible.backlashes.way", "plausible.backlashes.both_ways"),
        *("plausible.readings.compare_with_machine", "plausible.readings.take_strategy_yaml_program_was"),
        *(
            "plausible.readings.go_on_with_tango_run",
            "plausible.backlashes.change",
            "plausible.readings.compare_column_with_control",
        ),
        *("plausible.spindle.change", "plausible.directions.give_sign_axis_motion_before"),
    }
    technical = re.compile(r"\.yaml|standard deviation|'tango |--terms|\{names\}|\{key\}|\{columns\}|\bE[XYZ]\d|degrees of freedom")
    missing = [
        key for key in t.keys if key.startswith("plausible.") and technical.search(english()[key]) and f"reason.{key}" not in t
    ]
    assert sorted(set(missing) - inside) == []
    for key in (k for k in t.keys if k.startswith("reason.plausible.")):
        own, given = (set(re.findall(r"\{(\w+)\}", english()[k])) for k in (key, key.removeprefix("reason.")))
        assert own <= given, key


def test_no_sign_has_two_meanings_on_the_trend(site: TestClient) -> None:
    """A square is a night beyond a limit, or not believed; a night with an alarm is a diamond."""
    text = site.get("/machine/HU40T-like/trend").text
    charts = text.split("<svg ")[1:]
    squares = re.compile(r'<rect [^>]*width="8\.[04]"')
    alarms = [c for c in charts if "a night with an alarm" in c]
    assert alarms and not any(squares.search(c) for c in alarms)
    assert all("beyond a limit" in c for c in charts if squares.search(c))


def test_a_machine_that_was_never_measured_says_what_to_do(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        text = site.get("/machine/HU40T-like").text
        assert "Nobody knows" in text and "never measured" in text and "tango nightly -C one" in text
        found = {
            page: site.get(f"/machine/HU40T-like/{page}").status_code for page in ("trend", "nights", "files", "run", "report")
        }
        assert found == {"trend": 200, "nights": 200, "files": 200, "run": 200, "report": 404}
        assert "Yes, but: 0. No: 0. Nobody knows: 1." in site.get("/").text


def test_the_first_run_of_a_machine_is_seen_as_one(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        run = Recorded(folder, 20, simulated=True)
        run.begin()
        run.touch()
        fleet, machine = site.get("/").text, site.get("/machine/HU40T-like").text
    assert "Measuring: 1." in fleet and "Nobody knows: " not in fleet and "SIMULATED" in fleet
    assert (
        "SIMULATED" in machine and "never measured" not in fleet + machine and "first measurement" in fleet and "first" in machine
    )
    assert "<b>Measuring</b>" in machine and "Keep the door shut" in machine and "tango nightly" not in machine


def test_a_fault_that_a_full_measurement_has_confirmed_is_not_measured_in_full_again() -> None:
    """However many short checks came after it."""
    alarm = knock("2026-11-05") | {"night": "2026-11-05", "now": "still there: +19.9 µm", "total": 0.0199}
    alarm["do"] = texts()("cause.axis_location.do", effect="19.8 µm")
    for confirmed in ("2026-11-06", None):
        record = night("M", 14, "changed", kind="check", standing=[alarm | {"confirmed": confirmed}])
        first = morning.render(record).partition("For the engineer")[0]
        assert ("Ask who was at the machine: two measurements show the change." in first) == bool(confirmed)
        assert ("Run the full measurement." in first) != bool(confirmed)


def test_a_change_has_the_date_of_the_night_that_found_it_and_says_whether_the_error_grew() -> None:
    """The night before is named where somebody asks since when, and beside the parts to check."""
    alarm = knock("2026-11-05") | {"text": changed("EX0C", "+19.8 ± 0.4 µm")}
    for was, word in ((14.0, "larger than before"), (40.0, "smaller than before"), (28.0, "no larger than before")):
        record = night("M", 12, "changed", alarms=[alarm], volume={"worst_um": 28.0, "rms_um": 9.0, "std_um": 0.5})
        told = morning.render(record, volumes={"2026-11-04": was}).partition("For the engineer")[0]
        assert "C axis has moved along X by +20 µm since the night ending Thu 5 Nov 2026" in told
        assert f"{was:.0f} µm on Wed 4 Nov 2026, 28 µm now: {word}" in told
    record = night("M", 12, "changed", alarms=[alarm], volume={"worst_um": 28.0, "rms_um": 9.0, "std_um": 0.5})
    twice = record | {"alarms": [alarm | {"since": record["night"]}]}  # two nights of one date
    assert "Error at the tool tip" not in morning.render(twice, volumes={record["night"]: 28.0})
    drift = alarm | {"since": "2026-10-26", "rate_per_day": 0.002}
    assert "since Mon 26 Oct 2026" in morning.render(night("M", 12, "changed", alarms=[drift]))  # it did not come in one night
    assert "Error at the tool tip" not in morning.render(night("M", 12))


def test_where_no_night_was_within_the_limit_every_part_is_in_question() -> None:
    beyond = [("2026-11-05", "out_of_limits"), ("2026-11-04", "not_measured"), ("2026-11-03", "out_of_limits")]
    assert suspects.never_within(beyond) == "2026-11-03" and suspects.last_within(beyond) == ""
    assert suspects.never_within([*beyond, ("2026-11-02", "changed")]) == ""
    limit = {"what": "volume", "value": 60.0, "unit": "µm", "low": 59.0, "high": 61.0, "limit": 45.0, "passed": False}
    told = morning.render(night("M", 12, "out_of_limits", limits=[limit]), never="2026-11-03")
    assert "All: no night since Tue 3 Nov 2026 was within the limit." in told
    assert "Since the first measured night, that ending Tue 3 Nov 2026: no night was within the limit." in told
    within = morning.render(night("M", 12, "out_of_limits", limits=[limit]), within="2026-11-03")
    assert "The night ending Tue 3 Nov 2026 was the last one within the limit." in within


def test_a_port_that_is_in_use_says_who_has_it_and_what_to_do(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    with socket.create_server(("127.0.0.1", 0)) as held:
        port = held.getsockname()[1]
        found = CliRunner().invoke(tango, ["serve", "-C", str(folder), "--port", str(port)], standalone_mode=False)
    assert isinstance(found.exception, InputError) and "Errno" not in str(found.exception)
    assert f"{port} of 127.0.0.1 is in use" in str(found.exception) and f"--port {port + 1}" in str(found.exception)
    assert "shows" not in found.stdout  # nothing is said of pages that nobody can open
    if Path("/proc/net/tcp").exists():
        name = Path("/proc/self/comm").read_text(encoding="utf-8").strip()  # and no argument of it, which may be a secret
        assert f"process {os.getpid()} ({name}) listens there" in str(found.exception)


def test_an_address_of_another_computer_is_refused_in_words() -> None:
    with pytest.raises(InputError, match="no address of this computer"):
        listening("192.0.2.1", 0)
    with pytest.raises(InputError, match="no address of this computer"):
        listening("no.such.host.invalid", 0)
    with listening("127.0.0.1", 0) as free:
        assert free.getsockname()[1] > 0


@pytest.mark.long
def test_cells_of_one_name_have_their_folders_and_a_night_that_was_cut_off_is_told(tmp_path: Path) -> None:
    one, other = (cell(tmp_path / name, records=[night("HU40T-like", 3)]) for name in ("hall", "copy"))
    begun = other / "nights" / "begun"
    begun.mkdir(parents=True)
    (begun / "2026-11-23T020000Z").write_text("2026-11-23T02:00:00Z")
    (begun.parent / "2026-11-23T020000Z").mkdir()
    (begun.parent / "2026-11-23T020000Z" / "planned.json").write_text("{}")  # written before anything is sent
    with TestClient(create(Settings((one, other))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        page = site.get("/").text
        slugs = re.findall(r'href="/machine/([^"/]+)"', page)
        machines = [site.get(f"/machine/{slug}").text for slug in dict.fromkeys(slugs)]
    assert page.count(f">{one}</span>") == page.count(f">{other}</span>") == 1
    assert sum("Look at the machine first" in row for row in page.split('<li class="')) == 1
    assert sum("Look at the machine first" in m for m in machines) == 1
    assert sum("It began and has not ended" in m for m in machines) == 1  # it is in the list of nights and in the row of signs
    assert page.count("<title>Mon 23 Nov 2026: Stopped early") == sum("<title>Mon 23 Nov 2026: S" in m for m in machines) == 1


@pytest.mark.few(0)
def test_a_machine_that_nobody_has_measured_lately_is_not_called_steady(tmp_path: Path) -> None:
    """Nights of October, read a year later: what stood then is unknown since; the list says so in a line."""
    records = [night("HU40T-like", day) for day in range(5)]
    records[-1] |= {"verdict": "changed", "alarms": [knock("2026-10-27")]}
    place = cell(tmp_path / "one", records=records)
    (place / "nightly.yaml").write_text("nightly: 1\nstale_days: 1\n", encoding="utf-8")
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        fleet, machine, trend = (site.get(path).text for path in ("/", "/machine/HU40T-like", "/machine/HU40T-like/trend"))
    assert '<li class="unknown worst">' in fleet and "<b>Have it measured first:</b> not measured for " in fleet
    for text in (machine, trend):
        assert "Unknown since Wed 28 Oct 2026" in text and "nobody knows: unknown since Wed 28 Oct 2026" in text
        assert "Steady" not in text and "Within its limit" not in text and "till there: " not in text
