"""The pretended controller as a process: a conversation over a pseudo-terminal and over TCP, by bytes."""

from __future__ import annotations

import contextlib
import json
import os
import pkgutil
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.effect_parts import Tape

from sim_controller import protocols
from sim_controller.__main__ import run
from sim_controller.lines import ParityLine, even
from sim_controller.protocols import Talk

TALKS = sorted(m.name for m in pkgutil.iter_modules(protocols.__path__) if not m.name.startswith("_"))
EXAMPLE = Path(__file__).parent.parent / "examples" / "hu40t"
DC1, DC2, DC3, DC4 = b"\x11", b"\x12", b"\x13", b"\x14"
HELLO = b"%\nO1\nPOPEN\nDPRNT[HELLO]\nPCLOS\nM30\n%\n"
TOUCH = b"G0 X-90. Y0.\nG0 Z340.\nG31 Z325. F180.\nDPRNT[H1*Z#5063[44]]\nG1 Z340. F2000.\n"
PATIENCE = 60.0  # s, for a loaded machine


@pytest.mark.parametrize("name", TALKS)
def test_every_protocol_of_the_simulated_control_says_how_it_talks_and_where(name: str) -> None:
    talk = import_module(f"sim_controller.protocols.{name}").TALK
    assert isinstance(talk, Talk) and callable(talk.serve)
    assert all("{}" in url for url in (talk.tcp, talk.pty))


class Process:
    """`python -m sim_controller` and what it has said on stdout."""

    def __init__(self, world: Path, *arguments: str) -> None:
        command = [sys.executable, "-m", "sim_controller", "--cell", str(EXAMPLE), "--world", str(world), *arguments]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self.port = self._process.stdout.readline().strip()

    def end(self) -> str:
        """Waits for it to end by itself; → what it said on stderr."""
        _, errors = self._process.communicate(timeout=PATIENCE)
        assert self._process.returncode == 0, errors
        return errors

    def kill(self) -> str:
        """Ends it; → what it said on stderr."""
        if self._process.poll() is None:
            self._process.kill()
        return self._process.communicate()[1] if not self._process.stderr.closed else ""  # type: ignore[union-attr]


class Terminal:
    """The other end: a file descriptor that is read until something has come."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.heard = b""

    def send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.descriptor, data) :]

    def until(self, wanted: bytes) -> bytes:
        """→ everything heard so far, once `wanted` is in it."""
        end = time.monotonic() + PATIENCE
        while wanted not in self.heard:
            assert time.monotonic() < end, f"{wanted!r} has not come: {self.heard!r}"
            self.listen(0.1)
        return self.heard

    def listen(self, seconds: float) -> None:
        if select.select([self.descriptor], [], [], seconds)[0]:
            self.heard += os.read(self.descriptor, 4096)


Start = Callable[..., tuple[Process, Terminal]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """→ a function that starts the process on TCP or a pty and connects to it."""
    world = tmp_path / "world.yaml"
    world.write_text("noise: 0\n")
    with contextlib.ExitStack() as stack:

        def begin(*arguments: str) -> tuple[Process, Terminal]:
            over = arguments if "--pty" in arguments else ("--tcp", "127.0.0.1:0", *arguments)
            process = Process(world, *over)
            stack.callback(process.kill)
            if process.port.startswith("socket://"):
                host, _, port = process.port.removeprefix("socket://").rpartition(":")
                connection = stack.enter_context(socket.create_connection((host, int(port))))
                return process, Terminal(connection.fileno())
            descriptor = os.open(process.port, os.O_RDWR | os.O_NOCTTY)
            stack.callback(os.close, descriptor)
            return process, Terminal(descriptor)

        yield begin


def test_a_conversation_over_tcp(start: Start, tmp_path: Path) -> None:
    process, line = start("--once", "--ledger", str(tmp_path / "ledger.jsonl"))
    assert line.until(DC1) == DC1
    line.send(b"% TITLE OF THE TAPE\nO1\nPOPEN\n" + TOUCH + b"PCLOS\nM30\n%\n")
    assert line.until(DC4) == DC1 + DC2 + b"H1 Z  329.6740\n" + DC4
    process.end()
    ledger = [json.loads(text) for text in (tmp_path / "ledger.jsonl").read_text().splitlines()]
    (contact,) = [entry for entry in ledger if entry["event"] == "contact"]
    assert contact["surface"] == "facet 16"
    assert contact["at"]["Z"] == pytest.approx(329.674, abs=1e-9)
    assert [entry["text"] for entry in ledger if entry["event"] == "output"] == ["H1 Z  329.6740"]
    assert [entry["state"] for entry in ledger if entry["event"] == "program"] == ["storing", "ended"]


@pytest.mark.long
def test_a_compensation_is_in_the_control(start: Start, tmp_path: Path) -> None:
    (tmp_path / "compensation.json").write_text('{"target": "linuxcnc"}')
    (tmp_path / "compensation.ini").write_text("[JOINT_2]\nCOMP_FILE = z.comp\nCOMP_FILE_TYPE = 0\n")
    (tmp_path / "z.comp").write_text("0 -0.1 -0.1\n800 799.9 799.9\n")  # the axis stands 0.1 mm lower than it is told
    _, line = start("--compensation", str(tmp_path))
    line.send(b"%\nO1\nPOPEN\n" + TOUCH + b"PCLOS\nM30\n%\n")
    assert b"H1 Z  329.5740\n" in line.until(DC4)


def test_a_folder_that_is_no_compensation_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--cell", str(EXAMPLE), "--tcp", "127.0.0.1:0", "--compensation", str(tmp_path)]) == 2
    assert "a folder that 'tango compensate' has written" in capsys.readouterr().err


@pytest.mark.long
def test_a_conversation_over_a_pseudo_terminal(start: Start) -> None:
    process, line = start("--pty", "--once")
    assert process.port.startswith("/dev/")
    line.until(DC1)
    line.send(b"\x00\x00\x7f\nleader that is not read\n" + HELLO)
    assert line.until(DC4).endswith(DC2 + b"HELLO\n" + DC4)
    process.end()


@pytest.mark.long
def test_the_control_asks_again_until_a_tape_comes(start: Start) -> None:
    _, line = start()
    line.until(DC1 + DC1)


@pytest.mark.long
def test_one_program_after_the_other_on_the_same_line(start: Start) -> None:
    _, line = start()
    line.send(HELLO)
    line.until(DC4)
    line.until(DC4 + DC1)
    line.send(HELLO + HELLO)
    assert line.until(DC4 + DC1 + DC2 + b"HELLO\n" + DC4 + DC1 + DC2 + b"HELLO\n" + DC4)


@pytest.mark.long
def test_common_variables_survive_from_program_to_program(start: Start) -> None:
    _, line = start()
    line.send(b"%\nO1\n#500=7\nM30\n%\n%\nO2\nPOPEN\nDPRNT[V#500[20]]\nPCLOS\nM30\n%\n")
    assert b"V  7\n" in line.until(DC4)


@pytest.mark.long
def test_an_alarm_says_nothing_on_the_line_and_the_next_tape_is_taken(start: Start) -> None:
    process, line = start()
    line.until(DC1)
    line.send(b"%\nO1\nPOPEN\nDPRNT[ONE]\nG12\nDPRNT[TWO]\nM30\n%\n")
    line.until(b"ONE\n" + DC1)  # the operator has reset it
    assert b"TWO" not in line.heard and DC4 not in line.heard
    line.send(HELLO)
    line.until(b"HELLO\n")
    assert process.kill() == "PS0010 IMPROPER G-CODE (G12)\n"


@pytest.mark.long
def test_drip_feeding_is_held_and_released(start: Start) -> None:
    process, line = start("--mode", "dnc", "--speed", "200", "--buffer", "512", "--once")
    program = b"%\nPOPEN\n" + b"".join(b"G4 P100\nDPRNT[LINE*%d]\n" % i for i in range(400)) + b"PCLOS\nM30\n%\n"
    may_send = True
    at = 0
    end = time.monotonic() + PATIENCE
    while DC4 not in line.heard and time.monotonic() < end:
        heard = len(line.heard)
        line.listen(0.001 if may_send and at < len(program) else 0.05)
        for byte in line.heard[heard:]:
            if bytes([byte]) in (DC1, DC3):
                may_send = bytes([byte]) == DC1
        if may_send and at < len(program):
            line.send(program[at : at + 64])
            at += 64
    process.end()
    plain = line.heard.translate(None, DC1 + DC3)
    assert plain == DC2 + b"".join(b"LINE %d\n" % i for i in range(400)) + DC4
    assert line.heard.count(DC3) >= 3
    assert line.heard.index(b"LINE 5\n") < line.heard.rindex(DC1)  # it was at work while more arrived


@pytest.mark.long
def test_output_waits_while_the_other_side_holds_it(start: Start) -> None:
    _, line = start()
    line.until(DC1)
    line.send(DC3 + HELLO)
    line.listen(0.3)
    assert DC2 not in line.heard
    line.send(DC1)
    line.until(b"HELLO\n" + DC4)


@pytest.mark.long
def test_seven_bits_and_even_parity(start: Start) -> None:
    process, line = start("--parity", "--once")
    line.send(even(HELLO))
    line.until(even(DC4))
    process.end()
    assert all(byte.bit_count() % 2 == 0 for byte in line.heard)
    assert bytes(byte & 0x7F for byte in line.heard).endswith(DC2 + b"HELLO\n" + DC4)


@pytest.mark.long
def test_a_power_cut_is_silence(start: Start, tmp_path: Path) -> None:
    ledger = tmp_path / "ledger.jsonl"
    _, line = start("--fault", "stop-after=2", "--ledger", str(ledger))
    line.send(b"%\nO1\nPOPEN\n" + 3 * TOUCH + b"PCLOS\nM30\n%\n")
    line.until(b"H1 Z  329.6740\n")
    line.listen(0.5)
    assert line.heard.count(b"H1") == 1 and DC4 not in line.heard
    events = [json.loads(text) for text in ledger.read_text().splitlines()]
    assert [e["event"] for e in events].count("contact") == 2
    assert events[-1]["event"] == "power" and events[-1]["state"] == "off"


@pytest.mark.long
def test_hanging_up_in_the_middle_leaves_the_control_ready_for_the_next(start: Start) -> None:
    process, line = start("--speed", "100")
    line.send(b"%\nO1\nPOPEN\nG4 X10.\nDPRNT[LATE]\nM30\n%\n")
    line.until(DC2)
    host, _, port = process.port.removeprefix("socket://").rpartition(":")
    with socket.create_connection((host, int(port))) as second:  # queues up behind the first
        with socket.socket(fileno=os.dup(line.descriptor)) as first:
            first.shutdown(socket.SHUT_RDWR)
        terminal = Terminal(second.fileno())
        terminal.until(DC1)
        terminal.send(HELLO)
        terminal.until(b"HELLO\n")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--tcp", "127.0.0.1:0", "--pty"], "one of them"),
        (["--tcp", "nowhere"], "HOST:PORT"),
        (["--tcp", "127.0.0.1:0", "--language", "macro_c"], "Did you mean 'macro_b'?"),
        (["--tcp", "127.0.0.1:0", "--set", "incremnt=1"], "Did you mean 'increment'?"),
        (["--tcp", "127.0.0.1:0", "--set", "increment"], "NAME=VALUE"),
        (["--tcp", "127.0.0.1:0", "--fault", "stop-aftr=1"], "Did you mean 'stop-after'?"),
        (["--tcp", "127.0.0.1:0", "--g54", "1,b,3"], "name:number"),
        (["--tcp", "127.0.0.1:0", "--world", "/nowhere/world.yaml"], "no such file"),
    ],
)
def test_a_wrong_start_is_refused_in_one_sentence(arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--cell", str(EXAMPLE), *arguments]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("sim_controller: ") and complaint in said.err
    assert said.out == ""


@pytest.mark.long
@given(st.lists(st.integers(1, 7), min_size=1, max_size=40))
def test_a_tape_is_the_same_however_it_is_cut(pieces: list[int]) -> None:
    data = b"junk\n% TITLE\r\nO1\r\n\x00G0 X1.\r\n\nM30\n%after"
    tape, at, behind = Tape(4096), 0, b""
    for size in [*pieces, len(data)]:
        behind += tape.put(data[at : at + size])
        at += size
    assert tape.ended
    assert list(tape.lines()) == ["O1", "G0 X1.", "M30"]
    assert behind == b"after"


def test_a_character_with_wrong_parity_is_marked() -> None:
    class Loop:
        def receive(self, timeout: float) -> bytes:
            return even(b"G0") + b"\x58" + bytes([even(b"Y")[0] ^ 0x80])

        def send(self, data: bytes) -> None: ...

        def close(self) -> None: ...

    line = ParityLine(Loop())
    assert line.receive(0) == b"G0\x1a\x1a"
    assert line.errors == 2
