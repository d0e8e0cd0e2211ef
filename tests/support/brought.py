"""What somebody else brings: backups, keys and certificates, forms, programs and records of a control, mistakes of yesterday."""

from __future__ import annotations

import asyncio
import random
import re
import shutil
import warnings
import zlib
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import click

import postprocessors as posts
from sim_controller.languages import Alarm, Silence
from sim_controller.probing import Rig, rig
from sim_controller.session import Session, Setup, tape
from support.databases import MIGRATE, REFUSES, _engine, damaged, good, migrated, rewritten
from support.dialects import control_of
from support.linkparts import MARK, job
from support.mutants import Reader
from support.nights import knock, night
from support.nights_parts import machine_of, settings_of
from support.remembered import remembered
from support.shopfiles import whole
from tango_cnc.commands.capability import _merge
from tango_cnc.commands.history import restore
from tango_cnc.history import opened
from tango_cnc.link import protocols
from tango_cnc.plan import plan_hash
from tango_cnc.records import InputError, TangoError, World

HOST = "http://127.0.0.1"
RECORDS = "".join(
    f"\x12{line}\r\n\x14"
    for line in (
        f"TANGO START {MARK} 3",
        "P1 H1 X20.0030 Y0.0000 Z50.0000 B0.0000 C0.0000",
        "P2 H1 X0.0000 Y30.0120 Z50.0000 B0.0000 C0.0000",
        "P3 H1 X-5.0000 Y5.0000 Z69.9980 B30.0000 C270.0000",
        f"TANGO END {MARK} 3",
    )
)
NIGHTLY = 'nightly: 1\nhistory: history.db\nowner: Ann  # of the hall\nnotify: ["mailto:ann@example.org", "file:///tmp/x"]\n'


def _schema(backup: Path) -> Callable[[Any], None]:
    """backup → what sees to the schema of a history: one file in ten, the one whose bytes say so, has it from Alembic."""
    return MIGRATE if zlib.crc32(backup.read_bytes()) % 10 == 0 else migrated


def _restored(folder: Path) -> Any:
    """A backup becomes the history of a cell that has one: either it does, or that one stays what it is."""
    there, before = folder / "restored", b"the history of today"
    shutil.rmtree(there, ignore_errors=True)
    there.mkdir()
    for ending in ("-wal", "-shm", "-journal"):
        (folder / f"backup.db{ending}").unlink(missing_ok=True)
    (there / "history.db").write_bytes(before)
    try:
        with (
            click.Context(restore),
            patch("tango_cnc.history._database.create_engine", _engine),
            patch("tango_cnc.history._database._migrate", _schema(folder / "backup.db")),
            redirect_stdout(StringIO()),
            redirect_stderr(StringIO()),
        ):
            broken = restore.callback(folder / "backup.db", there, str(there / "history.db"))  # type: ignore[misc]
    except BaseException:
        assert [f.name for f in there.iterdir()] == ["history.db"], sorted(f.name for f in there.iterdir())
        assert (there / "history.db").read_bytes() == before, "the history of before is lost"
        raise
    with opened(there / "history.db", create=False) as history:
        assert bool(history.verify()) == bool(broken), "a chain that is broken is said"
    return None


@cache
def _pages(folder: Path) -> tuple[Any, str, str]:
    """folder → what posts forms to a server of one machine with an alarm, the address, the token of its sign-in."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from starlette.testclient import TestClient

    from support.server import PASSWORD
    from support.server import cell as shown
    from tango_cnc.web.app import create
    from tango_cnc.web.settings import Settings
    from tango_cnc.web.users import add_user

    place = shown(folder / "served", "M", [night("M", 0), night("M", 1, "changed", alarms=[knock("2026-10-25")])])
    add_user(folder / "served.json", "ann", PASSWORD, "operate")
    client = TestClient(create(Settings((place,), users=folder / "served.json", rate=1e9)), base_url=HOST)
    client.post("/sign-in", data={"user": "ann", "password": PASSWORD})
    token = re.findall(r'name="csrf" value="([^"]+)"', client.get("/alarms").text)[0]
    return client, "/machine/M/decide", token


def _form(folder: Path) -> bytes:
    token = _pages(folder)[2]
    return f"csrf={token}&alarm=2026-10-25-1&action=ignore&until=2026-12-01&owner=Ann+B&note=seen%20it".encode()


def _posted(folder: Path) -> Any:
    """The form as a browser sends it, straight to the application: a client in between costs ten times as much."""
    client, path, _ = _pages(folder)
    data = (folder / "form.txt").read_bytes()
    cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    headers = {"host": "127.0.0.1", "content-type": "application/x-www-form-urlencoded", "content-length": str(len(data))}
    scope = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": "POST", "scheme": "http", "path": path,
        "raw_path": path.encode(), "query_string": b"", "root_path": "", "client": ("127.0.0.1", 50000),
        "server": ("127.0.0.1", 80),
        "headers": [(name.encode(), value.encode()) for name, value in {**headers, "cookie": cookies}.items()],
    }  # fmt: skip
    sent: list[Any] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": data, "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    _loop().run_until_complete(client.app(scope, receive, send))
    status = sent[0]["status"]
    if status in (400, 403, 413):
        raise InputError("refused")
    assert status == 303, status


@cache
def _loop() -> asyncio.AbstractEventLoop:
    return asyncio.new_event_loop()


@cache
def _rig(folder: Path) -> Rig:
    cell = whole(folder)[0]
    return rig(cell.machine, cell.artefact, World(), None)


def _run(post: str) -> Reader:
    """→ the program of a post, as the simulated control of its language takes it."""
    spoken = control_of(post)

    def program(folder: Path) -> bytes:
        made = whole(folder)[1]
        lines = posts.program(posts.load(post), made, {"gate": "none"}, plan_hash(made))[2]()
        return "\n".join([*lines, ""]).encode()

    def read(folder: Path) -> None:
        session = Session(_rig(folder), Setup(family=spoken.family, library=spoken.library))
        try:
            with remembered():
                session.run(session.control(lambda data: None), tape(folder / f"taken-{post}.nc"))
        except Alarm as alarm:
            raise InputError(str(alarm)[:3000]) from None
        except Silence:
            return

    return Reader(f"taken-{post}.nc", program, read)


def _listened(folder: Path) -> Any:
    """What a control has printed, in pieces → events of the client."""
    data = (folder / "records.txt").read_bytes()
    client = protocols.load("dnc").Client(job(), {"program": "stored"})
    chance, at, found = random.Random(len(data)), 0, []
    while at < len(data):
        count = chance.choice([1, 7, 60, 1000])
        found += client.receive(data[at : at + count])
        at += count
    return found


def _merged(folder: Path) -> None:
    line = {"source": "repeatability", "std": 0.0005}
    file = folder / "budget.yaml"
    data = file.read_bytes()
    try:
        _merge(file, "contributions", "source", [line])
    except TangoError:
        assert file.read_bytes() == data
        raise


def _salvaged(folder: Path) -> Any:
    settings, _ = settings_of(folder)
    return [settings, machine_of(folder, ("small", "other"))]


def _backup(spoil: Callable[[bytes, random.Random], bytes]) -> Reader:
    return Reader("backup.db", good, _restored, spoil, REFUSES)


def _words(folder: Path) -> bytes:
    return RECORDS.encode()


BROUGHT: dict[str, Reader] = {
    "backup.db": _backup(damaged),
    "backup-rows": _backup(rewritten),
    "form": Reader("form.txt", _form, _posted),
    "records": Reader("records.txt", _words, _listened),
    "nightly.yaml-after-a-mistake": Reader("nightly.yaml", lambda f: NIGHTLY.encode(), _salvaged),
    "uncertainty.yaml-added-to": Reader(
        "budget.yaml", lambda f: b"contributions:\n  - {source: repeatability, std: 0.0006}\n  - {source: bar}\n", _merged
    ),
    **{f"taken-{post}": _run(post) for post in posts.names() if post == "fanuc" or posts.load(post).language != "macro_b"},
}
