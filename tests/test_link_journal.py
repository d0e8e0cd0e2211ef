"""What was measured survives everything but the loss of the disk."""

import json
import os
import signal
import sys
import time

import pytest

from tango_cnc.link.journal import Journal, read_journal
from tango_cnc.records import InputError, LinkError


def write_until_killed(file, say):
    """Appends readings and says each one's number when it is stored; never returns."""
    journal = Journal(file, resume=file.exists())
    touch = sum(entry["kind"] == "reading" for entry in journal.entries)
    while True:
        journal.add("reading", touch=touch, position=[0.1] * 6)
        os.write(say, b"%d\n" % touch)
        touch += 1


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
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_killed_in_the_middle_of_writing_nothing_said_is_lost_and_nothing_invented(tmp_path):
    """Killed four dozen times; every reading it reported is there once, and at most one that it had no time to report."""
    file = tmp_path / "run.journal"
    for round_ in range(48):
        hear, say = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                write_until_killed(file, say)
            finally:
                os._exit(1)
        os.close(say)
        with os.fdopen(hear, "rb") as said:
            first = int(said.readline())
            time.sleep(0.0005 * round_)
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            last = max([first, *(int(line) for line in said.read().splitlines(keepends=True) if line.endswith(b"\n"))])
        touches = [entry["touch"] for entry in read_journal(file)[0] if entry["kind"] == "reading"]
        assert touches == list(range(len(touches)))
        assert last <= touches[-1] <= last + 1
