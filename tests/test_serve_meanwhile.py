"""Forms that are not complete, the order of decisions, runs that begin, stop and go on while a page is open."""

from __future__ import annotations

import itertools
import json
import math
import os
import re
from datetime import date
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import PASSWORD, Recorded, cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.link.lock import holding
from tango_cnc.report.morning import context, render
from tango_cnc.report.svg import dates
from tango_cnc.report.texts import texts
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.pages.run import APART, MAP, apart
from tango_cnc.web.places import Places
from tango_cnc.web.remembered import AGAIN
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user

HOST, M = "http://127.0.0.1", "HU40T-like"
ALARM = "2026-10-25-1"


def struck(folder: Path) -> Path:
    """folder → a cell of two nights; the second has an alarm."""
    return cell(folder, records=[night(M, 0), night(M, 1, "changed", alarms=[knock("2026-10-25")])])


def client(folder: Path, users: Path) -> TestClient:
    add_user(users, "ann", PASSWORD, "operate")
    return TestClient(create(Settings((folder,), users=users)), base_url=HOST, client=("127.0.0.1", 5000))


def enter(site: TestClient) -> dict[str, str]:
    """site → the form of its alarm, as a browser has it."""
    assert site.post("/sign-in", data={"user": "ann", "password": PASSWORD}).status_code == 200
    return shown(site)


def shown(site: TestClient) -> dict[str, str]:
    """site → hidden fields of the form of its first alarm, and who is asked to have it."""
    form = site.get("/alarms").text.partition('class="decide"')[2]
    return dict(re.findall(r'type="hidden" name="(\w+)" value="([^"]*)"', form)) | {"owner": "ann"}


def decided(folder: Path) -> list[tuple[str, str, str]]:
    with opened(folder / "history.db") as history:
        return [(d.action, d.owner, d.note) for d in history.decisions(M)]


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ({"action": "ignore"}, "Ignored needs a day until when."),
        ({"action": "ignore", "until": "2020-01-01"}, "is over. Give today or a later one"),
        ({"action": "ignore", "until": "9999-12-31"}, "for a year at most"),
        ({}, "No decision was chosen."),
    ],
)
def test_a_form_that_is_not_complete_comes_back_as_it_was_filled(tmp_path: Path, typed: dict[str, str], said: str) -> None:
    place = struck(tmp_path / "one")
    with client(place, tmp_path / "users.json") as site:
        form = enter(site)
        text = site.post(f"/machine/{M}/decide", data={**form, **typed, "owner": "Bob", "note": "after the shift"}).text
    told = text.partition('role="alert">')[2].partition("</p>")[0]
    assert said in told and "axis of C" in told and "--" not in told
    assert '<details class="answer" open>' in text and 'value="Bob"' in text and 'value="after the shift"' in text
    assert ('value="ignore" required checked' in text) == ("action" in typed) and not decided(place)


def test_decisions_of_one_second_stand_in_their_order_and_name_the_alarm(tmp_path: Path) -> None:
    place, utc = struck(tmp_path / "one"), "2026-11-01T06:00:00+00:00"
    with opened(place / "history.db") as history:
        history.decide(M, Decision(ALARM, "acknowledge", "first", utc=utc))
        history.decide(M, Decision(ALARM, "acknowledge", "second", utc=utc))
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        past = site.get("/alarms").text.partition("Decisions so far")[2]
    assert past.index("second") < past.index("first") and ALARM not in past and "axis of C" in past


def test_a_run_page_that_was_open_before_the_run_follows_it(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        before = site.get(f"/machine/{M}/run").text
        assert f'data-run="" data-follow="/machine/{M}/run/step"' in before
        none = site.get(f"/machine/{M}/run/step")
        assert (none.status_code, none.headers["x-run-state"], none.headers["x-run"]) == (200, "none", "")
        run = Recorded(place, 20)
        run.begin()
        run.touch()
        step = site.get(f"/machine/{M}/run/step")
        assert step.headers["x-run"] and f'data-run="{step.headers["x-run"]}"' in site.get(f"/machine/{M}/run").text
        run.end()
        assert f'data-follow="/machine/{M}/run/step"' in site.get(f"/machine/{M}/run").text  # the next run is seen, too


def test_minutes_to_go_follow_the_pace_since_the_last_start(tmp_path: Path) -> None:
    """96 touches made before an interruption of an hour; at four seconds a touch the other twenty take two minutes."""
    from tango_cnc.link.entries import ProgramSent, Reading, StartMark
    from tango_cnc.web.live import run_of

    def touch(n: int, at: float) -> Reading:
        return Reading(n, "3", (0.0,) * 6, at, "ok", 1.0, None, (0,) * 6, "P")

    control, every = {"post": "fanuc", "port": "x"}, tuple(range(1, 31))
    head = ProgramSent("2026-11-23T06:00:00.000+00:00", "0", "M", control, "p", "3F02A91C77D0", every)
    entries = [head, StartMark("2026-11-23T06:00:01.000+00:00", 0.0), *(touch(n, 60.0 * n) for n in range(1, 6))]
    entries += [StartMark("2026-11-23T07:00:01.000+00:00", 3600.0), *(touch(n, 3600.0 + 4 * (n - 5)) for n in range(6, 11))]
    assert run_of(tmp_path, "1", entries, None).remaining == pytest.approx(80.0)
    rest = [touch(n, 3600.0 + 4 * (n - 5)) for n in range(11, 31)]
    assert not run_of(tmp_path, "1", [*entries, *rest], None).remaining


@pytest.mark.long
def test_a_run_that_has_only_begun_says_what_its_plan_takes(tmp_path: Path) -> None:
    """Before five touches have shown its pace, the list said that it has just begun, though its plan says for how long."""
    place = cell(tmp_path / "one", records=[night(M, 0)])
    run = Recorded(place, 200, expected=36 * 60.0)
    run.begin()
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for touched, minutes in ((0, 36), (1, 36), (4, 36), (5, 13)):  # of 200: 10.8 s by the plan, 4 s by the touches
            while run.made < touched:
                run.touch()
            site.app.state.tango.places.forget()  # type: ignore[attr-defined]
            assert f"{minutes} min left" in site.get("/").text and "just begun" not in site.get("/").text, touched
            assert f"{minutes} min left" in CliRunner().invoke(tango, ["fleet", str(place)]).output
            assert f"{minutes} min to go" in site.get(f"/machine/{M}/run").text
    run.end()


def test_a_machine_that_measures_says_so_beside_its_alarm(tmp_path: Path) -> None:
    """The list said that it was being measured, and the page of alarms No."""
    place = struck(tmp_path / "one")
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        card = site.get("/alarms").text.partition("<article")[2].partition("</p>")[0]
        assert "Yes, but" in card and "Measure the first part." in card and "Measuring" not in card
        run = Recorded(place, 20)
        run.begin()
        run.touch()
        site.app.state.tango.places.forget()  # type: ignore[attr-defined]
        card = site.get("/alarms").text.partition("<article")[2].partition("</p>")[0]
        assert "Measuring" in card and "Measure the first part" not in card and "Yes, but" not in card
        run.end()
        site.app.state.tango.places.forget()  # type: ignore[attr-defined]
        assert "Yes, but" in site.get("/alarms").text.partition("<article")[2].partition("</p>")[0]


def test_a_stopped_run_says_that_the_control_may_go_on(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    run = Recorded(place, 20)
    run.begin()
    run.touch()
    run.end(False, "the control has been silent for longer than 41 s")
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert "Look at the machine first: its control may still execute the program." in site.get(f"/machine/{M}/run").text


def test_a_run_that_failed_hides_no_complete_run_of_before(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[])
    first = Recorded(place, 1)
    first.begin()
    first.touch()
    first.end()
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("/", f"/machine/{M}"):
            assert "Its report is not written yet." in site.get(path).text and "its report says" not in site.get(path).text.lower()
        (place / "readings.journal").rename(place / "readings.2026-11-23.journal")
        second = Recorded(place, 20)
        second.begin()
        site.app.state.tango.places.forget()  # type: ignore[attr-defined]
        for path in ("/", f"/machine/{M}"):
            assert "first measurement" not in site.get(path).text and "A run is going on." in site.get(path).text
        second.end(False, "the line was lost")
        (place / "report.html").write_text("<p>report</p>")
        site.app.state.tango.places.forget()  # type: ignore[attr-defined]
        for path in ("/", f"/machine/{M}"):
            assert "never measured" not in site.get(path).text and "Its report says what it found." in site.get(path).text


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", ["full", "check"])
def test_a_night_at_work_is_measuring_and_its_run_is_the_live_one(tmp_path: Path, kind: str) -> None:
    """The list said Yes, and the page of the run showed the complete one of the day before."""
    place = cell(tmp_path / "one", records=[night(M, 0)])
    first = Recorded(place, 1)
    first.begin()
    first.touch()
    first.end()
    (place / "readings.journal").rename(place / "kept")
    second, folder = Recorded(place, 30), place / "nights" / "2026-10-25T020000Z"
    second.begin()
    for _ in range(5):
        second.touch()
    folder.mkdir(parents=True)
    (folder / "planned.json").write_text(json.dumps({"kind": kind, "touches": []}))
    (place / "nights" / "begun").mkdir()
    (place / "nights" / "begun" / folder.name).write_text("")
    (place / "readings.journal").rename(folder / "readings.journal")
    (place / "kept").rename(place / "readings.journal")
    os.utime(place / "readings.journal", (1, 1))
    second.gone()
    with holding(place, "tango nightly"), TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("/", f"/machine/{M}"):
            assert "Measuring" in site.get(path).text, path
        page = site.get(f"/machine/{M}/run").text
        assert "5 of 30" in page and "2026-10-25T020000Z" in page
        for asked in (["nightly", "--status"], ["fleet"]):  # they said Yes as well
            assert "Measuring, 2 min left" in CliRunner().invoke(tango, [*asked, "-C", str(place)]).output
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        text = site.get(f"/machine/{M}/run").text  # its program was killed a moment ago
        assert "See at the control whether it still goes on" in text and "min to go" not in text
    for asked in (["nightly", "--status"], ["fleet"]):
        told = CliRunner().invoke(tango, [*asked, "-C", str(place)]).output
        assert "Measuring" not in told and "Not yet" in told
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert "Not yet" in site.get("/").text, "nobody is at work there any more: it was cut off"


def test_a_name_that_no_user_may_have_is_refused_before_a_password_is_asked_for(tmp_path: Path) -> None:
    told = CliRunner().invoke(tango, ["serve", "--users", str(tmp_path / "users.json"), "--add-user", "Zoë Ott"])
    assert "Password" not in told.output and "allowed: letters, digits" in str(told.exception)


@pytest.mark.few(1)
@pytest.mark.parametrize("how", ["removed", "another password", "a file for all to read"])
def test_a_sign_in_is_worth_what_the_users_file_says_now(tmp_path: Path, how: str) -> None:
    """Who was taken out of the file read every page, and decided, for twelve hours more."""
    place, users = struck(tmp_path / "one"), tmp_path / "users.json"
    with client(place, users) as site:
        form = enter(site)
        if how == "removed":
            told = CliRunner().invoke(tango, ["serve", "--users", str(users), "--remove-user", "ann"])
            assert told.exit_code == 0 and "ann" not in users.read_text()
        elif how == "a file for all to read":
            users.chmod(0o644)
        else:
            add_user(users, "ann", PASSWORD, "operate")
        answer = site.post(f"/machine/{M}/decide", data={**form, "action": "accept"}, follow_redirects=False)
        assert answer.status_code == 303 and answer.headers["location"].startswith("/sign-in")
        assert "May I make parts" not in site.get("/").text
    assert not decided(place)
    assert CliRunner().invoke(tango, ["serve", "--users", str(users), "--remove-user", "bob"]).exit_code


def test_a_role_that_is_changed_in_the_file_counts_at_the_next_request(tmp_path: Path) -> None:
    place, users = struck(tmp_path / "one"), tmp_path / "users.json"
    with client(place, users) as site:
        form = enter(site)
        users.write_text(users.read_text().replace('"operate"', '"view"'))
        assert "Only users with the role operate" in site.get("/alarms").text
        assert site.post(f"/machine/{M}/decide", data={**form, "action": "accept"}).status_code == 403
    assert not decided(place)


@pytest.mark.long
def test_a_trend_says_how_many_parameters_it_draws(tmp_path: Path) -> None:
    records = [night(M, i) for i in range(3)]
    for i, record in enumerate(records):
        first = next(iter(record["parameters"].values()))
        record["parameters"] |= {f"X{n}": {**first, "value": first["value"] + i * n} for n in range(20)}
    with TestClient(create(Settings((cell(tmp_path / "one", records=records),))), base_url=HOST) as site:
        text = site.get(f"/machine/{M}/trend").text
    assert re.search(r"The 12 of \d\d parameters that have moved most", text)


def test_a_square_is_a_night_that_is_not_believed_as_well(tmp_path: Path) -> None:
    with TestClient(create(Settings((struck(tmp_path / "one"),))), base_url=HOST) as site:
        assert "■ beyond a limit or in doubt" in site.get("/").text


def test_a_history_whose_file_is_the_same_is_not_asked_again(tmp_path: Path) -> None:
    """A list of 200 machines, each with a history of its own, asked all of them at every look."""
    place = cell(tmp_path / "one", records=[night(M, 0)])
    clock, asked = [0.0], []
    places = Places(Settings((place,)), clock=lambda: clock[0])
    (served,) = places.machines().values()
    assert served.history is not None

    def machines() -> int:
        return places.asked(served.history, "how many", lambda: asked.append(clock[0]) or len(asked))  # type: ignore[arg-type]

    assert (machines(), machines()) == (1, 1)
    clock[0] = AGAIN - 1
    assert machines() == 1
    with opened(place / "history.db") as history:
        history.add_night(night(M, 1))
    assert machines() == 2, "another process has added a night"
    clock[0] += 2 * AGAIN
    assert machines() == 3, "what is late is a matter of the clock"
    with opened(place / "history.db") as other:
        places.forget(other)
    assert machines() == 3, "something was decided in another history"
    places.forget(served.history)
    assert machines() == 4
    places.forget()
    assert machines() == 5
    clock[0] += AGAIN / 2
    with places.early(2 * AGAIN):  # as the look of each minute asks, so that no page has to
        assert machines() == 6, "it would be asked again before the next look is over"
    clock[0] += AGAIN - 1
    assert machines() == 6, "a page asks nothing that was asked early"
    places.close()


def test_pages_of_something_older_or_narrower_say_the_answer_of_today(tmp_path: Path) -> None:
    """A report of last week said Yes, and a run of yesterday was green, on a machine that makes no parts."""
    place = struck(tmp_path / "one")
    (place / "report.html").write_text("<p>Yes</p>")
    run = Recorded(place, 1)
    run.begin()
    run.touch()
    run.end()
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("run", "report", "files"):
            text = re.sub(r"<[^>]*>|\s+", " ", site.get(f"/machine/{M}/{path}").text)
            assert re.search(r"May I make parts\?\s+Yes, but\s+Measure the first part", text), path
        (place / "report.html").unlink()
        assert "Yes, but" in site.get(f"/machine/{M}/report").text


def test_squares_of_the_map_stay_beside_their_facets_and_cover_no_other() -> None:
    """One that was in the way of another went to the other end of the table."""
    places = ((100.0, 100.0), (102.0, 101.0), (103.0, 98.0), (400.0, 100.0), (398.0, 102.0), (210.0, 390.0))
    found = apart(places)
    assert found[0] == places[0]
    assert all(math.hypot(x - a, y - b) < 2 * max(APART) for (x, y), (a, b) in zip(found, places, strict=True))
    pairs = itertools.combinations(found, 2)
    assert all(abs(a[0] - b[0]) >= APART[0] or abs(a[1] - b[1]) >= APART[1] for a, b in pairs)
    assert all(0 < x < MAP[0] and 0 < y < MAP[1] for x, y in found)
    assert apart(100 * places) == 100 * places  # more than there is room for: where they are


@pytest.mark.long
def test_a_run_that_has_only_begun_names_no_minutes(tmp_path: Path) -> None:
    """Half an hour was "1 min left" before the first touch, and an hour after it: it comes after the proof of the probe."""
    place = cell(tmp_path / "one", records=[night(M, 0)])
    run = Recorded(place, 200)
    run.begin()
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for made in range(5):
            site.app.state.tango.places.forget()  # type: ignore[attr-defined]
            text = site.get("/").text
            assert "just begun" in text and "min left" not in text, made
            assert "just begun" in CliRunner().invoke(tango, ["fleet", str(place)]).output
            run.touch()
        site.app.state.tango.places.forget()  # type: ignore[attr-defined]
        assert "13 min left" in site.get("/").text  # 195 touches of 4 s
        assert "13 min left" in CliRunner().invoke(tango, ["fleet", str(place)]).output
    run.end()


def test_squares_of_the_map_have_the_names_of_their_facets(tmp_path: Path) -> None:
    """Touches that are left were read as numbers of facets."""
    place = cell(tmp_path / "one", records=[])
    run = Recorded(place)
    run.begin()
    run.touch("3")
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        drawn = site.get(f"/machine/{M}/run").text.partition("What is still to come</h2>")[2].partition("</svg>")[0]
    names = re.findall(r'font-size="11" fill="[^"]*">([^<]*)<', drawn)
    assert {"3", "105"} <= set(names) and len(names) == len(set(names)) == drawn.count("<title>") and "X →" in drawn
    run.gone()


@pytest.mark.long
def test_who_has_an_alarm_and_who_owns_the_machine_stand_together(tmp_path: Path) -> None:
    """The telephone number of the owner was gone once somebody had acknowledged the alarm."""
    place = struck(tmp_path / "one")
    (place / "nightly.yaml").write_text("nightly: 1\nstale_days: 100000\nowner: Ann Meier, 4711\n")
    with opened(place / "history.db") as history:
        history.decide(M, Decision(ALARM, "acknowledge", "bob", utc="2026-10-26T06:00:00+00:00"))
    with TestClient(create(Settings((place,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert "Owner of the machine: Ann Meier, 4711." in site.get(f"/machine/{M}").text
    good = cell(tmp_path / "two", records=[night(M, 0)])
    (good / "nightly.yaml").write_text("nightly: 1\nstale_days: 100000\nowner: Ann Meier, 4711\n")
    with TestClient(create(Settings((good,))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert re.search(r"<dt>Whom to ask</dt><dd>Call Ann Meier, 4711", site.get(f"/machine/{M}").text), "also beside a Yes"


def test_the_first_night_compares_with_nothing() -> None:
    """The page said that nothing had changed."""
    first = night(M, 0) | {"headline": say("night.words.first_time")}
    assert context(first, (), None, texts())["first_time"] and not context(night(M, 0), (), None, texts())["first_time"]
    assert "What changed</dt><dd>It was measured for the first time" in render(first)


def test_dates_of_a_curve_name_their_month() -> None:
    """11-01 is the eleventh of January to some, and the first of November to others."""
    months = texts()("date.months").split()
    assert [name for _, name in dates(date(2026, 10, 31), 0, 29, 5, months)][-1] == "29 Nov"


def test_an_update_of_the_program_beside_a_server_that_runs_changes_no_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Templates were read anew from the disk and the program was not: pages failed until somebody restarted the server."""
    place = struck(tmp_path / "one")
    app = create(Settings((place,)))
    env = app.state.tango.templates
    wanted = {"fleet.html", "decisions.html", "machine.html", "trend.html", "run.html", "_step.html", "told.html", "framed.html"}
    assert wanted <= set(env.list_templates())
    monkeypatch.setattr(env.loader, "load", lambda *args: pytest.fail("a template was read from the disk"))
    with TestClient(app, base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("/", "/alarms", f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/run", f"/machine/{M}/night/2"):
            assert site.get(path).status_code == 200, path
