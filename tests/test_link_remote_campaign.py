"""The disk of a control over a bad network, 60 touches a session: nothing is lost, nothing invented, everything ends.

python -m pytest -m long tests/test_link_remote_campaign.py                          15 sessions
TANGO_SESSIONS=3000 python -m pytest -m campaign tests/test_link_remote_campaign.py    as many as you like
"""

from __future__ import annotations

import os
import random
import socket
from collections import Counter
from threading import Thread

import pytest
from support.diskfaults import Disk, Net, disk_session
from support.linkfaults import Ledger, judged, patched
from support.linkparts import FakeClock

from tango_cnc.link.protocols import remote
from tango_cnc.link.transport import _remote, open_port, parse
from tango_cnc.records import LinkError

CAMPAIGN = int(os.environ.get("TANGO_SESSIONS", "5000"))
ENDED = 100 * 3600.0  # s of the clock of a session: a run that hangs passes it


def sessions(seeds, tmp_path, monkeypatch):
    """→ what was injected in all of them; prints the row of the scoreboard."""
    resumed, injected, totals = 0, Counter(), [0, 0, 0]
    for seed in seeds:
        clock = FakeClock()
        patched(monkeypatch, clock)
        folder = tmp_path / str(seed)
        ledger, again, happened = disk_session(seed, folder, monkeypatch, clock)
        resumed += again
        injected.update(happened)
        verdict = judged(folder, ledger)
        assert verdict == (0, 0, 0), f"seed {seed}: {verdict} lost, invented, unsafe; {ledger.unsafe}"
        assert clock.seconds < ENDED, f"seed {seed}: hung"
        totals = [a + b for a, b in zip(totals, verdict, strict=True)]
    print(
        f"\nremote, seeds {seeds.start} to {seeds.stop - 1}: {len(seeds)} sessions, {injected.total()} injected {dict(injected)}, "
        f"{resumed} times resumed, lost invented unsafe: {totals}, hung 0, 3/n = {3 / len(seeds):.2g}"
    )
    return injected


@pytest.mark.few(0)
def test_a_few_sessions_over_a_bad_network(tmp_path, monkeypatch):
    assert sessions(range(1), tmp_path, monkeypatch).total() > 0


@pytest.mark.long
def test_fifteen_sessions_over_a_bad_network(tmp_path, monkeypatch):
    assert len(sessions(range(100, 115), tmp_path, monkeypatch)) > 7


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(20))
def test_thousands_of_sessions_over_a_bad_network(part, tmp_path, monkeypatch):
    many = -(-CAMPAIGN // 20)
    sessions(range(10_000 + many * part, 10_000 + many * (part + 1)), tmp_path, monkeypatch)


@pytest.mark.parametrize("kind", ["closed", "reset", "outage"])
def test_a_control_that_hangs_up_while_it_is_asked_for_its_file_is_a_sentence(monkeypatch, kind):
    disk = Disk(Ledger(), FakeClock(), random.Random(1), {kind: 1.0})
    monkeypatch.setattr(_remote, "store", lambda scheme, parts, options: Net(disk))
    with pytest.raises(LinkError, match=r"does not open: .+\. Is the controller"):
        open_port(parse("ftp://anna@localhost/records/TANGO.TXT", remote.OPTIONS))


def test_a_control_that_hangs_up_before_its_first_word_is_a_sentence_alone(caplog):
    """A library that writes a traceback of its own, where the program has no log, drowns it."""
    pytest.importorskip("paramiko")
    with socket.create_server(("127.0.0.1", 0)) as server:
        Thread(target=lambda: server.accept()[0].close(), daemon=True).start()
        port = f"sftp://anna@127.0.0.1:{server.getsockname()[1]}/r/R.TXT?hostkey=SHA256:abc"
        with pytest.raises(LinkError, match="does not open"):
            open_port(parse(port, remote.OPTIONS))
    assert not [record for record in caplog.records if record.name.startswith("paramiko")]
