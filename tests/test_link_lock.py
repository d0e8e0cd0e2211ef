"""One writer a cell: the second one is refused before it touches anything, and what a killed one leaves locks nothing."""

import contextlib
import ctypes
import errno
import json
import os
import socket
import subprocess
import sys
import threading
from ctypes import wintypes
from types import SimpleNamespace

import pytest
from support.runs import STRATEGY, Control, Result

from tango_cnc.commands.init import write_example
from tango_cnc.link import lock
from tango_cnc.link.lock import NAME, at_work, holding
from tango_cnc.link.process import alive, born
from tango_cnc.records import LinkError

HOLD = """
import sys, time
from pathlib import Path
from tango_cnc.link.lock import holding
with holding(Path(sys.argv[1]), "tango run"):
    print("held", flush=True)
    sys.stdin.read()
"""


@contextlib.contextmanager
def held(folder):
    """→ a process of its own that holds the folder."""
    with subprocess.Popen([sys.executable, "-c", HOLD, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        try:
            yield process
        finally:
            process.kill()


def test_the_second_one_is_refused_and_reads_who_the_first_one_is(tmp_path):
    with held(tmp_path) as process:
        with pytest.raises(LinkError) as error, holding(tmp_path, "tango plan"):
            pass
        assert f"'tango run' (process {process.pid} on {socket.gethostname()}, since " in str(error.value)
        assert "Nothing was changed" in str(error.value)


def test_a_killed_holder_holds_nothing(tmp_path):
    with held(tmp_path) as process:
        process.kill()
        process.wait()
        assert (tmp_path / NAME).exists()
        with holding(tmp_path, "tango run"):
            pass


def test_nothing_is_left_and_it_can_be_held_again(tmp_path):
    for _ in range(2):
        with holding(tmp_path, "tango run"), holding(tmp_path, "tango nightly"):
            assert (tmp_path / NAME).exists()
        assert list(tmp_path.iterdir()) == []


def test_another_thread_of_the_same_program_is_another_one(tmp_path):
    said = []

    def second():
        try:
            with holding(tmp_path, "tango run"):
                said.append("held")
        except LinkError as error:
            said.append(str(error))

    with holding(tmp_path, "tango serve"):
        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
    assert "'tango serve'" in said[0]


def test_a_lock_of_another_computer_is_left_to_who_knows(tmp_path):
    """A share may show its files and not its locks."""
    holder = {"what": "tango run", "pid": 7, "host": "cell-3", "since": "2026-01-01", "process": "x", "thread": 1}
    (tmp_path / NAME).write_text(json.dumps(holder))
    with pytest.raises(LinkError, match=r"cell-3.*Only if it runs no more, delete"), holding(tmp_path, "tango run"):
        pass


@pytest.mark.parametrize("free", [False, True])
def test_where_the_file_system_has_no_locks_the_process_decides(tmp_path, monkeypatch, free):
    pid = 2**22 + 1 if free else os.getpid()  # above the highest number a process can have

    def none(handle):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock, "lock", none)
    holder = {"what": "tango run", "pid": pid, "host": socket.gethostname(), "since": "2026", "process": "x", "thread": 1}
    (tmp_path / NAME).write_text(json.dumps(holder))
    with contextlib.nullcontext() if free else pytest.raises(LinkError), holding(tmp_path, "tango run"):
        pass


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(LinkError, match="cannot be locked"), holding(tmp_path / "none", "tango run"):
        pass


def test_a_second_run_leaves_the_first_ones_journal_alone(tmp_path):
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    (cell / "strategy.yaml").write_text(STRATEGY)
    (cell / "readings.journal").write_text("of the run that is going on")
    before = sorted(cell.rglob("*"))
    with held(cell):
        result = Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "5", "--yes")
    assert (result.code, "'tango run' (process" in result.err) == (3, True), result.err
    assert "broken off" not in result.err
    assert (cell / "readings.journal").read_text() == "of the run that is going on"
    assert sorted(set(cell.rglob("*")) - {cell / NAME}) == before


@pytest.mark.few(0)
def test_one_folder_of_readings_is_written_by_one_run(tmp_path):
    """Two cells whose readings go to one folder: the folder is held as well."""
    cell, out = tmp_path / "cell", tmp_path / "out"
    write_example(cell, "hu40t")
    (cell / "strategy.yaml").write_text(STRATEGY)
    out.mkdir()
    with held(out):
        result = Result("run", "-C", cell, "--port", Control(cell).url, "--yes", "--readings", out / "readings.csv")
    assert (result.code, "'tango run' (process" in result.err) == (3, True), result.err


@pytest.mark.parametrize("words", [("plan", "-C"), ("simulate", "-C")])
def test_nothing_is_planned_or_simulated_into_a_folder_where_a_run_is_at_work(tmp_path, words):
    write_example(tmp_path / "cell", "hu40t")
    (tmp_path / "cell" / "strategy.yaml").write_text(STRATEGY)
    before = {file: file.read_bytes() for file in (tmp_path / "cell").rglob("*") if file.is_file()}
    done, begun = threading.Event(), threading.Event()

    def run():
        with holding(tmp_path / "cell", "tango run"):
            begun.set()
            done.wait(60)

    other = threading.Thread(target=run)
    other.start()
    begun.wait(60)
    try:
        result = Result(*words, tmp_path / "cell")
    finally:
        done.set()
        other.join()
    assert result.code == 3
    assert "'tango run'" in result.err and "at work in this folder" in result.err
    assert {file: file.read_bytes() for file in (tmp_path / "cell").rglob("*") if file.is_file()} == before


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="the state of a process is asked of /proc")
def test_a_killed_process_that_nobody_has_asked_for_yet_is_at_work_no_more() -> None:
    """Right after a kill its number is still taken (state Z)."""
    killed = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    assert alive(killed.pid)
    killed.kill()
    os.waitid(os.P_PID, killed.pid, os.WEXITED | os.WNOWAIT)  # has ended, and is not asked for
    os.kill(killed.pid, 0)
    assert not alive(killed.pid)
    killed.wait()


@pytest.mark.parametrize("locks", [True, False])
def test_a_number_that_another_process_has_by_now_holds_nothing(tmp_path, monkeypatch, locks):
    """The system gives the number of a killed night to another process, at the latest after the next start of the computer."""
    other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    (tmp_path / "nights" / "begun").mkdir(parents=True)
    (tmp_path / "nights" / "begun" / "2026-03-10T020003Z").write_text("{}")
    holder = {"what": "tango nightly", "pid": other.pid, "host": socket.gethostname(), "since": "2026", "process": "x", "thread": 1}

    def none(handle):
        raise OSError(errno.ENOLCK, "No locks available")

    if not locks:
        monkeypatch.setattr(lock, "lock", none)
    try:
        (tmp_path / NAME).write_text(json.dumps(holder | {"born": born(other.pid)}))
        assert "tango nightly" in at_work(tmp_path) and not lock.cut_off(tmp_path)
        (tmp_path / NAME).write_text(json.dumps(holder))  # of an older version
        assert "tango nightly" in at_work(tmp_path)
        (tmp_path / NAME).write_text(json.dumps(holder | {"born": "another start of the computer 17"}))
        assert at_work(tmp_path) == ""
        assert lock.cut_off(tmp_path) == ["2026-03-10T020003Z"]
        with holding(tmp_path, "tango run"):
            assert json.loads((tmp_path / NAME).read_text())["born"] == born(os.getpid()) != ""
    finally:
        other.kill()
        other.wait()


def test_two_processes_have_begun_at_two_times():
    first, second = (subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) for _ in range(2))
    try:
        assert alive(first.pid, born(first.pid)) and born(first.pid) == born(first.pid)
        first.kill()
        first.wait()
        assert not alive(first.pid) and born(first.pid) == ""
        assert alive(second.pid, born(second.pid)) and not alive(second.pid, "then")
    finally:
        second.kill()
        second.wait()


NO_SUCH, NOT_YOURS, STILL_ACTIVE = 87, 5, 259  # of Windows


@pytest.mark.parametrize(
    ("opens", "status", "times", "runs", "began"),
    [
        (True, STILL_ACTIVE, True, True, str((7 << 32) + 9)),
        (True, STILL_ACTIVE, False, True, ""),  # when it began is not said
        (True, None, True, True, str((7 << 32) + 9)),  # nor whether it has ended: it is at work
        (True, 0, True, False, ""),
        (NO_SUCH, STILL_ACTIVE, True, False, ""),
        (NOT_YOURS, STILL_ACTIVE, True, True, ""),  # of another user
    ],
)
def test_what_windows_says_of_a_process(monkeypatch, opens, status, times, runs, began):
    """Windows is asked by its own functions, which a stand-in has here: what it does not say leaves the process at work."""
    left, kernel = [], SimpleNamespace()

    def ended(handle, into):
        into._obj.value = 0 if status is None else status
        return status is not None

    def timed(handle, created, *others):
        created._obj.dwHighDateTime, created._obj.dwLowDateTime = 7, 9
        return times

    def opened(access, inherited, pid):
        assert (access.value, pid.value) == (0x1000, 4711)
        left.append(1)
        return 1 if opens is True else None

    kernel.OpenProcess, kernel.GetExitCodeProcess, kernel.GetProcessTimes = opened, ended, timed
    kernel.CloseHandle = lambda handle: left.pop()
    monkeypatch.setattr(ctypes, "WinDLL", lambda *args, **more: kernel, raising=False)
    monkeypatch.setattr(ctypes, "get_last_error", lambda: opens, raising=False)
    monkeypatch.setattr("tango_cnc.link.process.os", SimpleNamespace(name="nt"))
    assert wintypes.HANDLE  # is there on every system
    assert born(4711) == began and alive(4711) is runs
    assert alive(4711, began) is runs and alive(4711, "another") is (runs and not began)
    assert len(left) == (0 if opens is True else 4)  # what was opened has been closed


@pytest.mark.parametrize("left", [None, "morning.html", "planned.json", "readings.csv", "readings.journal", "warm-up.journal"])
def test_a_night_that_has_written_down_what_it_touches_may_have_sent_it(tmp_path, left):
    stamps = ["2026-03-10T020003Z", "2026-03-11T020003Z"]
    if left is not None:
        (tmp_path / "nights" / stamps[0]).mkdir(parents=True)
        (tmp_path / "nights" / stamps[0] / left).write_text("{}")
    assert lock.ended(tmp_path, stamps) == dict.fromkeys(stamps if left in (None, "morning.html") else stamps[1:], "unsent")


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")
@pytest.mark.parametrize("what", ["link", "pipe", "/dev/zero"])
def test_a_lock_that_is_no_plain_file_is_refused_and_what_it_names_is_left_alone(tmp_path, what):
    """A link was followed, and what it named was overwritten; a page that asked who is at work waited for a pipe."""
    (tmp_path / "precious").write_text("mine")
    cell, kind = tmp_path / "cell", "a link to another file" if what != "pipe" else "a device or a pipe"
    cell.mkdir()
    if what == "pipe":
        os.mkfifo(cell / NAME)
    else:
        (cell / NAME).symlink_to(tmp_path / "precious" if what == "link" else what)
    assert lock.at_work(cell) == ""
    with pytest.raises(LinkError, match=rf"{NAME}: found {kind}.* Nothing was started"), holding(cell, "tango run"):
        pass
    assert (tmp_path / "precious").read_text() == "mine"
    assert (cell / NAME).is_symlink() or (cell / NAME).is_fifo()


@pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
def test_who_asks_for_a_run_that_broke_off_waits_for_no_pipe_and_minds_no_nesting(tmp_path):
    """A page asks so for every machine: a pipe among the journals held it up, a line of brackets was a traceback."""
    (tmp_path / "readings.journal").write_text('0 {"kind":"begun"}\n0 ' + "[" * 5000 + "\n")
    os.mkfifo(tmp_path / "other.journal")
    assert lock.broken_off(tmp_path) is not None
