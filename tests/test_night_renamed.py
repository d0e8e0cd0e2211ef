"""A name in machine.yaml that was changed: alarms under the old name are not gone, and every page says what to do."""

from __future__ import annotations

import json
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import FIRST, knock, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.history.former import formers
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings


@pytest.fixture
def renamed(tmp_path: Path) -> Path:
    folder = tmp_path / "cell"
    records = [night("OLD 5", i, cell=str(folder)) for i in range(4)]
    records[2] |= {"verdict": "changed", "alarms": [knock(records[2]["night"])]}
    cell(folder, "OLD 5", records)
    file = folder / "machine.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace("name: 'OLD 5'", "name: NEW"), encoding="utf-8")
    return folder


def fresh(name: str, cell: str) -> dict[str, Any]:
    """name, cell → a good night that has just ended."""
    now = datetime.now(UTC)
    return night(name, 5, cell=cell) | {"start_utc": now.isoformat(), "end_utc": now.isoformat(), "night": f"{now:%Y-%m-%d}"}


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(tango, list(words), standalone_mode=False)
    assert result.exception is None
    return result.return_value, " ".join(result.output.split())


def test_status_and_fleet_name_the_nights_of_the_old_name_and_its_alarms(renamed: Path) -> None:
    status, text = run("nightly", "-C", str(renamed), "--status")
    assert status == 1 and "nights of OLD 5 in this history are of this cell: 4" in text and "put the name OLD 5 back" in text
    assert "nobody has closed: 1" in text and "--machine 'OLD 5'" in text
    status, text = run("fleet", str(renamed))
    assert status == 1 and "NEW was never measured" in text and "OLD 5" in text
    status, text = run("fleet", str(renamed), "--json", "-")
    lines = {m["machine"]: m for m in json.loads(text)["machines"]}
    assert lines["OLD 5"]["alarms_open"] == 1 and lines["NEW"]["last"] is None


@pytest.mark.few(0)
def test_once_its_alarms_are_closed_and_the_new_name_is_measured_nothing_more_is_said(renamed: Path) -> None:
    with opened(renamed / "history.db") as history:
        (alarm,) = history.open_alarms("OLD 5")
        history.decide("OLD 5", Decision(alarm["id"], "accept", "Ann"))
        (other,) = formers(history, "NEW", renamed, within=True)
        assert other.alarms == other.held == () and other.nights == 4
        assert "nobody has closed: 0" in other.told("NEW", True)
        history.add_night(night("NEW", 5, cell=str(renamed)))
    assert "OLD 5" not in run("nightly", "-C", str(renamed), "--status")[1] and "OLD 5" not in run("fleet", str(renamed))[1]


@pytest.mark.few(1)
@pytest.mark.parametrize("action", ["acknowledge", "ignore"])
def test_an_alarm_that_was_answered_under_the_old_name_stays_answered(renamed: Path, action: str) -> None:
    until = (date.today() + timedelta(days=300)).isoformat() if action == "ignore" else None
    with opened(renamed / "history.db") as history:
        (alarm,) = history.open_alarms("OLD 5")
        history.decide("OLD 5", Decision(alarm["id"], action, "Ann", "", until))
        (other,) = formers(history, "NEW", renamed, within=True)
        assert other.alarms == () and [a["id"] for a in other.held] == [alarm["id"]]
        assert "nobody has answered: 0" in other.told("NEW", True) and "answered and not closed: 1" in other.told("NEW", True)
        history.add_night(fresh("NEW", str(renamed)))
    status, text = run("nightly", "-C", str(renamed), "--status")
    assert status == 0 and "OLD 5" in text and "answered and not closed: 1" in text and "--machine 'OLD 5'" in text
    status, text = run("fleet", str(renamed), "--json", "-")
    lines = {m["machine"]: m for m in json.loads(text)["machines"]}
    assert status == 0 and (lines["OLD 5"]["alarms_open"], lines["OLD 5"]["alarms_held"]) == (0, 1)


@pytest.mark.long
def test_an_alarm_that_was_ignored_until_a_day_that_is_over_has_no_answer(renamed: Path) -> None:
    with opened(renamed / "history.db") as history:
        (alarm,) = history.open_alarms("OLD 5")
        history.decide("OLD 5", Decision(alarm["id"], "ignore", "Ann", "", "2026-01-01", "2025-12-24T06:00:00+00:00"))
        (other,) = formers(history, "NEW", renamed, within=True)
        assert [a["id"] for a in other.alarms] == [alarm["id"]] and other.held == ()
        history.add_night(fresh("NEW", str(renamed)))
    assert run("nightly", "-C", str(renamed), "--status")[0] == 1 and run("fleet", str(renamed))[0] == 1


def test_what_was_ignored_until_a_day_that_is_over_asks_again(renamed: Path) -> None:
    file = renamed / "machine.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace("name: NEW", "name: OLD 5"), encoding="utf-8")
    with opened(renamed / "history.db") as history:
        (alarm,) = history.open_alarms("OLD 5")
        history.add_night(fresh("OLD 5", str(renamed)))
        history.decide("OLD 5", Decision(alarm["id"], "ignore", "Ann", "", "2026-10-30", "2026-10-28T06:00:00+00:00"))
        assert history.open_alarms("OLD 5") == history.open_alarms("OLD 5", today="2026-10-30") == ()
        assert [a["id"] for a in history.open_alarms("OLD 5", today="2026-10-31")] == [alarm["id"]]
        for now, counts in (("2026-10-29T12:00:00+00:00", (0, 1)), ("2026-11-02T12:00:00+00:00", (1, 0))):
            (standing,) = history.fleet(now)
            assert (standing.alarms_open, standing.alarms_held) == counts


def test_another_cell_of_the_same_history_is_no_former_name(renamed: Path, tmp_path: Path) -> None:
    with opened(renamed / "history.db") as history:
        assert [f.machine for f in formers(history, "NEW", renamed)] == ["OLD 5"]
        assert formers(history, "NEW", tmp_path / "elsewhere") == ()
        assert [f.machine for f in formers(history, "NEW", renamed, within=True, others={"OLD 5"})] == ["OLD 5"]
        assert formers(history, "NEW", tmp_path / "elsewhere", within=True, others={"OLD 5"}) == ()


@pytest.mark.few(0)
@pytest.mark.parametrize("path", ["/", "/alarms", "/machine/NEW"])
def test_pages_show_the_alarm_of_the_old_name_and_what_to_do(renamed: Path, path: str) -> None:
    with TestClient(create(Settings((renamed,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        text = client.get(path).text
    if path == "/alarms":
        assert "OLD 5" in text and "moved along X" in text
    else:
        assert "NEW was never measured, but nights of OLD 5" in text and "put the name OLD 5 back" in text


@pytest.mark.long
def test_every_night_under_a_new_name_says_what_waits_under_the_old_one(root: Path, tmp_path: Path) -> None:
    from support.nights_parts import Story, nights

    from tango_cnc.files import read_cell, read_world
    from tango_cnc.files.nightly import Nightly
    from tango_cnc.nightly.mail import message

    folder = root / "examples" / "trunnion"
    mine = read_cell(folder)
    with opened(tmp_path / "h.db") as history:
        old = night("OLD 5", 0, "changed", cell=str(folder))
        history.add_night(old | {"alarms": [knock(old["night"])]})
        settings = Nightly(diagnose=False)
        later = FIRST + timedelta(days=1)
        played = nights(mine, read_world(folder / "world.yaml"), history, 3, 3, Story(), settings, first=later)
        record, _ = next(played)
        assert "under this name" in record["headline"]
        assert "nights of OLD 5 in this history are of this cell: 1" in message(record, (), ())[1]
        record, _ = next(played)
        assert "nothing has changed" in record["headline"] and "alarms under its former name wait" in record["headline"]
        assert "former name OLD 5 that nobody has closed: 1" in message(record, (), ())[1]
        (alarm,) = history.open_alarms("OLD 5")
        history.decide("OLD 5", Decision(alarm["id"], "accept", "Ann"))
        record, _ = next(played)
        assert "former" not in record["headline"] and "OLD 5" not in message(record, (), ())[1]
