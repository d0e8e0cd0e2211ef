"""Sessions of twelve touches over real servers of FTP, FTPS, SFTP, SMB, LSV2 and OPC UA behind a network that breaks.

python -m pytest -m long -s tests/test_link_net_campaign.py                              200 sessions each
TANGO_SESSIONS=3000 python -m pytest -m campaign -s tests/test_link_net_campaign.py      as many as you like, each
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections import Counter
from urllib.parse import urlsplit

import pytest
from pyftpdlib.handlers import DTPHandler, TLS_DTPHandler
from support import linkfaults
from support.lsv2 import Control, serving
from support.netfaults import Disk, Drive, Proxy, Variables, behind, net_session, patched
from support.opcua import FOLDER, control
from support.remote import KINDS, NEEDED, free_port, ftp_server, place

LINKS = (*KINDS, "lsv2", "opcua")
CAMPAIGN = int(os.environ.get("TANGO_SESSIONS", "3000"))
PARTS = 4  # of the long test
pytestmark = pytest.mark.xdist_group("network")


def marked(kind, *more):
    system = [pytest.mark.system(*NEEDED[kind])] if kind in NEEDED else []
    return pytest.param(kind, marks=[*system, *more])


class Ways:
    """Gives the way of a session to the proxy, and to the data connections of FTP."""

    def __init__(self, proxy: Proxy) -> None:
        self.proxy = proxy

    def __call__(self, way) -> None:
        self.proxy.way = way


def breaking(kind, ways):
    """Data connections of an FTP server that break."""
    base = TLS_DTPHandler if kind == "ftps" else DTPHandler

    class Breaks(base):
        def send(self, data):
            if ways.proxy.way.happens("data cut"):
                super().send(data[: len(data) // 2])
                self.close()
                return 0
            return super().send(data)

        def recv(self, size):
            if ways.proxy.way.happens("data cut"):
                self.close()
                return b""
            return super().recv(size)

    return Breaks


@contextlib.contextmanager
def served(kind, tmp_path):
    """→ the port's URL, who gets the way of a session, the disk."""
    if kind == "lsv2":
        drive = Control()
        with serving(drive) as port, behind(port) as proxy:
            yield f"lsv2://127.0.0.1:{proxy.port}/TNC:/TANGO.TXT?program=TNC:/O8700.NC", Ways(proxy), Drive(drive)
        return
    if kind == "opcua":
        port = free_port()
        with control(port) as server, behind(port) as proxy:
            yield f"opcua://127.0.0.1:{proxy.port}?program={FOLDER}", Ways(proxy), Variables(server)
        return
    folder = tmp_path / "control"
    folder.mkdir()
    ways = Ways(Proxy(1))
    if kind in ("ftp", "ftps"):
        server = ftp_server(tmp_path, folder, kind == "ftps", dtp_handler=breaking(kind, ways))
    else:
        server = KINDS[kind](tmp_path, folder)
    try:
        port = urlsplit(server._url).port
        with behind(port) as proxy:
            ways.proxy = proxy
            url = server.url(program=place(server, "O8700.NC"))
            yield url.replace(f":{port}/", f":{proxy.port}/", 1), ways, Disk(folder)
    finally:
        server.stop()


def sessions(kind, seeds, tmp_path, monkeypatch):
    """→ what was injected; prints the row of the scoreboard."""
    patched(monkeypatch)
    injected, resumed, wrong = Counter(), 0, []
    with served(kind, tmp_path) as (url, ways, disk):
        for seed in seeds:
            folder = tmp_path / f"seed{seed}"
            verdict = net_session(seed, url, ways, disk, folder, monkeypatch)
            injected += verdict.injected
            resumed += verdict.resumed
            if (verdict.lost, verdict.invented, verdict.unsafe, verdict.hung) != (0, 0, 0, False):
                wrong.append((seed, verdict))
            shutil.rmtree(folder, ignore_errors=True)
    print(
        f"\n{kind}, seeds {seeds.start} to {seeds.stop - 1}: {len(seeds)} sessions, {injected.total()} injected {dict(injected)}, "
        f"{resumed} resumed, wrong {wrong}, 3/n = {3 / len(seeds):.2g}"
    )
    assert wrong == []
    return injected


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["ftp", "lsv2"])
def test_a_few_sessions_over_a_real_server(kind, tmp_path, monkeypatch):
    sessions(kind, range(2), tmp_path, monkeypatch)


@pytest.mark.long
@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize("kind", [marked(kind) for kind in LINKS])
def test_two_hundred_sessions_over_a_real_server(kind, part, tmp_path, monkeypatch):
    many = 200 // PARTS
    injected = sessions(kind, range(1000 + many * part, 1000 + many * (part + 1)), tmp_path, monkeypatch)
    assert injected.total() > many // 5


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(20))
@pytest.mark.parametrize("kind", [marked(kind) for kind in LINKS])
def test_thousands_of_sessions_over_a_real_server(kind, part, tmp_path, monkeypatch):
    many = -(-CAMPAIGN // 20)
    sessions(kind, range(100_000 + many * part, 100_000 + many * (part + 1)), tmp_path, monkeypatch)


def test_the_judge_notices_a_reading_that_no_machine_made(tmp_path, monkeypatch):
    """A control that prints another place than it touched: every sum is right, the ledger is not."""
    patched(monkeypatch)
    real = linkfaults.ran

    def lied(text, faults):
        events, printed = real(text, faults)

        def moved(match):
            return b"%s%.4f" % (match[1], float(match[2].replace(b" ", b"")) + 0.01)

        return events, [(at, re.sub(rb"([XK]) *(-? *[0-9.]+)", moved, data)) for at, data in printed]

    monkeypatch.setattr(linkfaults, "ran", lied)
    with served("ftp", tmp_path) as (url, ways, disk):
        monkeypatch.setattr("support.netfaults.Way.happens", lambda self, kind: False)
        assert net_session(1, url, ways, disk, tmp_path / "run", monkeypatch).invented > 0
