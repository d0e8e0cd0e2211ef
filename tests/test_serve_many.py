"""Two hundred machines in one list: what changed is computed anew, nothing else, and before the first page everything is read."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.nights import knock, night

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import Decision, opened
from tango_cnc.web import keeper
from tango_cnc.web.app import create
from tango_cnc.web.pages import decisions, fleet
from tango_cnc.web.settings import Settings

HOST, NAMES = "http://127.0.0.1", ("Ash", "Elm", "Fir")


@pytest.fixture(autouse=True, scope="module")
def aside() -> Iterator[None]:
    """What pytest has collected is out of the way of the search for cycles again when these servers have ended (conftest.py)."""
    yield
    gc.freeze()


def hall(folder: Path) -> str:
    """folder → a history of three machines that were hit in their second night, each with an alarm that nobody has answered."""
    with opened(folder / "fleet.db") as history:
        for name in NAMES:
            history.add_night(night(name, 0), None)
            history.add_night(night(name, 1, "changed", alarms=[knock("2026-10-25") | {"id": f"{name}-1"}]), None)
    return str(folder / "fleet.db")


@pytest.mark.few(0)
def test_of_many_machines_only_the_one_that_changed_is_computed_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After five seconds the causes of every alarm were computed again: two hundred machines took a second of the processor."""
    where, computed = hall(tmp_path), []
    own = fleet._faults
    monkeypatch.setattr(fleet, "_faults", lambda row, state: computed.append(row.machine.name) or own(row, state))
    app, clock = create(Settings((), history=where)), [0.0]
    app.state.tango.places.clock = lambda: clock[0]
    with TestClient(app, base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("/", "/alarms", "/"):
            clock[0] += 10
            assert site.get(path).text.count("tone") if path == "/" else "Open alarms" in site.get(path).text
        assert sorted(computed) == sorted(NAMES)
        clock[0] += 10_000  # however long ago: nothing has changed
        assert site.get("/").status_code == 200 and len(computed) == 3
        with opened(where) as history:
            history.decide("Elm", Decision("Elm-1", "acknowledge", "Bo Roy"))
        clock[0] += 10
        assert "Bo Roy" in site.get("/").text and computed[3:] == ["Elm"]
        with opened(where) as history:
            history.add_night(night("Fir", 2, "changed", alarms=[knock("2026-10-26") | {"id": "Fir-2", "parameter": "EY0C"}]), None)
        clock[0] += 10
        assert site.get("/").text.count("2 open alarms") == 1 and computed[4:] == ["Fir"]


@pytest.mark.long
def test_a_server_that_has_just_started_says_that_it_still_reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first page of 200 machines, each in a folder of its own, took eleven seconds, and nothing was to be seen."""
    go, seen = threading.Event(), []
    monkeypatch.setattr(keeper, "MANY", len(NAMES))
    monkeypatch.setattr(decisions, "both", lambda state: seen.append(go.wait(60)))
    with TestClient(create(Settings((), history=hall(tmp_path))), base_url=HOST, client=("127.0.0.1", 5000)) as site:
        for path in ("/", "/alarms", "/machine/Elm"):
            answer = site.get(path)
            assert (answer.status_code, answer.headers["refresh"], answer.headers["retry-after"]) == (503, "2", "2"), path
            assert "still reads its machines, 3 in all" in answer.text and "Ash" not in answer.text
        assert site.get("/healthz").status_code == 200 and not seen
        go.set()
        until = time.monotonic() + 60
        while site.get("/").status_code == 503:
            assert time.monotonic() < until
            time.sleep(0.02)
        assert all(name in site.get("/").text for name in NAMES)


@pytest.mark.long
def test_what_all_machines_hold_is_not_searched_for_cycles_while_a_page_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One look in thirty at 200 machines took half a second: Python stopped all threads to walk over everything that was read."""
    monkeypatch.setattr(keeper, "MANY", len(NAMES))
    app = create(Settings((), history=hall(tmp_path)))
    with TestClient(app, base_url=HOST, client=("127.0.0.1", 5000)) as site:
        until = time.monotonic() + 60
        while site.get("/").status_code == 503:
            assert time.monotonic() < until
            time.sleep(0.02)
        (row,) = (r for r in app.state.tango.places.fleet() if r.machine.name == "Ash")
        searched = {id(thing) for thing in gc.get_objects()}
        assert id(row.record) not in searched and id(app.state.tango) not in searched
    assert gc.get_freeze_count() == 0


def test_few_machines_are_read_while_the_first_page_waits(tmp_path: Path) -> None:
    app = create(Settings((), history=hall(tmp_path)))
    with TestClient(app, base_url=HOST, client=("127.0.0.1", 5000)) as site:
        assert site.get("/").status_code == 200 and not app.state.tango.keeper.reading()
        assert "tango keeper" not in {thread.name for thread in threading.enumerate()}
