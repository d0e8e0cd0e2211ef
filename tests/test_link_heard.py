"""`tango link-test` and `tango ports`: what a person sees before the first run."""

import json
import socket
import threading

import pytest
from test_run import Result

from tango_cnc.commands.init import write_example
from tango_cnc.link._heard import heard, parity_of

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


def test_codes_and_records_are_counted():
    found = heard(b"\x11\x12" + RECORD.encode() + b"\x14hello\n", LETTERS)
    assert found == [
        "flow and print codes: 1 x DC1 (send), 1 x DC2 (print begins), 1 x DC4 (print ends)",
        "2 lines, 1 of them records of a TANGO program",
    ]


@pytest.fixture
def cell(tmp_path):
    write_example(tmp_path / "cell", "hu40t")
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


def test_a_silent_line_is_exit_status_1(cell):
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
        result = Result("link-test", "-C", cell, "--port", url, "--seconds", "0.1")
    assert result.code == 1
    assert "nothing came" in result.out


def test_ports_are_listed(monkeypatch):
    monkeypatch.setattr("tango_cnc.link.transport.ports", lambda: [("/dev/ttyUSB0", "USB-RS232")])
    assert Result("ports").out == "/dev/ttyUSB0  USB-RS232\n"
