"""`tango link-test` and `tango ports`: what a person sees before the first run."""

import contextlib
import json
import re
import socket
import threading

import pytest
from support.linkparts import job
from support.runs import STRATEGY, Result
from support.simulated_runs import controller

from tango_cnc.commands.init import write_example
from tango_cnc.link._punched import compared
from tango_cnc.link.heard import heard, noise, parity_of
from tango_cnc.link.protocols import dnc, grbl, linuxcnc, modbus
from tango_cnc.link.session import listen

LETTERS = ("X", "Y", "Z", "B", "C", "S")
RECORD = "P1 H1 X20.0 Y0.0 Z50.0 B0.0 C0.0 S0.0\r\n"


def even(text):
    return bytes(byte | byte.bit_count() % 2 << 7 for byte in text.encode())


def test_silence_says_what_to_look_at():
    assert "TX and RX" in heard(b"", LETTERS)[0]


def test_parity_is_told_from_the_characters():
    assert heard(even(RECORD), LETTERS) == [
        "every character has even parity in its eighth bit: set bits=7&parity=even",
        "1 lines, 1 of them records of a TANGO program",
    ]
    assert parity_of(bytes(byte ^ 0x80 for byte in even(RECORD))) == "odd"
    assert parity_of(RECORD.encode()) is None


def test_a_wrong_baud_rate_is_suspected_from_characters_that_are_none():
    assert "baud rate" in heard(bytes(range(0x70, 0xF0)), LETTERS)[0]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\x7f" * 20, ""),  # rub-outs, as a tape has them: seven bits
        (b"\x80" * 20, "every character has odd parity"),
        (b"A" * 20, ""),  # two ones in each of them, and no eighth bit
        (b"ab" * 30 + b"\xff" * 20, ""),  # a quarter
        (b"ab" * 30 + b"\xff" * 21, "21 of 81 characters are none"),
    ],
)
def test_the_eighth_bit_decides_what_is_suspected_of_a_line(data, said):
    assert (noise(data) or [""])[0].startswith(said) and bool(noise(data)) == bool(said)


def test_codes_and_records_are_counted():
    found = heard(b"\x11\x12" + RECORD.encode() + b"\x14hello\n", LETTERS)
    assert found == [
        "flow and print codes: 1 x DC1 (send), 1 x DC2 (print begins), 1 x DC4 (print ends)",
        "2 lines, 1 of them records of a TANGO program",
    ]


@pytest.fixture
def cell(tmp_path):
    write_example(tmp_path / "cell", "hu40t")
    (tmp_path / "cell" / "strategy.yaml").write_text(STRATEGY)  # what is heard depends on no number of touches
    return tmp_path / "cell"


def test_the_command_shows_what_came_and_moves_nothing(cell):
    with socket.create_server(("127.0.0.1", 0)) as server:
        got = []

        def serve():
            connection, _ = server.accept()
            connection.sendall(b"\x11")
            got.append(connection.recv(100))
            connection.close()

        thread = threading.Thread(target=serve)
        thread.start()
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        result = Result("link-test", "-C", cell, "--port", url, "--seconds", "0.3", "--json", "-")
        thread.join(5)
    assert result.code == 0
    assert json.loads(result.out)["found"] == ["flow and print codes: 1 x DC1 (send)"]
    assert got == [b""]


@contextlib.contextmanager
def babbling(data):
    """→ port of a control that says the same again and again."""
    stop = threading.Event()

    def serve():
        connection, _ = server.accept()
        with connection, contextlib.suppress(OSError):
            while not stop.wait(0.02):
                connection.sendall(data)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, daemon=True).start()
        yield f"socket://127.0.0.1:{server.getsockname()[1]}"
        stop.set()


WRONG_RATE = bytes(range(0x80, 0xA0)) + b"x\n"


def test_a_line_at_another_rate_is_named_by_the_test_and_by_the_run(cell):
    """What 9600 baud makes of 4800: characters come all the time, and the control is not silent."""
    with babbling(WRONG_RATE) as url:
        tested = Result("link-test", "-C", cell, "--port", url, "--seconds", "0.2")
    with babbling(WRONG_RATE) as url:
        run = Result("run", "-C", cell, "--port", url, "--timeout", "0.5")
    assert (tested.code, run.code) == (1, 3)
    for said in (tested.out, run.err):
        assert "characters are none: the baud rate, or parity and bits, are set wrongly" in said
    assert re.search(r"no record came within 0\.5 s, but \d+ characters", run.err) and "silent" not in run.err, run.err


@pytest.mark.parametrize(("more", "code"), [("", 1), ("?bits=7", 0)])
def test_parity_that_is_not_set_keeps_a_run_from_working(cell, more, code):
    with babbling(even(RECORD + "\n")) as url:
        assert Result("link-test", "-C", cell, "--port", url + more, "--seconds", "0.2").code == code


def test_what_comes_and_is_no_record_is_shown_where_its_characters_look_right():
    client = dnc.Client(job(start_patience=5.0), {})
    client.receive(b"\x11" + b"READY\r\n" * 3)
    (failed,) = client.elapsed(6.0)
    assert "no record came within 5 s, but 15 characters that are none: the last ones: READYREADYREADY" in failed.why
    client = dnc.Client(job(start_patience=5.0), {})
    client.receive(b"\x11\0\0\r\n\x13")
    assert "silent for longer than 5 s" in client.elapsed(6.0)[0].why


def test_how_many_characters_were_strange_is_said_up_to_what_is_remembered():
    for count, said in (
        (4095, "4095 characters that"),
        (4096, "4096 characters and more that"),
        (5000, "4096 characters and more that"),
    ):
        client = dnc.Client(job(start_patience=5.0), {})
        client.receive(b"\x11" + b"A" * count)
        assert f"but {said} are none" in client.elapsed(6.0)[0].why


def test_a_silent_line_is_exit_status_1(cell):
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        result = Result("link-test", "-C", cell, "--port", url, "--seconds", "0.1")
    assert result.code == 1
    assert "nothing came" in result.out


GRBL = b"[VER:1.1h.20190825:]\r\nok\r\n$10=1\r\n$13=1\r\nok\r\nok\r\n[MSG:38.3000]\r\nok\r\n"
GRBL += b"<Idle|MPos:0.000,0.000,0.000|FS:0,0|Pn:XP>\r\n"


def test_what_grbl_says_of_itself():
    fine, sentences = grbl.Client.told(GRBL.replace(b"|Pn:XP", b""), {})
    assert fine
    assert sentences[0] == "grbl, VER:1.1h.20190825, which does not name its axes"
    assert "positions come in inches ($13=1)" in sentences
    assert "it confirms targets before it moves" in sentences


def test_a_grbl_that_cannot_confirm_targets_is_told_from_one_that_need_not():
    data = GRBL.replace(b"|Pn:XP", b"").replace(b"ok\r\n[MSG:38.3000]\r\nok", b"error:1\r\nok")
    fine, sentences = grbl.Client.told(data, {})
    assert not fine
    assert "built with expressions" in sentences[-1]
    fine, sentences = grbl.Client.told(data, {"targets": "plain"})
    assert fine
    assert "a hand on feed hold" in sentences[-1]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"", b"", "the probe signal is on"),
        (b"<Idle", b"<Alarm", "nothing will move before that is cleared"),
        (b"$10=1", b"$10=2", r"set \$10=1"),
        (b"$13=1\r\n", b"", "have not come"),
        (b"VER", b"\xd6\xc5\xd2", "no answer of grbl.*115200"),
    ],
)
def test_what_keeps_a_grbl_from_working_is_said(old, new, said):
    fine, sentences = grbl.Client.told(GRBL.replace(old, new), {})
    assert not fine
    assert re.search(said, " ".join(sentences))


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ("- no answer\n- no answer\n", "device number"),
        ("43 Siemens%20AG S7\n! 2\n", "calls itself Siemens AG, S7 it refuses to read .* exception 2"),
        ("! 1\n3 " + " ".join(["7"] * 34) + "\n", "refuses function 43/14.* register 31 holds 0007 hex"),
    ],
)
def test_what_keeps_a_modbus_device_from_working_is_said(answers, said):
    fine, sentences = modbus.Client.told(answers.encode(), {})
    assert not fine
    assert re.search(said, " ".join(sentences))


@pytest.mark.few(0)
def test_a_modbus_device_says_who_it_is_and_that_its_registers_fit(cell):
    with controller(cell, "--protocol", "modbus", "--tcp", "127.0.0.1:0") as url:
        result = Result("link-test", "-C", cell, "--port", url, "--seconds", "5", "--json", "-")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    assert found["recognised"]
    assert found["found"][0] == "the device calls itself sim_controller, TANGO, 1"
    assert "big word order" in found["found"][1]


def test_what_linuxcnc_says_of_itself():
    ready = b"HELLO ACK EMCNETSVR 1.1\r\nESTOP OFF\r\nMACHINE ON\r\nPROGRAM_STATUS IDLE\r\n"
    assert linuxcnc.Client.told(ready, {})[0]
    fine, sentences = linuxcnc.Client.told(ready.replace(b"ESTOP OFF", b"ESTOP ON"), {})
    assert not fine
    assert "release emergency stop before a run" in sentences
    assert "password" in linuxcnc.Client.told(b"HELLO NAK\r\n", {})[1][0]


def test_what_stands_in_a_file(tmp_path):
    file = tmp_path / "TANGO.TXT"
    file.write_bytes(b"TANGO START 5AFE0001 1\r\nP1 H1 X1.0\r\nTANGO END 1\r\n")
    write_example(tmp_path / "cell", "hu40t")
    result = Result("link-test", "-C", tmp_path / "cell", "--port", f"file://{file}?from=last", "--seconds", "0.3")
    assert (result.code, "program 5AFE0001, 1 records, its end mark is there" in result.out) == (0, True)
    result = Result("link-test", "-C", tmp_path / "cell", "--port", f"file://{file}", "--seconds", "0.3")
    assert (result.code, "from=last" in result.out) == (1, True)


def test_a_control_that_was_reset_by_being_opened_is_asked_again():
    """Opening the port of a board behind USB resets it: what it was asked before its banner it has not heard."""

    class Board:
        chunk, asked = 256, b""

        def write(self, data):
            self.asked += data
            return len(data)

        def read(self, timeout):
            heard, self.asked = self.asked, b""
            if heard and not self.awake:
                self.awake = True
                return b"\r\nGrbl 1.1h ['$' for help]\r\n"
            return GRBL if heard else b""

        awake = False

    clock = iter(range(100))
    assert listen(Board(), b"$I\n", 50, lambda: next(clock), lambda got: b"VER" in got).endswith(GRBL)


PROGRAM = "%\nO7700 (TANGO)\nG31 X25. F180.\nIF[#1GT0.02]THEN#3000=81(PROBE)\nM30\n%\n"


def punched(text, parity=False):
    """The same as many controls punch it: leader, no blanks, LF CR CR, codes, a colon for O."""
    tape = "\0\0\x12" + text.replace(" ", "").replace("O7700", ":7700").replace("\n", "\n\r\r") + "\x14\0"
    return even(tape) if parity else tape.encode()


@pytest.mark.parametrize("parity", [False, True])
def test_a_program_that_the_control_punches_out_is_compared_with_the_file(parity):
    assert compared(PROGRAM, punched(PROGRAM, parity)) == (True, ["4 blocks, all of them as in the file"])


def test_two_lost_characters_that_no_parity_finds_are_found():
    fine, sentences = compared(PROGRAM, punched(PROGRAM.replace("X25.", "X5")))
    assert not fine
    assert "block 2 of 4 differs: the file has 'G31X25.F180.', the control 'G31X5F180.'" in sentences[0]


def test_a_program_of_which_a_part_is_missing_is_not_the_same():
    assert "the control 3" in compared(PROGRAM, punched(PROGRAM.replace("M30\n", "")))[1][0]
    assert "stopped punching" in compared(PROGRAM, punched(PROGRAM)[:-12])[1][0]
    assert "READ/PUNCH" in compared(PROGRAM, b"")[1][0]


def test_the_command_waits_for_the_end_of_what_the_control_punches(cell):
    (cell / "O7700.nc").write_text(PROGRAM)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            connection, _ = server.accept()
            tape = punched(PROGRAM)
            for at in range(0, len(tape), 20):
                connection.sendall(tape[at : at + 20])
            connection.recv(1)

        threading.Thread(target=serve, daemon=True).start()
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        result = Result("link-test", "-C", cell, "--port", url, "--program", cell / "O7700.nc", "--seconds", "5")
    assert (result.code, result.out) == (0, "4 blocks, all of them as in the file\n")
    assert Result("link-test", "-C", cell, "--port", "grbl+socket://127.0.0.1:1", "--program", cell / "O7700.nc").code == 2


def test_ports_are_listed(monkeypatch):
    monkeypatch.setattr("tango_cnc.link.transport.ports", lambda: [("/dev/ttyUSB0", "USB-RS232")])
    assert Result("ports").out == "/dev/ttyUSB0  USB-RS232\n"


class Slow:
    """A line that takes a byte at a time, at every second look none; the clock goes on by what is waited for."""

    def __init__(self, says):
        self.says, self.now, self.sent, self.waits, self.looks = dict(says), 0.0, b"", [], 0

    def write(self, data):
        self.looks += 1
        taken = data[: self.looks % 2]
        self.sent += taken
        return len(taken)

    def read(self, timeout):
        self.waits.append(timeout)
        self.now += timeout
        return self.says.pop(len(self.waits), b"")


def test_what_the_line_does_not_take_is_offered_again_soon_and_then_silence_is_waited_for():
    line = Slow({})
    assert listen(line, b"$I\n", 1.0, lambda: line.now) == b""
    assert line.sent == b"$I\n" and line.waits[:4] == [0.01, 0.01, 0.01, 0.01]
    assert line.waits[4:7] == [0.25, 0.25, 0.25] and line.waits[-1] < 0.25 and sum(line.waits) == pytest.approx(1.0)


def test_a_control_that_was_reset_by_being_opened_is_asked_once_more_and_enough_is_enough():
    line = Slow({6: b"Grbl 1.1h ['$' for help]\r\n", 14: b"[VER:1.1h]\r\nok\r\n"})
    got = listen(line, b"$I\n", 9.0, lambda: line.now, lambda got: got.endswith(b"ok\r\n"))
    assert line.sent == b"$I\n$I\n" and got.endswith(b"ok\r\n") and len(line.waits) == 14
    mute = Slow({2: b"Grbl 1.1h ['$' for help]\r\n"})
    assert listen(mute, b"", 0.5, lambda: mute.now).startswith(b"Grbl") and not mute.sent
