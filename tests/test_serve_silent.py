"""A database that takes the connection and is silent holds no page: one that never spoke, that stops, that is locked."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from click.testing import CliRunner
from support import postgres
from support.nights import hit, into
from support.pages import site_of
from support.server import BAD, GOOD, PASSWORD, asks, cell

pytest.importorskip("psycopg")

from tango_cnc.cli import tango
from tango_cnc.history import opened
from tango_cnc.records import LinkError
from tango_cnc.web.remembered import FRESH
from tango_cnc.web.users import add_user

FIRST, NEXT = 6.0, 1.5  # s: the look that finds it out, and every other one


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tango_cnc.web.places.PATIENCE", 2.0)


@pytest.fixture
def silent() -> Iterator[str]:
    """URL of a server that takes every connection and never says a word."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"postgresql://tango@127.0.0.1:{server.getsockname()[1]}/tango"


def timed(site: object, path: str) -> tuple[str, float]:
    began = time.monotonic()
    text = site.get(path).text  # type: ignore[attr-defined]
    return text, time.monotonic() - began


def shows(site: object, first: float) -> None:
    """The machine whose database is silent is named, the other one is as it is; the first page may wait, no other one."""
    text, took = timed(site, "/")
    assert took < first and "Nobody knows: the history of these cannot be read" in text and f'href="/machine/{GOOD}"' in text
    for path in ("/", "/alarms", f"/machine/{GOOD}", f"/machine/{BAD}", f"/machine/{BAD}/trend", "/metrics"):
        text, took = timed(site, path)
        assert took < NEXT, path
    assert f'tango_machine_readable{{machine="{BAD}"}} 0' in text and f'tango_machine_readable{{machine="{GOOD}"}} 1' in text


@pytest.mark.long
def test_a_server_that_takes_the_connection_and_is_silent(tmp_path: Path, silent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look that asked it again held a page for ten seconds."""
    good, bad = asks(cell(tmp_path / "good", GOOD, hit(GOOD))), asks(cell(tmp_path / "bad", BAD, []), f"history: {silent}\n")
    with site_of(good, bad) as site:
        shows(site, FIRST)
        monkeypatch.setattr("tango_cnc.web.places.AWAY", 0.0)  # asked again at every look: beside the page
        shows(site, NEXT)


@pytest.mark.few(0)
def test_many_databases_that_are_silent_hold_a_page_no_longer_than_one(
    tmp_path: Path, silent: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They were asked one after the other: ten of them held the list for fifty seconds."""
    monkeypatch.setattr("tango_cnc.web.places.PATIENCE", 1.0)
    every = [asks(cell(tmp_path / f"bad{i}", f"{BAD} {i}", []), f"history: {silent}{i}\n") for i in range(8)]
    with site_of(asks(cell(tmp_path / "good", GOOD, hit(GOOD))), *every) as site:
        text, took = timed(site, "/")
        assert took < 5.0 and text.count("Have the database with the history looked at") == 8 and f'href="/machine/{GOOD}"' in text


def test_the_list_in_a_terminal_asks_them_at_once_too(tmp_path: Path, silent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody waits there: a night may wait for two minutes, a list not."""
    from tango_cnc.commands import fleet

    assert fleet.PATIENCE < 30.0
    monkeypatch.setattr(fleet, "PATIENCE", 1.0)
    every = [str(asks(cell(tmp_path / f"bad{i}", f"{BAD} {i}", []), f"history: {silent}{i}\n")) for i in range(8)]
    good = str(asks(cell(tmp_path / "good", GOOD, hit(GOOD))))
    began = time.monotonic()
    found = CliRunner().invoke(tango, ["fleet", good, *every], catch_exceptions=False)
    assert time.monotonic() - began < 6.0
    assert found.output.count("not in the list, as it cannot be read") == 8 and GOOD in found.output
    monkeypatch.chdir(every[0])  # one cell alone
    began = time.monotonic()
    assert CliRunner().invoke(tango, ["fleet"]).exit_code and time.monotonic() - began < 6.0


@contextmanager
def locked(url: str) -> Iterator[None]:
    """Somebody has the tables for himself."""
    import psycopg

    with psycopg.connect(url) as other:
        other.execute("LOCK TABLE night, entry IN ACCESS EXCLUSIVE MODE")
        yield


@contextmanager
def stopped(url: str) -> Iterator[None]:
    """Every process of the server stands still; the kernel goes on to acknowledge what is sent to it."""
    import psycopg

    with psycopg.connect(url) as other:
        (row,) = other.execute("SELECT setting FROM pg_settings WHERE name = 'data_directory'").fetchall()
    head = int(Path(row[0], "postmaster.pid").read_text().split()[0])
    own = subprocess.run(["ps", "-o", "pid=", "--ppid", str(head)], capture_output=True, text=True, check=True).stdout.split()
    every = [head, *map(int, own)]
    try:
        for pid in every:
            with suppress(ProcessLookupError):  # what served a connection that was closed has ended
                os.kill(pid, signal.SIGSTOP)
        yield
    finally:
        for pid in every:
            with suppress(ProcessLookupError):  # what served a connection that was closed has ended
                os.kill(pid, signal.SIGCONT)


@pytest.mark.long
@pytest.mark.system("pg_lsclusters")
@pytest.mark.parametrize("silenced", [locked, stopped])
def test_a_database_that_falls_silent_while_pages_are_shown(tmp_path: Path, silenced: object) -> None:
    """A page waited for as long as the lock was held, and a decision with it."""
    users = tmp_path / "users"
    add_user(users, "Olga", PASSWORD, "operate")
    with postgres.server() as server:
        url = postgres.database(server)
        with opened(url) as history:
            into(history, hit(BAD))
        good, bad = asks(cell(tmp_path / "good", GOOD, hit(GOOD))), asks(cell(tmp_path / "bad", BAD, []), f"history: {url}\n")
        with site_of(good, bad, users=users) as site:
            site.post("/sign-in", data={"user": "Olga", "password": PASSWORD})
            page = site.get("/alarms").text
            assert page.count('class="alarm-card') == 2
            csrf = page.partition('name="csrf" value="')[2].partition('"')[0]
            form = {"csrf": csrf, "alarm": f"{BAD}-1", "seen": "0", "action": "acknowledge", "owner": "Bob", "note": "new clamp"}
            with silenced(url):  # type: ignore[operator]
                began = time.monotonic()
                answer = site.post(f"/machine/{BAD}/decide", data=form)
                assert answer.status_code == 503 and "was not recorded: " in answer.text and time.monotonic() - began < 2 * FIRST
                shows(site, FIRST)
                with pytest.raises(LinkError), opened(url, create=False, patience=2.0) as history:
                    history.nights()
            began = time.monotonic()
            while "Nobody knows: the history of these" in site.get("/").text:
                assert time.monotonic() - began < 30
                time.sleep(0.5)
            assert "new clamp" not in site.get("/alarms").text


@pytest.mark.long
@pytest.mark.system("pg_lsclusters")
def test_ten_databases_that_stop_while_pages_are_shown_hold_a_page_as_long_as_one(tmp_path: Path) -> None:
    places = [cell(tmp_path / "good", GOOD, hit(GOOD))]
    with postgres.server() as server:
        for i in range(10):
            url = postgres.database(server)
            with opened(url) as history:
                into(history, hit(f"{BAD} {i}"))
            places.append(asks(cell(tmp_path / f"bad{i}", f"{BAD} {i}", []), f"history: {url}\n"))
        with site_of(*places) as site:
            assert "cannot be read" not in site.get("/").text
            with stopped(url):
                time.sleep(FRESH + 0.5)
                text, took = timed(site, "/")
                assert took < 2 * FIRST and text.count("Have the database with the history looked at") == 10, took
                assert timed(site, "/")[1] < NEXT
