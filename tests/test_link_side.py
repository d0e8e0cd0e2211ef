"""What is beside a run and must not end it, nor be harmed by it: outputs, files named in a URL, passwords, disks, old programs."""

import contextlib
import datetime
import errno
import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from support.linkparts import FakeClock, job
from support.runs import Control, Result, cell, readings  # noqa: F401
from support.sessions import GOOD, Run, after_the_program, printed

from tango_cnc.link import aside as beside
from tango_cnc.link import measure as measuring
from tango_cnc.link.client import Failed
from tango_cnc.link.journal import Journal
from tango_cnc.link.protocols import dnc
from tango_cnc.link.secrets import secret, shown
from tango_cnc.link.session import Transcript
from tango_cnc.link.transport import open_port, parse
from tango_cnc.link.words import record
from tango_cnc.records import InputError, LinkError

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals and pipes of POSIX")
LINUXCNC = {"file": (), "log": (), "password": (), "enable": ()}


def started(cell, control, *more, **streams):
    command = [sys.executable, "-m", "tango_cnc", "run", "-C", cell, "--port", f"{control.url}?listen=no", "--timeout", "20", *more]
    return subprocess.Popen([str(word) for word in command], stdin=subprocess.DEVNULL, **streams)


# Files that a URL names


@pytest.mark.parametrize("name", ["artefact.yaml", "readings.csv", "notes.txt"])
@pytest.mark.parametrize("option", ["file", "log"])
def test_linuxcnc_leaves_files_alone_that_no_run_has_written(cell, option, name):
    (cell / "readings.csv").write_text("touch,facet\n1,3\n")
    (cell / "notes.txt").write_text("call the vendor\n")
    before = (cell / name).read_bytes()
    names = {"file": "new.ngc", "log": "new.txt", option: name}
    url = "linuxcnc://127.0.0.1:1?" + "&".join(f"{key}={cell / value}" for key, value in names.items())
    with pytest.raises(InputError, match=rf"{option}: found .*{name}, which is there and is not"):
        open_port(parse(url, LINUXCNC))
    assert (cell / name).read_bytes() == before


@POSIX
@pytest.mark.parametrize(
    "text", ["(TANGO X)\n(PROGRAM 4BC33F4A4AB1 PLAN 98C4F7B8ADCC)\nM2\n", "TANGO START 4BC33F4A4AB1 3\nP1 H1 X1\n"]
)
def test_linuxcnc_replaces_what_a_run_has_left(tmp_path, text):
    (tmp_path / "old").write_text(text)
    option, other = ("file", "log") if text.startswith("(") else ("log", "file")
    with pytest.raises(LinkError, match="does not open"):  # nobody listens there; the files were no reason
        open_port(parse(f"linuxcnc://127.0.0.1:1?{option}={tmp_path / 'old'}&{other}={tmp_path / 'new'}", LINUXCNC))


def test_file_and_log_are_two_files(tmp_path):
    with pytest.raises(InputError, match="are one file"):
        open_port(parse(f"linuxcnc://127.0.0.1:1?file={tmp_path / 'a'}&log={tmp_path / 'x' / '..' / 'a'}", LINUXCNC))


OWN = ["sensors.yaml", "readings.json", "READINGS.CSV", "readings.journal", "tango.lock", "history.db", "post.py", "report.html"]


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("option", ["file", "log"])
def test_no_name_of_a_file_of_a_cell_is_taken_although_nothing_is_there(tmp_path, option, name):
    """The program was written to sensors.yaml, which no command could read then; LinuxCNC truncated the journal."""
    other = "log" if option == "file" else "file"
    with pytest.raises(InputError, match=f"{option}: found .*{name}, a name of tango's own files"):
        open_port(parse(f"linuxcnc://127.0.0.1:1?{option}={tmp_path / name}&{other}={tmp_path / 'new'}", LINUXCNC))
    assert not list(tmp_path.iterdir())


@POSIX
@pytest.mark.parametrize("name", ["/dev/zero", "pipe"])
def test_a_device_is_no_file_that_a_control_writes(tmp_path, name):
    if name == "pipe":
        os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="a device or a pipe"):
        open_port(parse(f"file://{tmp_path / name}", {"from": ("now", "last")}))


@pytest.mark.few(3)
@POSIX
@pytest.mark.parametrize("what", ["folder", "pipe", "/dev/zero"])
@pytest.mark.parametrize("name", ["readings.csv", "readings.json", "readings.origin.json", "readings.partial.csv"])
def test_what_is_no_file_where_the_readings_go_is_refused_before_the_first_move(cell, name, what):
    """After the last touch the run waited for ever for a pipe, or filled the memory from a device."""
    place = cell / name
    make = {"folder": place.mkdir, "pipe": lambda: os.mkfifo(place)}.get(what, lambda: place.symlink_to(what))
    make()
    result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:9", "--timeout", "1")
    assert result.code == 2 and f"{name}: found a folder, a device or a pipe" in result.err, result.err
    assert not (cell / "program").exists() and not (cell / "readings.journal").exists()


# Outputs that end


@pytest.mark.few(0)
@POSIX
@pytest.mark.parametrize("closed", ["both", *(pytest.param(name, marks=pytest.mark.long) for name in ("stdout", "stderr"))])
def test_a_run_started_without_screen_comes_to_its_end(cell, closed):
    """The files it opens must not take the places of the streams."""
    control = Control(cell)
    words = {"stdout": ">&-", "stderr": "2>&-", "both": ">&- 2>&-"}[closed]
    command = f"exec {sys.executable} -m tango_cnc run -C {cell} --port {control.url} --timeout 20 {words}"
    assert subprocess.run(["sh", "-c", command], stdin=subprocess.DEVNULL, timeout=300, check=False).returncode == 0
    assert len(readings(cell).touch) == 7
    assert Result("journal", "verify", "-C", cell).code == 0


@pytest.mark.few(0)
@POSIX
def test_a_pipe_that_nobody_reads_any_more_ends_nothing(cell):
    process = started(cell, Control(cell, delay=0.05), "--json", "-", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.readline()
    process.stdout.close()
    process.stderr.close()
    assert process.wait(60) == 0
    assert len(readings(cell).touch) == 7


@pytest.mark.few(0)
@POSIX
def test_outputs_on_a_full_device_are_refused_before_the_run_and_streams_on_one_end_nothing(cell):
    """/dev/full takes no byte: by its name it is no file; as stdout and stderr it is noticed while the machine moves."""
    for name in ("--transcript", "--json"):
        result = Result("run", "-C", cell, "--port", "socket://127.0.0.1:9", name, "/dev/full")
        assert (result.code, "a device" in result.err) == (2, True), result.err
    assert not (cell / "program").exists()
    control = Control(cell)
    command = f"exec {sys.executable} -m tango_cnc run -C {cell} --port {control.url} --timeout 20 --json - >/dev/full 2>/dev/full"
    assert subprocess.run(["sh", "-c", command], stdin=subprocess.DEVNULL, timeout=300, check=False).returncode == 0
    assert len(readings(cell).touch) == 7


@contextlib.contextmanager
def full_pipe():
    """→ the end of a pipe that takes no byte more: its reader pauses (Ctrl-S, a stopped pager)."""
    hear, say = os.pipe()
    os.set_blocking(say, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(say, b"x" * 256)
    os.set_blocking(say, True)
    try:
        yield say
    finally:
        os.close(hear)
        os.close(say)


@pytest.mark.few(0)
@POSIX
def test_readers_that_pause_hold_no_run_up(cell):
    with full_pipe() as out, full_pipe() as err:
        process = started(cell, Control(cell), "--json", "-", stdout=out, stderr=err)
        try:
            assert process.wait(120) == 0
        finally:
            process.kill()
    assert len(readings(cell).touch) == 7


@pytest.mark.few(0)
@POSIX
def test_a_run_whose_readers_pause_is_ended_by_one_signal(cell):
    with full_pipe() as err:
        process = started(cell, Control(cell, stop=3), stdout=subprocess.DEVNULL, stderr=err)
        until = time.monotonic() + 60
        try:
            while not (cell / "readings.journal").exists() or (cell / "readings.journal").read_bytes().count(b'"reading"') < 3:
                assert process.poll() is None and time.monotonic() < until
                time.sleep(0.02)
            process.send_signal(signal.SIGTERM)
            assert process.wait(60) == 3
        finally:
            process.kill()
    assert len(readings(cell, "readings.partial.csv").touch) == 3


@POSIX
def test_what_waits_for_a_reader_arrives_in_order_and_what_is_too_much_is_dropped(monkeypatch):
    monkeypatch.setattr(beside, "LAST", 0.2)
    hear, say = os.pipe()
    aside, most, line = beside.Aside(say), beside.MOST, "0123456789abcde\n" * 64
    began = time.monotonic()
    for number in range(2 * most // len(line)):
        aside.write(f"{number} {line}")
        aside.flush()
    aside.drain()
    assert time.monotonic() - began < 60.0
    got, reader = [], threading.Thread(target=lambda: got.extend(iter(lambda: os.read(hear, 1 << 16), b"")))
    reader.start()
    aside.drain()
    aside.write("the last\n")
    aside.drain()
    os.close(say)
    reader.join()
    os.close(hear)
    *numbers, last = re.findall(r"^(\d+) 0123|^(the last)$", b"".join(got).decode(), re.MULTILINE)
    assert [int(number) for number, _ in numbers] == list(range(len(numbers))) and last == ("", "the last")
    assert most - 2 * len(line) < sum(map(len, got)) < 1.1 * most


@POSIX
@pytest.mark.long
def test_a_transcript_on_a_full_stdout_without_stderr_ends_nothing(cell):
    control = Control(cell)
    command = f"exec {sys.executable} -m tango_cnc run -C {cell} --port {control.url} --timeout 20 --transcript - >/dev/full 2>&-"
    assert subprocess.run(["sh", "-c", command], stdin=subprocess.DEVNULL, timeout=300, check=False).returncode == 0
    assert len(readings(cell).touch) == 7


class Full:
    """A file on a disk without room."""

    def write(self, text):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_transcript_that_cannot_go_on_is_said_once_and_the_run_goes_on(tmp_path):
    steps = []
    run = Run(tmp_path, after_the_program(printed(*GOOD)), transcript=Full(), watch=steps.append)
    assert run.error == ""
    assert [step.remark for step in steps if step.remark and "transcript" in step.remark] == [
        "the transcript ends here: No space left on device; the run goes on"
    ]


@pytest.mark.few(0)
@POSIX
def test_a_session_that_is_dropped_ends_the_run_as_ctrl_c_does(cell):
    process = started(cell, Control(cell, stop=3), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    while (cell / "readings.journal").exists() is False or (cell / "readings.journal").read_bytes().count(b'"reading"') < 3:
        time.sleep(0.02)
    process.send_signal(signal.SIGHUP)
    _, said = process.communicate(timeout=120)
    assert (process.returncode, b"stopped by the user" in said) == (3, True), said
    assert len(readings(cell, "readings.partial.csv").touch) == 3


# Disks


def failing(monkeypatch, module, name, when):
    """module.NAME raises ENOSPC for the calls that `when` says."""
    real = getattr(module, name)

    def spoilt(*arguments, **more):
        if when(*arguments):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(arguments[0]))
        return real(*arguments, **more)

    monkeypatch.setattr(module, name, spoilt)


def into(word):
    return lambda *arguments: any(word in str(argument) for argument in arguments)


WRITES = {
    "program": ("program", into("program")),
    "readings": ("every touch is in", lambda file, text: file.name == "readings.csv"),
    "origin": ("every touch is in", lambda file, text: file.name == "readings.json"),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("what", WRITES)
def test_a_disk_without_room_at_any_write_of_a_run_is_said_and_the_run_resumed(cell, monkeypatch, what):
    said, when = WRITES[what]
    with monkeypatch.context() as disk:
        if what == "program":
            failing(disk, os, "replace", when)
        else:
            failing(disk, measuring, "write_text", when)
        result = Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20")
    assert (result.code, said in result.err, "No space left on device" in result.err) == (3, True, True), result.err
    more = () if what == "program" else ("--resume",)
    again = Result("run", "-C", cell, "--port", f"{Control(cell).url}?listen=no", "--timeout", "20", *more)
    assert again.code == 0, again.err
    assert list(readings(cell).touch) == [1, 2, 3, 4, 5, 6, 7]


def test_a_partial_file_that_cannot_be_written_hides_no_reason(cell, monkeypatch):
    with monkeypatch.context() as disk:
        failing(disk, measuring, "write_text", into("partial"))
        result = Result("run", "-C", cell, "--port", Control(cell, stop=3).url, "--timeout", "0.4")
    assert result.code == 3
    assert "has been silent" in result.err and "readings.journal" in result.err and "No space left" in result.err
    assert Result("run", "-C", cell, "--port", f"{Control(cell).url}?listen=no", "--timeout", "20", "--resume").code == 0


def test_the_journal_of_before_that_cannot_be_renamed_stops_the_run_before_it_begins(cell, monkeypatch):
    (cell / "readings.journal").write_text("of before")
    with monkeypatch.context() as disk:
        failing(disk, Path, "rename", into("readings.journal"))
        result = Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20")
    assert (result.code, "nothing was started" in result.err) == (3, True), result.err
    assert (cell / "readings.journal").read_text() == "of before"


@pytest.mark.few(1)
@pytest.mark.parametrize("at", [2, 5, *(pytest.param(n, marks=pytest.mark.long) for n in (3, 4, 6, 7, 8, 9, 10, 11))])
def test_a_journal_that_takes_no_more_at_any_entry_leaves_a_run_to_be_resumed(cell, monkeypatch, at):
    calls = []

    def add(self, entry):
        calls.append(entry)
        if len(calls) == at:
            monkeypatch.setattr(os, "fsync", broken)
        return real(self, entry)

    def broken(handle):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    real, fsync = Journal.add, os.fsync
    monkeypatch.setattr(Journal, "add", add)
    result = Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20")
    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Journal, "add", real)
    assert (result.code, "Input/output error" in result.err) == (3, True), result.err
    assert Result("journal", "verify", "-C", cell).code == 0
    more = () if at == 2 else ("--resume",)  # nothing but the format is in it
    again = Result("run", "-C", cell, "--port", f"{Control(cell).url}?listen=no", "--timeout", "20", *more)
    assert again.code == 0, again.err
    assert sorted(readings(cell).touch) == [1, 2, 3, 4, 5, 6, 7]


@pytest.mark.few(0)
@POSIX
def test_files_get_the_rights_that_the_umask_leaves(cell):
    usual = os.umask(0o027)
    try:
        result = Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20")
    finally:
        os.umask(usual)
    assert result.code == 0, result.err
    for name in ("readings.csv", "readings.json", "readings.journal", "program/plan.csv"):
        assert (cell / name).stat().st_mode & 0o777 == 0o640, name


# Passwords


def test_a_password_is_shown_nowhere(cell):
    url = f"linuxcnc://127.0.0.1:1?file={cell}/a.ngc&log={cell}/b.txt&password=EMCWORD&enable=TOOWORD"
    result = Result("run", "-C", cell, "--port", url, "--timeout", "1", "--json", cell / "out.json")
    assert result.code == 2 and "a word stands in the address itself" in result.err
    bad = Result("run", "-C", cell, "--port", url + "&colour=red", "--timeout", "1")
    other = Result("run", "-C", cell, "--port", url.replace("linuxcnc", "linuxnc"), "--timeout", "1")
    everything = result.err + result.out + bad.err + other.err
    everything += "".join(file.read_text(errors="replace") for file in cell.rglob("*") if file.is_file())
    assert "EMCWORD" not in everything and "TOOWORD" not in everything


def test_a_password_is_not_in_a_transcript():
    out, clock = io.StringIO(), FakeClock()
    Transcript(out, clock, ("EMCWORD",)).add("->", b"hello EMCWORD tango 1.1\r\n")
    assert out.getvalue() == "-> hello *** tango 1.1\\r\\n\n"


def test_a_transcript_says_how_long_nothing_went_over_the_line_and_only_where_that_can_be_seen():
    """Less than a millisecond is no wait, however long the transcript has been open."""
    out, clock = io.StringIO(), FakeClock()
    transcript = Transcript(out, clock)
    for seconds, mark, data in ((0.0, "->", b"a"), (2.5, "<-", b"b"), (0.0004, "->", b"c"), (0.25, "<-", b"d")):
        clock.seconds += seconds
        transcript.add(mark, data)
    assert out.getvalue() == "-> a\n.. 2.500\n<- b\n-> c\n.. 0.250\n<- d\n"


@pytest.mark.parametrize(
    ("url", "wanted"),
    [
        ("ftp://anna:geheim@host/x", "ftp://anna:***@host/x"),
        ("linuxcnc://h:1?password=a&log=b", "linuxcnc://h:1?password=***&log=b"),
        ("ftp://h/x?passwort=a&from=now", "ftp://h/x?passwort=***&from=now"),  # spelt otherwise
        ("linuxcnc://h:1?Password=a", "linuxcnc://h:1?Password=***"),
        ("linuxcnc://h:1?password=env:PW", "linuxcnc://h:1?password=env:PW"),
        ("/dev/ttyUSB0", "/dev/ttyUSB0"),
    ],
)
def test_what_is_shown_of_a_url(url, wanted):
    assert shown(url) == wanted


def test_a_password_comes_from_the_environment_or_from_a_file_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.setenv("CELL_WORD", "geheim")
    assert secret("password", "env:CELL_WORD") == "geheim"
    assert secret("password", "") == ""
    with pytest.raises(InputError, match=r"stands in the address itself.*env:NAME"):
        secret("password", "geheim")
    with pytest.raises(InputError, match="no variable of this name"):
        secret("password", "env:NO_SUCH_WORD")
    file = tmp_path / "word"
    file.write_text("geheim\n")
    file.chmod(0o600)
    assert secret("password", f"file:{file}") == "geheim"
    if os.name == "posix":
        file.chmod(0o640)
        with pytest.raises(InputError, match="rights 640, so others can read it"):
            secret("password", f"file:{file}")


# A control that still executes the program of before


def resumed(**options):
    return dnc.Client(job(quiet=40.0), options)


def test_a_resumed_run_sends_nothing_to_a_control_that_still_prints():
    client = resumed()
    assert client.bytes_to_send(100) == b""
    assert client.elapsed(20.0) == []
    events = client.receive(b"\x12P3 H1 X-5.0000 Y5.0000\r\n\x14")
    assert [type(event) for event in events] == [Failed]
    assert "still executes the program of before" in events[0].why
    assert client.bytes_to_send(100) == b""
    assert client.sent[0] == 0


def test_it_sends_when_the_control_has_been_silent_long_enough():
    client = resumed()
    client.receive(b"\0\0\r\n?")  # leader, and one character that a disturbance made
    assert client.elapsed(39.0) == []
    assert client.bytes_to_send(100) == b""
    client.elapsed(1.5)
    assert client.bytes_to_send(100)[:1] == b"%"


def test_a_control_that_asks_for_a_program_executes_none():
    client = resumed(start="xon")
    client.elapsed(1.0)
    client.receive(b"\x11")
    assert client.bytes_to_send(100)[:1] == b"%"


def test_who_has_looked_need_not_wait():
    assert resumed(listen="no").bytes_to_send(100)[:1] == b"%"


@pytest.mark.few(0)
def test_a_run_over_a_line_is_not_resumed_into_the_old_program(cell):
    result = Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4")
    assert result.code == 3
    sent = []

    def executing():
        connection, _ = server.accept()
        with connection:
            connection.sendall(b"\x12P5 H1 X1.0000 Y2.0000\r\n\x14")
            sent.append(connection.recv(4096))

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=executing, daemon=True)
        thread.start()
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        result = Result("run", "-C", cell, "--port", url, "--timeout", "5", "--resume")
        thread.join(5)
    assert (result.code, "still executes the program of before" in result.err) == (3, True), result.err
    assert sent == [b""]


# Ports and records


@pytest.mark.parametrize(
    "url",
    [
        "socket://:8193",
        "socket://host name:1",
        "socket://ho_st!:1",
        "socket://-:99999",
        "socket://1.2.3.4.5:80",
        "socket://999.1.1.1:80",
        "socket://[::zz]:80",
        "socket://[fe80::1:80",
        "socket://a..b:80",
        "socket://" + "a" * 64 + ":80",
        "socket://host:١٢",
        "modbus+tcp://host:502/١",
        "socket://h:1?baud=²",
        "socket://h:1?x=%ff",
        "socket://" + "h" * 3000 + ":1",
        "grbl+socket://h:1\n",
    ],
)
def test_a_port_with_a_malformed_host_is_refused_in_a_sentence(url):
    with pytest.raises(InputError, match="port"):
        parse(url, {})


@pytest.mark.parametrize(
    "url", ["socket://host:1", "socket://192.168.1.20:8193", "socket://[fe80::1]:8193", "socket://cnc-3.shop.local:80"]
)
def test_a_port_with_a_host_is_taken(url):
    assert parse(url, {}).target == url.removeprefix("socket://")


def test_whole_numbers_whose_sum_is_off_are_no_record():
    """What came after the points is lost, and with it what the sum could have told."""
    said = record("P1 H1 X12 Y-3 Z50 B0 C90 K152", ("X", "Y", "Z", "B", "C", "K"))
    assert "add up to 149.0000" in said.why


def test_the_records_that_the_documentation_shows_are_records():
    lines = (Path(__file__).parents[1] / "docs" / "link.md").read_text().splitlines()
    shown_there = [re.sub(r" {5}[a-z].*", "", line.strip()) for line in lines if re.match(r" {4}(TANGO (START|END)|P\d+ H)", line)]
    assert len(shown_there) == 3
    for line in shown_there:
        assert type(record(line, ("X", "Y", "Z", "B", "C", "S", "K"))).__name__ in ("Begun", "Touched", "Ended"), line


# tango journal


@pytest.mark.few(0)
def test_journals_are_listed_verified_and_salvaged(cell):
    assert Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    assert Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20").code == 0
    listed = json.loads(Result("journal", "list", "-C", cell, "--json", "-").out)["journals"]
    assert [(row["ok"], row["end"] == "complete", row["state"]) for row in listed] == [(4, False, "whole"), (7, True, "whole")]
    assert (
        " programs " in Result("journal", "list", "-C", cell).out.splitlines()[0] and listed[0]["segments"] == 1
    )  # the file's word
    assert Result("journal", "verify", "-C", cell).out.endswith("every one as it was written\n")
    file = cell / "readings.journal"
    lines = file.read_bytes().splitlines(keepends=True)
    damaged = next(i for i, line in enumerate(lines) if b'"touch":4' in line)
    lines[damaged] = lines[damaged][:40] + b"?" + lines[damaged][41:]
    file.write_bytes(b"".join(lines))
    result = Result("journal", "verify", "-C", cell)
    assert (result.code, f"{file}:{damaged + 1}: a damaged line" in result.out) == (1, True), result.out
    resume = Result("run", "-C", cell, "--resume", "--port", "socket://127.0.0.1:1")
    assert (resume.code, "tango journal salvage" in resume.err) == (2, True), resume.err
    saved = Result("journal", "salvage", "-C", cell, "--out", cell / "saved.csv")
    assert (saved.code, f"without line {damaged + 1}" in saved.out) == (1, True), saved.out
    assert list(readings(cell, "saved.csv").touch) == [1, 2, 3, 5, 6, 7]
    again = Result("journal", "salvage", "-C", cell, "--out", cell / "saved.csv")
    assert (again.code, "never overwritten" in again.err) == (2, True)


@pytest.mark.few(0)
def test_salvage_names_what_verify_sees_and_writes_no_touch_twice(cell):
    assert Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20").code == 0
    file = cell / "readings.journal"
    lines = file.read_bytes().splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if b'"touch":4' in line)
    spoilt = {
        "doubled": ([*lines[: at + 1], *lines[at:]], [1, 2, 3, 4, 5, 6, 7], f"{file}:{at + 2}: entry {at} where"),
        "taken out": ([*lines[:at], *lines[at + 1 :]], [1, 2, 3, 5, 6, 7], f"{file}:{at + 1}: entry {at + 1} where"),
        "cut": (lines[:-1], [1, 2, 3, 4, 5, 6, 7], "lines were taken away or added"),
    }
    for name, (left, touches, said) in spoilt.items():
        file.write_bytes(b"".join(left))
        seen = Result("journal", "verify", "-C", cell).out
        saved = Result("journal", "salvage", "-C", cell, "--out", cell / f"{name}.csv")
        assert (saved.code, said in seen, seen.strip() in saved.err) == (1, True, True), (name, saved.err)
        assert list(readings(cell, f"{name}.csv").touch) == touches, name
    file.write_bytes(b"".join(lines))
    whole = Result("journal", "salvage", "-C", cell, "--out", cell / "whole.csv")
    assert (whole.code, whole.err) == (0, "")


@pytest.mark.few(0)
@POSIX
@pytest.mark.parametrize("words", [("journal", "verify"), ("journal", "salvage"), ("run", "--resume", "--yes"), ("run", "--watch")])
def test_a_pipe_in_the_place_of_the_journal_is_refused_and_not_waited_for(cell, words):
    os.mkfifo(cell / "readings.journal")
    more = ["--port", "socket://127.0.0.1:1"] if "--resume" in words else []
    command = [sys.executable, "-m", "tango_cnc", *words, "-C", str(cell), *more]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=100, check=False)
    assert (done.returncode, b"readings.journal: a device or a pipe" in done.stderr) == (2, True), done.stderr
    if words[-1] == "verify":
        listed = subprocess.run(
            [*command[:4], "list", *command[5:]], stdin=subprocess.DEVNULL, capture_output=True, timeout=100, check=False
        )
        assert (listed.returncode, b"a device or a pipe" in listed.stdout) == (0, True), listed.stderr


@pytest.mark.few(0)
def test_a_line_that_was_taken_from_the_end_shows_beside_the_readings(cell):
    assert Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20").code == 0
    file = cell / "readings.journal"
    file.write_bytes(b"".join(file.read_bytes().splitlines(keepends=True)[:-1]))
    result = Result("journal", "verify", "-C", cell)
    assert (result.code, "lines were taken away or added" in result.out) == (1, True)


def test_a_clock_that_is_set_in_a_pause_does_not_enter_the_times(tmp_path):
    clock = FakeClock()
    Run(tmp_path, after_the_program(printed(*GOOD[:1], end="")), boot="one", clock=clock)
    second = Run(
        tmp_path,
        after_the_program(printed(*GOOD)),
        resume=True,
        boot="one",
        clock=clock,
        now=lambda: clock.now() + datetime.timedelta(days=3),
        this_job=job(original=(2, 3, 4)),
    )
    assert second.error == ""
    times = [entry.time_s for entry in second.kinds("reading")]
    assert times == sorted(times) and times[-1] < 3600
