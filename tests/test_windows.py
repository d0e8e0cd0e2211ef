"""What can be seen of Windows without one: what Python lacks there, what its files refuse, what its consoles and ports are asked.

None of it has been tried on a real Windows (docs/link.md).
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import serial
from support.runs import STRATEGY
from support.simulated_runs import agree, controller
from support.simulated_runs import cell as cell  # a fixture
from support.windows import absent, missing

from tango_cnc.commands.init import write_example
from tango_cnc.link import transport
from tango_cnc.link.protocols import dnc
from tango_cnc.link.transport import open_port, parse
from tango_cnc.records import LinkError

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="which files are open is asked of /proc")
TESTS = Path(__file__).parent
WINDOWS = """
import sys
from support.windows import become
keys = become()
"""
LOCKS = """
import json, os, signal, threading
from pathlib import Path
from tango_cnc.link import lock
from tango_cnc.link.journal import Journal
from tango_cnc.link import measure
from tango_cnc.link.process import endings
from tango_cnc.records import LinkError

folder = Path(sys.argv[1])
file = folder / lock.NAME
said = []

def other(call):
    def tried():
        try:
            call()
        except LinkError as error:
            said.append(str(error))
    thread = threading.Thread(target=tried)
    thread.start()
    thread.join()

def hold():
    with lock.holding(folder, "another"):
        pass

with lock.holding(folder, "tango run"):
    other(hold)
    with lock.holding(folder, "tango plan"):
        pass
    assert "tango run" in lock.at_work(folder) and "tango run" in said[0], said
assert not file.exists() and not lock.at_work(folder)
gone = {"what": "x", "pid": 1 << 22, "host": os.uname()[1], "since": "", "process": "", "thread": 1}
file.write_text(json.dumps(gone))
hold()
journal = Journal(folder / "readings.journal")
other(lambda: Journal(folder / "readings.journal", resume=True))
assert "is another 'tango run' using it" in said[1], said
journal.close()
Journal(folder / "readings.journal", resume=True).close()
assert endings() == (signal.SIGTERM, signal.SIGUSR2)  # which stands for SIGBREAK
with measure._signals() as stop:
    signal.raise_signal(signal.SIGUSR2)
    assert stop() == 1
print("all")
"""


def python(*words: object) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-X", "warn_default_encoding", *map(str, words)]
    return subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=560, check=False)


def commands(tmp_path: Path, *words: list[str]) -> list[dict[str, Any]]:
    """commands of tango as Windows would run them → their exit status and texts."""
    (tmp_path / "commands.json").write_text(json.dumps(words))
    ran = python("-m", "support.windows", tmp_path / "commands.json")
    assert ran.returncode == 0, ran.stderr[-3000:]
    first, *others = (json.loads(line) for line in ran.stdout.splitlines())
    assert first["modules"] > 800
    return others


def test_what_windows_lacks_is_known() -> None:
    assert all(map(absent, ("fcntl", "termios", "resource", "pty"))) and not any(
        map(absent, ("os", "signal", "select", "socket", "json"))
    )
    assert (
        {"SIGHUP", "SIGKILL"} <= missing("signal")
        and {"fork", "getuid", "openpty"} <= missing("os")
        and "replace" not in missing("os")
    )


@pytest.mark.few(0)
@LINUX
def test_one_writer_a_folder_and_a_journal_by_locked_bytes(tmp_path: Path) -> None:
    ran = python("-c", WINDOWS + LOCKS, tmp_path)
    assert (ran.returncode, ran.stdout) == (0, "all\n"), ran.stderr[-3000:]


@LINUX
@pytest.mark.long
def test_the_commands_of_a_cell_ask_for_nothing_that_windows_lacks(tmp_path: Path) -> None:
    """All modules are imported; a run breaks off, is resumed and made again, so every file that is there is replaced or renamed."""
    at = tmp_path / "cell"
    write_example(at, "hu40t")
    (at / "strategy.yaml").write_text(STRATEGY)
    run = ["run", "-C", str(at), "--timeout", "20", "--port"]
    ran = commands(
        tmp_path,
        *([word, "-C", str(at)] for word in ("check", "plan", "simulate")),
        [*run, "CONTROL=3"],
        [*run, "CONTROL", "--resume", "--json", str(at / "events.json"), "--transcript", str(at / "bytes.txt")],
        [*run, "CONTROL"],
        ["journal", "verify", "-C", str(at)],
        ["plan", "-C", str(at)],
        ["nightly", "-C", str(at), "--install", "windows", "--at", "02:00"],
        ["nightly", "-C", str(at), "--simulated"],
        ["nightly", "-C", str(at), "--status"],
        ["history", "-C", str(at), "list"],
        ["history", "-C", str(at), "verify"],
        ["ports"],
    )
    assert [one["code"] for one in ran] == [1, 0, 0, 3, 0, 0, 0, 0, 0, 3, 1, 0, 0, 0], ran  # check: seven touches are few
    assert "3 of 7 touches" in ran[3]["err"] and "no finger" not in ran[9]["err"]
    assert len(list(at.glob("readings.2*.csv"))) == 1 and not list(at.rglob(".*.csv.*"))


@LINUX
@pytest.mark.long
def test_a_run_over_a_serial_port_that_is_read_and_written_as_on_windows(cell: Path, tmp_path: Path) -> None:
    with controller(cell, "--pty") as device:
        (ran,) = commands(tmp_path, ["run", "-C", str(cell), "--port", f"serial://{device}", "--timeout", "20"])
    assert ran["code"] == 0, ran
    assert agree(cell)


class State(ctypes.Structure):
    """The settings of a port that matter here; of their size only that it is stated."""

    _fields_ = [("DCBlength", ctypes.c_uint32), ("fErrorChar", ctypes.c_uint32, 1), ("ErrorChar", ctypes.c_char)]  # noqa: RUF012


class Com3:
    """pyserial's port on Windows: settings that it sets put the driver's own ones back."""

    def __init__(self, kept: list[Any]) -> None:
        self._port_handle, self.out_waiting, self._kept = 7, 0, kept

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        if name == "xonxoff":
            self._kept.append("as pyserial has it")

    def write(self, data: bytes) -> int:
        return len(data)


@pytest.mark.parametrize("takes", [True, False])
def test_a_character_of_wrong_parity_arrives_as_sub(monkeypatch: pytest.MonkeyPatch, takes: bool) -> None:
    """pyserial lets the driver of Windows deliver it as it came, and it may look like another digit."""
    kept: list[Any] = []

    def state(handle: int, into: Any) -> bool:
        assert handle == 7
        return True

    def stated(handle: int, new: Any) -> bool:
        kept.append((new._obj.DCBlength > 0, new._obj.fErrorChar, new._obj.ErrorChar))
        return takes

    win32 = ModuleType("serial.win32")
    vars(win32).update(DCB=State, GetCommState=state, SetCommState=stated)
    monkeypatch.setitem(sys.modules, "serial.win32", win32)
    monkeypatch.setattr(serial, "win32", win32, raising=False)
    monkeypatch.setattr("tango_cnc.link.transport._port.os", SimpleNamespace(name="nt"))
    monkeypatch.setattr(serial, "serial_for_url", lambda target, **settings: Com3(kept))
    address = parse("serial://COM3?bits=7&parity=even&flow=xonxoff", dnc.OPTIONS)
    if not takes:
        with pytest.raises(LinkError, match="does not replace characters of wrong parity; allowed here: parity=none"):
            open_port(address)
        return
    port = open_port(address)
    assert kept == [(True, 1, b"\x1a")]
    assert port.write(b"%") == 1 and kept == [(True, 1, b"\x1a"), "as pyserial has it", (True, 1, b"\x1a")]
    kept.clear()
    open_port(parse("serial://COM3", dnc.OPTIONS))
    assert kept == []


@pytest.mark.parametrize("url", ["serial://COM3", "rfc2217://127.0.0.1:2217?baud=9600"])
@pytest.mark.parametrize("timeout", [0.0, 0.01])
def test_a_look_between_two_pieces_of_a_program_waits_for_nothing(
    monkeypatch: pytest.MonkeyPatch, url: str, timeout: float
) -> None:
    """32 bytes and 50 ms at 9600 baud were 640 of the 960 characters a second that the line carries."""
    came, slept = [0, 0, 5], [0.0]

    class Silent(Com3):
        in_waiting = property(lambda self: came.pop(0) if came else 0)

        def read(self, size: int) -> bytes:
            assert size == 5 and not came, "nothing had arrived: pyserial waits for it"
            return b"P1 H1"

    def sleep(seconds: float) -> None:
        slept[0] += seconds

    monkeypatch.setattr("tango_cnc.link.transport._port.os", SimpleNamespace(name="nt"))
    monkeypatch.setattr("tango_cnc.link.transport._port.time", SimpleNamespace(monotonic=lambda: slept[0], sleep=sleep))
    monkeypatch.setattr(serial, "serial_for_url", lambda target, **settings: Silent([]))
    port = open_port(parse(url, dnc.OPTIONS))
    if timeout:
        came.append(5)  # looked at once more, for its size
        assert port.read(timeout) == b"P1 H1" and 0 < slept[0] < 0.01
    assert port.read(0.0) == b"" and slept[0] < 0.01


def test_a_read_waits_as_long_as_it_was_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """pyserial gives up after a slice; the silence that was asked for is longer."""
    came, clock = [b"", b"", b"P1 H1", b"", b"", b"", b"", b""], [0.0]

    class Slow(Com3):
        in_waiting = 0

        def read(self, size: int) -> bytes:
            clock[0] += 0.5
            return came.pop(0)

    monkeypatch.setattr("tango_cnc.link.transport._port.os", SimpleNamespace(name="nt"))
    monkeypatch.setattr("tango_cnc.link.transport._port.time", SimpleNamespace(monotonic=lambda: clock[0], sleep=None))
    monkeypatch.setattr(serial, "serial_for_url", lambda target, **settings: Slow([]))
    port = open_port(parse("serial://COM3", dnc.OPTIONS))
    assert port.read(2.0) == b"P1 H1" and clock[0] == 1.5
    assert port.read(2.0) == b"" and clock[0] == 3.5


def test_a_port_that_another_program_has_open_is_said_to_be_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(target: str, **settings: Any) -> None:
        raise serial.SerialException(f"could not open port {target!r}: PermissionError(13, 'Access is denied.', None, 5)")

    monkeypatch.setattr(serial, "serial_for_url", refused)
    with pytest.raises(LinkError, match="Another program has it open: close that one"):
        open_port(parse("COM3", dnc.OPTIONS))


def test_enter_that_was_pressed_before_the_question_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would say that nothing moves."""
    typed = ["\r", "y", "\r"]
    keys = ModuleType("msvcrt")
    vars(keys).update(kbhit=lambda: bool(typed), getwch=lambda: typed.pop(0))
    monkeypatch.setitem(sys.modules, "msvcrt", keys)
    monkeypatch.setattr("tango_cnc.link.transport._person.os", SimpleNamespace(name="nt"))
    left: list[int] = []

    def answered() -> str:
        left.append(len(typed))
        return "\n"

    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True, readline=answered))
    assert transport._person.Person().asked(5.0) is True and left == [0]
