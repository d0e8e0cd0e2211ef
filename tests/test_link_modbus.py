"""Modbus: the layout file, the traps of pymodbus, and whole runs through a real server over TCP and over RTU on a pty."""

import contextlib
import os
import re
import struct
import sys
import threading
import time
import tty

import numpy as np
import pytest
from support.linkfaults import scene, stopped_by_the_user
from support.linkparts import job
from support.modbus import edited, served
from support.runs import Result, readings
from support.simulated_runs import agree, cell, controller  # noqa: F401  a fixture

from sim_controller.motion import Motion
from sim_controller.protocols.modbus import FLAG, POINT, POSITION, Registers
from tango_cnc.link.client import Failed, Task, Touched
from tango_cnc.link.journal import Journal, read_journal
from tango_cnc.link.layout import read_layout
from tango_cnc.link.protocols.modbus import Client
from tango_cnc.link.session import Session
from tango_cnc.link.transport import Lost, open_port, parse
from tango_cnc.records import InputError, LinkError

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("word_order: big ", "word_order: middle ", "allowed: big, little"),
        ("write: 16", "write: 6", "allowed: 16"),
        ("  acknowledged: 1 ", "  acknowledged: 0 ", "0 is status and acknowledged"),
        ("  heard: 83 ", "  heard: 93 ", "side by side"),
        ("  echo: 34 ", "  echo: 344 ", "at most 120"),
        ("layout: 3 ", "layout: 1 ", "version 1 could take a command that came late for a new one"),
        ("layout: 3 ", "layout: 2 ", "version 2 distinguished two runs by 16 bits"),
        ("turn: 4460", "turn: 4324", "differ in 4 bits"),
        ("end: 4945", "end: 3", "nothing and end"),
        ("fresh: 2 ", "fresh: 20 ", "fresh ≤ silence"),
        ("axes: [X, Y, Z", "axes: [X, Y, W", "axes[2]"),
        ("busy: 1", "busy: 0", "a number of its own"),
        ("rotary: 0.0001", "rotary: 0", "greater than 0"),
    ],
)
def test_a_layout_that_cannot_work_is_refused(tmp_path, old, new, said):
    with pytest.raises(InputError, match=re.escape(said)):
        read_layout(edited(tmp_path, old, new))


def test_a_file_that_is_no_layout_is_not_shown(tmp_path):
    (tmp_path / "other").write_text("root:x:0:0:geheim\n")
    with pytest.raises(InputError, match="is no layout of registers") as found:
        read_layout(str(tmp_path / "other"))
    assert "geheim" not in str(found.value)


def test_numbers_of_32_bits_in_both_word_orders(tmp_path):
    big, little = read_layout(), read_layout(edited(tmp_path, "word_order: big ", "word_order: little "))
    assert big.words([-123456]) == [0xFFFE, 0x1DC0]
    assert little.words([-123456]) == [0x1DC0, 0xFFFE]
    for layout in (big, little):
        assert layout.numbers(layout.words([-(2**31), -1, 0, 1, 2**31 - 1])) == [-(2**31), -1, 0, 1, 2**31 - 1]
    with pytest.raises(InputError, match="32 bits"):
        big.words([2**31])


def test_a_plan_that_the_layout_cannot_carry_is_refused_before_anything_is_sent(tmp_path):
    with pytest.raises(InputError, match="B is missing"):
        Client(job(), {"layout": edited(tmp_path, "axes: [X, Y, Z, A, B, C, S]", "axes: [X, Y, Z, A, C, S]")})
    with pytest.raises(InputError, match="32 bits"):
        Client(job(), {"layout": edited(tmp_path, "linear: 0.0001", "linear: 0.00000001")})


@pytest.mark.parametrize(
    "url", ["modbus+tcp://host:502", "modbus+tcp://host/1", "modbus+rtu:///dev/ttyUSB0/x", "modbus://host:502/1", "modbus+rtu://"]
)
def test_a_port_without_device_or_device_number_is_refused(url):
    with pytest.raises(InputError):
        parse(url, {})


@pytest.mark.few(0)
def test_a_whole_run_over_tcp(cell):
    with controller(cell, "--protocol", "modbus", "--tcp", "127.0.0.1:0") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


@posix
@pytest.mark.long
def test_a_whole_run_over_rtu_on_a_serial_line(cell):
    with controller(cell, "--protocol", "modbus", "--pty") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.few(0)
def test_a_run_is_resumed_after_an_alarm(cell):
    with controller(cell, "--protocol", "modbus", "--tcp", "127.0.0.1:0", "--fault", "alarm-after=4") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "20")
    assert (result.code, "cannot move: it is in alarm" in result.err) == (3, True), result.err
    assert len(readings(cell, "readings.partial.csv")) == 3
    with controller(cell, "--protocol", "modbus", "--tcp", "127.0.0.1:0") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "20", "--resume")
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.few(0)
def test_a_control_that_runs_the_program_hands_its_records_over(cell):
    """The program is at the control; the command starts it, and it waits after each record until that is on disk here."""
    start = ["--start", str(cell / "program" / "O7700.nc")]
    with controller(cell, "--protocol", "modbus", "--tcp", "127.0.0.1:0", "--ledger", str(cell / "ledger"), *start) as url:
        result = Result("run", "-C", cell, "--port", f"{url}?run=program", "--timeout", "20")
    assert result.code == 0, result.err
    assert agree(cell)
    assert (cell / "ledger").read_text().count('"event": "command"') == 1


@posix
@pytest.mark.long
def test_a_control_that_runs_the_program_is_resumed_with_the_rest_of_it(cell):
    start = ["--start", str(cell / "program" / "O7700.nc")]
    with controller(cell, "--protocol", "modbus", "--pty", "--fault", "alarm-after=6", *start) as url:
        result = Result("run", "-C", cell, "--port", f"{url}?run=program", "--timeout", "20")
    assert (result.code, "cannot move: it is in alarm" in result.err) == (3, True), result.err
    assert len(readings(cell, "readings.partial.csv")) == 5
    with controller(cell, "--protocol", "modbus", "--pty", *start) as url:  # nobody has brought the rest to the control
        result = Result("run", "-C", cell, "--port", f"{url}?run=program", "--timeout", "20", "--resume")
    assert (result.code, "bring the new program to the control" in result.err) == (3, True), result.err
    rest = str(next((cell / "program" / "rest").glob("*.nc")))
    with controller(cell, "--protocol", "modbus", "--pty", "--start", rest) as url:
        result = Result("run", "-C", cell, "--port", f"{url}?run=program", "--timeout", "20", "--resume")
    assert result.code == 0, result.err
    assert agree(cell)


def test_a_layout_without_the_command_cannot_hand_over_records(tmp_path):
    with pytest.raises(InputError, match="no command 'run'"):
        Client(job(), {"run": "program", "layout": edited(tmp_path, ", run: 5002}", "}")})


def crc(data):
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


class Slave:
    """An RTU device on a pty that is told, request by request, what to answer and after how many seconds."""

    def __init__(self, *answers):
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.url = f"modbus+rtu://{os.ttyname(slave)}/1"
        self.requests, self._slave = [], slave
        self._thread = threading.Thread(target=self._serve, args=(answers,), daemon=True)
        self._thread.start()

    def _serve(self, answers):
        with contextlib.suppress(OSError):
            for delay, body in answers:
                self.requests.append(os.read(self._master, 256))
                threading.Timer(delay, self._say, (body,)).start()

    def _say(self, body):
        if body:
            os.write(self._master, body + crc(body))


def read_reply(*words):
    return bytes([1, 3, 2 * len(words)]) + struct.pack(f">{len(words)}H", *words)


WROTE = bytes([1, 16, 0, 0, 0, 2])


def ask(port, request):
    assert port.write(request + b"\n") == len(request) + 1
    return port.read(0.0).decode().strip()


@posix
def test_a_late_answer_is_not_the_answer_to_the_next_request(monkeypatch):
    """What pymodbus does by itself: the reply to the first read, 0.1 s too late, is handed out as that to the second."""
    monkeypatch.setattr("tango_cnc.link.transport._modbus.ANSWER", 1.0)
    slave = Slave((1.3, read_reply(11, 11)), (0.6, read_reply(22, 22)))  # the late one comes first if nobody waits for it
    port = open_port(parse(slave.url, {}))
    try:
        assert ask(port, b"3 0 2").startswith("-")
        assert ask(port, b"3 0 2") == "3 22 22"
    finally:
        port.close()


@posix
def test_an_answer_of_another_function_or_length_is_none(monkeypatch):
    monkeypatch.setattr("tango_cnc.link.transport._modbus.ANSWER", 0.2)
    other = bytes([1, 4]) + read_reply(9, 9)[2:]  # function 4, as many registers as were asked for
    answers = (WROTE, read_reply(1, 2, 3), other, read_reply(5, 6), read_reply(7, 8), WROTE)
    slave = Slave(*((0.0, answer) for answer in answers))
    port = open_port(parse(slave.url, {}))
    try:
        assert ask(port, b"3 0 2").startswith("-")
        assert ask(port, b"3 0 2").startswith("-")
        assert ask(port, b"3 0 2").startswith("-")
        assert ask(port, b"16 0 5 6").startswith("-")
        assert ask(port, b"3 0 2") == "3 7 8"
        assert ask(port, b"16 0 5 6") == "16 0 2"
    finally:
        port.close()


@posix
def test_a_write_that_is_not_answered_goes_out_once(monkeypatch):
    monkeypatch.setattr("tango_cnc.link.transport._modbus.ANSWER", 0.1)
    slave = Slave((0.0, b""), (0.0, b""))
    port = open_port(parse(slave.url, {}))
    try:
        assert ask(port, b"16 0 5 6").startswith("-")
        time.sleep(0.3)
        assert [request[1] for request in slave.requests] == [16]
    finally:
        port.close()


@posix
def test_an_exception_of_the_device_is_passed_on():
    slave = Slave((0.0, bytes([1, 0x83, 2])))
    port = open_port(parse(slave.url, {}))
    try:
        assert ask(port, b"3 0 2") == "! 2"
    finally:
        port.close()


@pytest.mark.few(0)
def test_a_device_that_hangs_up_and_stays_away_is_lost(cell):
    with controller(cell, "--protocol", "modbus", "--tcp", "127.0.0.1:0") as url:
        port = open_port(parse(url, {}))
        assert ask(port, b"3 30 2") == "3 3 4660"
        assert ask(port, b"3 90 9") == "! 2"
        assert ask(port, b"16 40 9") == "! 2"  # the control's own
    with pytest.raises(Lost, match=r"^the (device has closed the connection|connection broke and cannot be opened again)$"):
        for _ in range(600):
            ask(port, b"3 30 2")
            time.sleep(0.05)
    port.close()


class Restless(Registers):
    """A control of which some registers change from one reading to the next, for ever, once it has measured."""

    def __init__(self, motion, *registers):
        super().__init__(motion)
        self._changing, self.looks = registers, 0

    def spoilt(self, words):
        """registers → what is read of them."""
        if words[FLAG]:
            self.looks += 1
            for register in self._changing:
                words[register] ^= self.looks % 2
        return words


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("registers", "named", "touches"),
    [
        ((POSITION, POSITION + 1), "X stands|X moved", 1),  # both halves of X, by 6.5536 mm: the axis does not stand still
        ((POSITION + 1,), "10 records in a row were not believed.*go on changing: position", 10),  # 0.1 µm
        ((POINT, FLAG), "10 records in a row were not believed.*go on changing: flag, point", 10),
    ],
)
def test_registers_that_never_come_to_rest_end_a_run_soon(tmp_path, registers, named, touches):
    """A real server: no touch of them becomes a reading, and the run ends by itself long before the control would be late."""
    _, made, truth = scene(turning=False)
    numbers = tuple(touch.number for touch in made.touches)
    task = Task(made, "", "M", made.machine.names, (60.0,) * (len(numbers) + 1), numbers, summed=False)
    device, journal = Restless(Motion(truth), *registers), Journal(tmp_path / "run.journal")
    with served(device, device.spoilt) as url:
        line, began = open_port(parse(url, {})), time.monotonic()
        with pytest.raises(LinkError, match=named) as ended:
            Session(task, Client(task, {}), journal, lambda step: None, clock=time.monotonic).run(line)
        assert time.monotonic() - began < 50
        line.close()
    journal.close()
    entries = read_journal(tmp_path / "run.journal")[0]
    assert [entry.kind for entry in entries].count("reading") == 0
    assert device.looks <= touches * 40
    assert "0 of 60 touches are recorded" in str(ended.value)


def test_every_target_stands_where_it_was_planned(cell):
    """Counts of 0.1 µm: what the control is told differs from the plan by half of one at most."""
    layout = read_layout()
    values = np.linspace(-400, 400, 999)
    back = [layout.value("X", layout.numbers(layout.words([layout.counts("X", value)]))[0]) for value in values]
    assert np.abs(np.array(back) - values).max() <= 0.5001e-4


@pytest.mark.parametrize("protocol", ["modbus", "grbl"])
def test_who_stops_the_run_leaves_the_probe_clear_of_the_table(protocol):
    """Ctrl-C: the move that is being made is waited for, then the probe goes up, and nothing else is asked for."""
    _, made, truth = scene()
    motion = Motion(truth)

    def touched(client, events):
        return sum(isinstance(event, Touched) for event in events) == 3

    events, _ = stopped_by_the_user(protocol, made, motion, {"orient": "m19"} if protocol == "grbl" else {}, touched)
    assert events[-1] == Failed("stopped by the user; the probe has been drawn clear")
    assert touched(None, events)
    linear = [made.machine.column(name) for name in made.machine.linear]
    assert np.abs(motion.position[linear] - np.array(made.touches[2].over)[linear]).max() < 1e-3


@pytest.mark.parametrize(
    ("url", "said"),
    [("modbus+tcp://127.0.0.1:1/1", "nothing answers at 127.0.0.1:1"), ("modbus+rtu:///dev/none/1", "/dev/none cannot be opened")],
)
def test_nobody_there_and_no_such_line_are_two_things(url, said):
    with pytest.raises(LinkError, match=said):
        open_port(parse(url, {}))
