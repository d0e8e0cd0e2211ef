"""What was measured survives everything but the loss of the disk."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from tango_cnc.link.journal import Journal, read_journal
from tango_cnc.records import InputError, LinkError

WRITER = """
import sys, pathlib
from tango_cnc.link.journal import Journal
file = pathlib.Path(sys.argv[1])
journal = Journal(file, resume=file.exists())
touch = sum(entry["kind"] == "reading" for entry in journal.entries)
while True:
    journal.add("reading", touch=touch, position=[0.1] * 6)
    sys.stdout.write(f"{touch}\\n"); sys.stdout.flush()
    touch += 1
"""


def test_entries_come_back(tmp_path):
    journal = Journal(tmp_path / "run.journal")
    journal.add("reading", touch=1, position=[0.1, 1e-17, -3.0])
    journal.close()
    entries, _ = read_journal(tmp_path / "run.journal")
    assert [entry["kind"] for entry in entries] == ["journal", "reading"]
    assert entries[1]["position"] == [0.1, 1e-17, -3.0]


def test_a_journal_goes_on_where_it_stopped(tmp_path):
    file = tmp_path / "run.journal"
    for resume in (False, True, True):
        journal = Journal(file, resume)
        journal.add("segment")
        journal.close()
    assert [entry["n"] for entry in read_journal(file)[0]] == [0, 1, 2, 3]


def test_every_cut_of_the_last_line_is_recovered(tmp_path):
    file = tmp_path / "run.journal"
    journal = Journal(file)
    journal.add("reading", touch=1)
    journal.add("reading", touch=2)
    journal.close()
    whole = file.read_bytes()
    start = whole[:-1].rindex(b"\n") + 1
    for cut in range(start, len(whole)):
        file.write_bytes(whole[:cut])
        resumed = Journal(file, resume=True)
        assert [entry.get("touch") for entry in resumed.entries] == [None, 1]
        resumed.add("reading", touch=2)
        resumed.close()
        assert file.read_bytes() == whole


def test_damage_before_the_end_is_refused_and_named(tmp_path):
    file = tmp_path / "run.journal"
    journal = Journal(file)
    for touch in range(3):
        journal.add("reading", touch=touch)
    journal.close()
    lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(b"".join([lines[0], lines[1].replace(b'"touch":0', b'"touch":7'), *lines[2:]]))
    with pytest.raises(InputError, match=r"run\.journal:2: a damaged line"):
        read_journal(file)
    file.write_bytes(b"".join([lines[0], *lines[2:]]))
    with pytest.raises(InputError, match=r"run\.journal:2: a damaged line"):
        read_journal(file)


def test_another_version_is_refused(tmp_path):
    file = tmp_path / "run.journal"
    data = json.dumps({"n": 0, "kind": "journal", "format": "tango-journal/9"}).encode()
    import zlib

    file.write_bytes(b"%08x %s\n" % (zlib.crc32(data), data))
    with pytest.raises(InputError, match="tango-journal/9"):
        read_journal(file)


def test_only_one_run_writes_a_journal(tmp_path):
    journal = Journal(tmp_path / "run.journal")
    with pytest.raises(LinkError, match="another 'tango run'"):
        Journal(tmp_path / "run.journal", resume=True)
    journal.close()


def test_a_new_journal_never_replaces_an_old_one(tmp_path):
    Journal(tmp_path / "run.journal").close()
    with pytest.raises(LinkError, match="nothing was started"):
        Journal(tmp_path / "run.journal")


def test_a_full_disk_stops_the_run(tmp_path, monkeypatch):
    journal = Journal(tmp_path / "run.journal")
    monkeypatch.setattr(os, "write", lambda handle, data: len(data) // 2)
    with pytest.raises(LinkError, match="cannot be stored"):
        journal.add("reading", touch=1)


@pytest.mark.skipif(sys.platform == "win32", reason="kill -9 is a POSIX word")
def test_killed_in_the_middle_of_writing_nothing_said_is_lost_and_nothing_invented(tmp_path):
    """Killed two dozen times; every reading it reported is there once, and at most one that it had no time to report."""
    file = tmp_path / "run.journal"
    for round_ in range(24):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(file)], stdout=subprocess.PIPE, text=True)
        assert writer.stdout is not None
        first = int(writer.stdout.readline())
        time.sleep(0.001 * round_)
        writer.send_signal(signal.SIGKILL)
        rest = writer.stdout.read().split("\n")
        writer.wait()
        writer.stdout.close()
        touches = [entry["touch"] for entry in read_journal(file)[0] if entry["kind"] == "reading"]
        said = max([first, *(int(line) for line in rest[:-1] if line)])
        assert touches == list(range(len(touches)))
        assert said <= touches[-1] <= said + 1
