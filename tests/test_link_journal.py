"""What was measured survives everything but the loss of the disk."""

import json
import os
import re
import signal
import sys
import time
import zlib
from pathlib import Path

import pytest

from tango_cnc.link.entries import Identity, Opened, Reading
from tango_cnc.link.journal import Journal, ReadSoFar, look_at, read_journal, read_on, salvaged
from tango_cnc.records import InputError, LinkError


def reading(touch, **changed):
    values = {"facet": "5", "position": (0.1, 1e-17, -3.0), "time_s": 1.0, "status": "ok", "deviation_um": 0.5}
    values |= {"drift_um": None, "direction": (1, -1, 0), "record": "P1 H1"}
    return Reading(touch, **{**values, **changed})


def written(file, *touches):
    journal = Journal(file)
    for touch in touches:
        journal.add(reading(touch))
    journal.close()
    return file.read_bytes().splitlines(keepends=True)


def touches(file):
    return [entry.touch for entry in read_journal(file)[0] if isinstance(entry, Reading)]


def write_until_killed(file, say):
    """Appends readings and says each one's number when it is stored; never returns."""
    journal = Journal(file, resume=file.exists())
    touch = 1 + sum(isinstance(entry, Reading) for entry in journal.entries)
    while True:
        journal.add(reading(touch))
        os.write(say, b"%d\n" % touch)
        touch += 1


def test_a_journal_larger_than_any_run_is_not_read(tmp_path, monkeypatch):
    file = tmp_path / "run.journal"
    written(file, 1)
    monkeypatch.setattr("tango_cnc.link.journal.MOST", file.stat().st_size)
    assert touches(file) == [1]
    monkeypatch.setattr("tango_cnc.link.journal.MOST", file.stat().st_size - 1)
    with pytest.raises(InputError, match="allowed: a journal of at most"):
        read_journal(file)


def test_entries_come_back(tmp_path):
    written(tmp_path / "run.journal", 1)
    entries, _ = read_journal(tmp_path / "run.journal")
    assert entries == [Opened("tango-journal/1"), reading(1)]


def test_what_has_been_read_of_a_journal_is_not_read_again(tmp_path):
    lines = written(tmp_path / "run.journal", *range(1, 6))
    growing, known = tmp_path / "growing.journal", None
    growing.touch()
    for cut in range(1, len(b"".join(lines)) + 1, 37):  # also in mid-line
        with growing.open("r+b") as file:
            file.write(b"".join(lines)[:cut])
        known = read_on(growing, known)
        assert (list(known.entries), known.size) == read_journal(growing)
    growing.write_bytes(b"".join(lines))
    known = read_on(growing, known)
    assert known.size == growing.stat().st_size and known.entries[-1] == reading(5)
    assert read_on(growing, known) is known


@pytest.mark.parametrize("renamed", [True, False], ids=["renamed over it", "written in place"])
def test_a_journal_of_another_run_is_read_from_its_beginning(tmp_path, renamed):
    written(tmp_path / "run.journal", 1, 2)
    known = read_on(tmp_path / "run.journal")
    written(tmp_path / "new.journal", 7, 8, 9)
    if renamed:
        (tmp_path / "new.journal").replace(tmp_path / "run.journal")
    else:
        (tmp_path / "run.journal").write_bytes((tmp_path / "new.journal").read_bytes())
    assert read_on(tmp_path / "run.journal", known) == read_on(tmp_path / "run.journal")
    assert [entry.touch for entry in read_on(tmp_path / "run.journal", known).entries[1:]] == [7, 8, 9]


@pytest.mark.parametrize("change", [lambda line: line[:30] + b"9" + line[31:], lambda line: line[:1]], ids=["changed", "cut"])
def test_a_line_that_is_new_and_damaged_is_refused_by_its_number(tmp_path, change):
    lines = written(tmp_path / "run.journal", 1, 2, 3, 4, 5)
    file = tmp_path / "growing.journal"
    file.write_bytes(b"".join(lines[:3]))
    known: ReadSoFar = read_on(file)
    file.write_bytes(b"".join([*lines[:3], change(lines[3]), *lines[4:]]))
    with pytest.raises(InputError, match=":4: a damaged line"):
        read_on(file, known)


def test_a_journal_goes_on_where_it_stopped(tmp_path):
    file = tmp_path / "run.journal"
    for resume in (False, True, True):
        journal = Journal(file, resume)
        journal.add(Identity("a control"))
        journal.close()
    assert [json.loads(line[9:])["n"] for line in file.read_bytes().splitlines()] == [0, 1, 2, 3]
    assert look_at(file).wrong is None


def test_every_cut_of_the_last_line_is_recovered(tmp_path):
    file = tmp_path / "run.journal"
    whole = b"".join(written(file, 1, 2))
    start = whole[:-1].rindex(b"\n") + 1
    for cut in range(start, len(whole)):
        file.write_bytes(whole[:cut])
        resumed = Journal(file, resume=True)
        assert resumed.entries[1:] == [reading(1)]
        resumed.add(reading(2))
        resumed.close()
        assert file.read_bytes() == whole


def crc(text):
    return b"%08x %s\n" % (zlib.crc32(text), text)


def test_damage_before_the_end_is_refused_and_named(tmp_path):
    file = tmp_path / "run.journal"
    lines = written(file, 1, 2, 3)
    file.write_bytes(b"".join([lines[0], lines[1].replace(b'"touch":1', b'"touch":7'), *lines[2:]]))
    with pytest.raises(InputError, match=r"run\.journal:2: a damaged line"):
        read_journal(file)
    file.write_bytes(b"".join([lines[0], *lines[2:]]))
    with pytest.raises(InputError, match=r"run\.journal:2: entry 2 where entry 1 was due"):
        read_journal(file)


def edits(lines):
    """lines of a journal → what somebody with an editor and a CRC makes of them, and at which line that shows."""
    shifted = lines[2][9:-1].replace(b'"n":2', b'"n":1')
    yield [*lines[:2], crc(lines[2][9:-1].replace(b"0.1,", b"0.2,")), *lines[3:]], 4
    yield [lines[0], crc(shifted), *(crc(line[9:-1].replace(b'"n":3', b'"n":2')) for line in lines[3:])], 2
    yield [lines[0], lines[1], crc(lines[1][9:-1].replace(b'"n":1', b'"n":2')), *lines[3:]], 3


def test_an_edit_shows_even_where_its_check_sum_was_made_anew(tmp_path):
    file = tmp_path / "run.journal"
    for edited, at in edits(written(file, 1, 2, 3)):
        file.write_bytes(b"".join(edited))
        with pytest.raises(InputError, match=rf"run\.journal:{at}: the hash of line {at - 1} is another one here"):
            read_journal(file)


WRONG = [
    ('"touch":1', '"touch":0', "touch: found 0"),
    ('"touch":1', '"touch":true', "touch: found True; allowed: a whole number"),
    ('"touch":1', '"touch":1e9', "touch: found 1000000000.0"),
    ('"time_s":1.0', '"time_s":NaN', "time_s: found nan; allowed: a finite number"),
    ('"time_s":1.0', '"time_s":"1"', "time_s: found '1'"),
    ('"time_s":1.0', '"time_s":-1', "time_s: found -1.0"),
    ('"position":[0.1,1e-17,-3.0]', '"position":[0.1,1e999,-3.0]', "position: found inf"),
    ('"position":[0.1,1e-17,-3.0]', '"position":[0.1]', "direction: found"),
    ('"position":[0.1,1e-17,-3.0]', '"position":0.1', "position: found 0.1"),
    ('"status":"ok"', '"status":"good"', "status: found 'good'"),
    ('"facet":"5",', "", "facet is missing"),
    ('"kind":"reading"', '"kind":"measured"', "kind: found 'measured'"),
    ('"drift_um":null', '"drift_um":' + "[" * 100_000, "no JSON"),
    ('"drift_um":null', '"drift_um":' + "9" * 5000, "no JSON"),
]


@pytest.mark.parametrize(("old", "new", "said"), WRONG, ids=[said[:24] for _, _, said in WRONG])
def test_an_entry_that_no_run_writes_is_refused_by_its_shape(tmp_path, old, new, said):
    file = tmp_path / "run.journal"
    lines = written(file, 1, 2)
    assert old.encode() in lines[1]
    file.write_bytes(b"".join([lines[0], crc(lines[1][9:-1].replace(old.encode(), new.encode())), lines[2]]))
    with pytest.raises(InputError, match=rf"run\.journal:2: .*{re.escape(said)}"):
        read_journal(file)


def test_what_a_newer_version_says_besides_is_left_out(tmp_path):
    file = tmp_path / "run.journal"
    lines = written(file, 1)
    file.write_bytes(lines[0] + crc(lines[1][9:-2] + b',"humidity":0.4}'))
    assert read_journal(file)[0][1] == reading(1)


def test_a_journal_without_hashes_is_one_of_before(tmp_path):
    file = tmp_path / "run.journal"
    file.write_bytes(b"".join(crc(re.sub(rb'"before":"[0-9a-f]*",', b"", line[9:-1])) for line in written(file, 1, 2)))
    assert touches(file) == [1, 2]


def test_a_device_is_no_journal():
    with pytest.raises(InputError, match="a device"):
        read_journal(Path("/dev/zero"))


def test_another_version_is_refused(tmp_path):
    file = tmp_path / "run.journal"
    data = json.dumps({"n": 0, "kind": "journal", "format": "tango-journal/9"}).encode()
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


def broken_at(monkeypatch, name, call):
    """os.NAME fails from the call-th time on: a disk that is full, or gives an error."""
    real, calls = getattr(os, name), []

    def spoilt(handle, *more):
        calls.append(1)
        if len(calls) < call:
            return real(handle, *more)
        if name == "write":
            return real(handle, more[0][: len(more[0]) // 2])
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, name, spoilt)


@pytest.mark.parametrize("name", ["write", "fsync"])
def test_a_full_disk_stops_the_run_and_leaves_a_journal_that_can_be_resumed(tmp_path, monkeypatch, name):
    """Nothing is written after the half line, not even why the run ended: it would be damage in the middle."""
    file = tmp_path / "run.journal"
    journal = Journal(file)
    journal.add(reading(1))
    with monkeypatch.context() as disk:
        broken_at(disk, name, 1)
        with pytest.raises(LinkError, match="cannot be stored"):
            journal.add(reading(2))
    with pytest.raises(LinkError, match="cannot be stored"):
        journal.add(reading(3))
    journal.close()
    resumed = Journal(file, resume=True)
    resumed.add(reading(2))
    resumed.close()
    assert touches(file) == [1, 2]


@pytest.mark.long
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
        found = touches(file)
        assert found == list(range(1, len(found) + 1))
        assert last <= found[-1] <= last + 1


def test_a_journal_that_was_saved_with_other_line_ends_loses_no_reading(tmp_path):
    """An editor of Windows, or FTP in text mode: only the ends are others."""
    file = tmp_path / "run.journal"
    lines = written(file, 1, 2, 3)
    file.write_bytes(b"".join(lines).replace(b"\n", b"\r\n"))
    found = look_at(file)
    entries, left_out = salvaged(found)
    assert (found.returns, found.wrong, left_out) == (True, None, [])
    assert [entry.touch for entry in entries if isinstance(entry, Reading)] == [1, 2, 3]
    with pytest.raises(InputError, match=r"run\.journal: its lines end in CR LF.*dos2unix.*then --resume goes on"):
        read_journal(file)
    file.write_bytes(b"".join(lines))
    assert (touches(file), look_at(file).returns) == ([1, 2, 3], False)


def test_a_changed_line_shows_under_other_line_ends_too(tmp_path):
    file = tmp_path / "run.journal"
    lines = written(file, 1, 2, 3)
    lines[2] = lines[2].replace(b'"touch":2', b'"touch":7')
    file.write_bytes(b"".join(lines).replace(b"\n", b"\r\n"))
    found = look_at(file)
    assert found.returns and found.wrong is not None and found.wrong.number == 3
    with pytest.raises(InputError, match="a damaged line"):
        read_journal(file)


def with_crc(data):
    text = json.dumps(data, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


@pytest.mark.parametrize("touch", [2, 4])
@pytest.mark.parametrize("before", [True, False])
@pytest.mark.parametrize("x", [1e300, 0.001])
def test_of_two_readings_of_a_touch_the_one_in_the_chain_is_saved(tmp_path, x, before, touch):
    """Somebody has put in a line with a right check sum: it stood first, and was saved in place of the true one."""
    file = tmp_path / "run.journal"
    lines = written(file, 1, 2, 3, 4)
    at = next(i for i, line in enumerate(lines) if b'"touch":%d,' % touch in line)
    true = json.loads(lines[at][9:])
    foreign = with_crc(true | {"n": 40, "before": "0" * 32, "position": [x, *true["position"][1:]]})
    lines.insert(at if before else at + 1, foreign)
    file.write_bytes(b"".join(lines))
    entries, left_out = salvaged(look_at(file))
    saved = {entry.touch: list(entry.position) for entry in entries if isinstance(entry, Reading)}
    assert saved[touch] == true["position"] and sorted(saved) == [1, 2, 3, 4]
    assert lines.index(foreign) + 1 in left_out


def test_a_reading_where_no_machine_can_be_is_never_saved(tmp_path):
    file = tmp_path / "run.journal"
    lines = written(file, 1, 2, 3)
    last = json.loads(lines[-1][9:])
    file.write_bytes(b"".join([*lines[:-1], with_crc(last | {"position": [1e300, *last["position"][1:]]})]))
    entries, _ = salvaged(look_at(file))
    assert [entry.touch for entry in entries if isinstance(entry, Reading)] == [1, 2]
