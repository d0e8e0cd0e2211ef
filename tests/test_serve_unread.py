"""A history that cannot be read: its machine is named so, with whom to ask and what to do, and hides no other one."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest
from support import postgres
from support.nights import hit, into
from support.pages import site_of
from support.server import BAD, GOOD, PASSWORD, asks, cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import opened
from tango_cnc.web.users import add_user


def looked_at(site: TestClient, what: str = "database") -> None:
    """Every page of a server, one of whose histories cannot be read: a database that is off, or a file."""
    listed = " ".join(site.get("/").text.split())
    assert "Nobody knows: the history of these cannot be read" in listed and f'href="/machine/{GOOD}"' in listed
    part = listed[listed.index(f'href="/machine/{BAD}"') :]
    assert "Ann Meier, 4711" in part and f"Have the {what} with the history looked at" in part
    assert max(listed.count("it cannot be read ("), listed.count("connection failed")) <= 1  # one sentence may say both
    alarms = site.get("/alarms").text
    assert "Its alarms are not known: its history cannot be read." in alarms and "Ann Meier, 4711" in alarms
    assert "No alarm is open" not in alarms and "Nothing was decided yet" not in alarms
    assert f'id="{GOOD}"' in alarms
    numbers = site.get("/metrics").text
    assert f'tango_machine_readable{{machine="{BAD}"}} 0' in numbers and f'tango_machine_readable{{machine="{GOOD}"}} 1' in numbers
    assert f'tango_machine_alarms_open{{machine="{GOOD}"}} 1' in numbers
    assert f'tango_machine_alarms_open{{machine="{BAD}"}}' not in numbers
    for name, wanted in ((GOOD, "C axis"), (BAD, "The history of this machine cannot be read")):
        for page in ("", "/nights", "/trend"):
            answer = site.get(f"/machine/{name}{page}")
            assert answer.status_code == 200, (name, page)
            assert page or wanted in answer.text
            assert ("What the nights have found cannot be shown" in answer.text) == bool(page and name == BAD)
            assert "No night has estimated a parameter" not in answer.text and "All 0 nights" not in answer.text
    assert "One can be written when the history can be read." in site.get(f"/machine/{BAD}/report").text
    assert "This machine was never measured" not in site.get(f"/machine/{BAD}").text


def test_a_history_that_breaks_takes_no_page_of_another_machine(tmp_path: Path) -> None:
    """Every page of every machine was 503."""
    good, bad = asks(cell(tmp_path / "good", GOOD, hit(GOOD))), asks(cell(tmp_path / "bad", BAD, hit(BAD)))
    with site_of(good, bad) as site:
        assert site.get("/alarms").text.count('class="alarm-card') == 2
        spoil(bad / "history.db")
        looked_at(site, "file")


def test_a_place_of_a_history_that_is_stated_wrongly_has_an_order_of_its_own(tmp_path: Path) -> None:
    """Of a variable that is missing: "whether it is switched on, and the network between"."""
    bad = asks(cell(tmp_path / "bad", BAD, []), "history: postgresql://tango:${TANGO_NO_SUCH_VARIABLE}@127.0.0.1:1/x\n")
    with site_of(bad) as site:
        for path in ("/metrics", "/", "/alarms", f"/machine/{BAD}"):  # /metrics of a server that nobody has asked yet
            text = site.get(path).text
            if path == "/metrics":
                assert f'tango_machine_readable{{machine="{BAD}"}} 0' in text
            else:
                assert "Have the way to the history looked at: the place that nightly.yaml states" in text, path


def test_a_decision_that_no_history_takes_says_so(tmp_path: Path) -> None:
    """It was 503, and neither that it was not recorded nor what had been typed stood there."""
    bad, users = asks(cell(tmp_path / "bad", BAD, hit(BAD))), tmp_path / "users"
    add_user(users, "Olga", PASSWORD, "operate")
    with site_of(bad, users=users) as site:
        site.post("/sign-in", data={"user": "Olga", "password": PASSWORD})
        page = site.get("/alarms").text
        csrf = page.partition('name="csrf" value="')[2].partition('"')[0]
        spoil(bad / "history.db")
        form = {"csrf": csrf, "alarm": f"{BAD}-1", "seen": "0", "action": "acknowledge", "owner": "Bob", "note": "new clamp"}
        for _ in range(2):  # while it is found, and once it is known
            answer = site.post(f"/machine/{BAD}/decide", data=form)
            assert answer.status_code == 503
            assert "was not recorded: " in answer.text and "Send it again when the history can be read." in answer.text
            assert "It was: acknowledged, Bob, “new clamp”." in answer.text


@pytest.mark.long
@pytest.mark.system("pg_lsclusters")
@pytest.mark.parametrize("before", [True, False])
def test_a_database_that_is_switched_off_takes_no_page_of_another_machine(tmp_path: Path, before: bool) -> None:
    """A server that was started meanwhile said "No alarm is open" of two that were."""
    good, bad = asks(cell(tmp_path / "good", GOOD, hit(GOOD))), cell(tmp_path / "bad", BAD, [])
    with ExitStack() as server:
        url = postgres.database(server.enter_context(postgres.server()))
        with opened(url) as history:
            into(history, hit(BAD))
        asks(bad, f"history: {url}\n")
        with site_of(good, bad) as site:
            if before:
                assert site.get("/alarms").text.count('class="alarm-card') == 2
                server.close()
                looked_at(site)
        if not before:
            server.close()
            with site_of(good, bad) as site:
                looked_at(site)


def spoil(file: Path) -> None:
    """Nothing in the file of a history can be read any more."""
    with file.open("r+b") as open_file:
        open_file.write(b"\xff" * file.stat().st_size)
