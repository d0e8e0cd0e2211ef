"""Ports by URL, over the real thing where a test computer has it: a pty, a TCP socket, an RFC 2217 server."""

import os
import socket
import sys
import threading
import time

import pytest

from tango_cnc.link import transport
from tango_cnc.link.protocols import dnc
from tango_cnc.link.transport import Lost, open_port, parse
from tango_cnc.link.ways import ways
from tango_cnc.link.wire import Paced, unmarked
from tango_cnc.records import InputError, LinkError

posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")


def opened(url):
    return open_port(parse(url, dnc.OPTIONS))


@pytest.fixture
def pty():
    """(the control's end, the name of ours)"""
    controller, ours = os.openpty()
    name = os.ttyname(ours)
    os.close(ours)
    yield controller, name
    os.close(controller)


def test_a_new_way_is_one_file(tmp_path, monkeypatch):
    """A file of transport/ is enough: its way is known, its URL is checked by what it declares, and it alone opens it."""
    (tmp_path / "_toy.py").write_text(
        "from tango_cnc.link.ways import Way\nWAYS = {\n  'toy': Way(lambda address: ('toy', address.target), 'host'),\n"
        "  'tally': Way(lambda address: open(address.target), 'path', path=True, example='tally:///run/tally.sock'),\n"
        "  'drum': Way(lambda address: open(address.target), 'path', path=True, advice='Start the drum'),\n}\n"
    )
    monkeypatch.setattr(transport, "__path__", [*transport.__path__, str(tmp_path)])
    monkeypatch.setattr("tango_cnc.link.address.schemes", lambda: {n: ("dnc", n) for n in ("toy", "tally", "drum")})
    monkeypatch.setattr("tango_cnc.link.address.ways", ways.__wrapped__)
    monkeypatch.setattr("tango_cnc.link.transport.ways", ways.__wrapped__)
    monkeypatch.delitem(sys.modules, "tango_cnc.link.transport._toy", raising=False)
    assert opened("toy://127.0.0.1:5000") == ("toy", "127.0.0.1:5000")
    with pytest.raises(InputError, match="allowed: host:port"):
        opened("toy://nonsense")
    with pytest.raises(InputError, match="parity without bits=7"):
        opened("toy://127.0.0.1:5000?parity=even")
    with pytest.raises(InputError, match=r"no path; e\.g\. tally:///run/tally\.sock"):
        opened("tally://")
    with pytest.raises(LinkError, match=f"Is what stands at {tmp_path}/none there") as error:
        opened(f"tally://{tmp_path}/none")
    assert "Serial ports" not in str(error.value)
    with pytest.raises(LinkError, match="Start the drum"):
        opened(f"drum://{tmp_path}/none")


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_a_url_says_device_line_and_options_of_the_client():
    address = parse("serial:///dev/ttyUSB0?baud=4800&parity=even&bits=7&stop=2&flow=xonxoff&exclusive&start=xon", dnc.OPTIONS)
    assert address.target == "/dev/ttyUSB0"
    assert address.line == {"baud": "4800", "bits": "7", "parity": "even", "stop": "2", "flow": "xonxoff", "exclusive": "yes"}
    assert address.options == {"bits": "7", "start": "xon"}


@pytest.mark.parametrize(
    ("url", "scheme", "target"),
    [
        ("/dev/pts/4", "serial", "/dev/pts/4"),
        ("COM3", "serial", "COM3"),
        ("/dev/serial/by-path/pci-0:1:2", "serial", "/dev/serial/by-path/pci-0:1:2"),
        ("serial://COM3?baud=4800", "serial", "COM3"),
        ("socket://127.0.0.1:8193", "socket", "127.0.0.1:8193"),
        ("socket://[::1]:8193", "socket", "[::1]:8193"),
        ("rfc2217://box:2217?baud=4800", "rfc2217", "box:2217"),
    ],
)
def test_ports_have_many_names(url, scheme, target):
    address = parse(url, dnc.OPTIONS)
    assert (address.scheme, address.target) == (scheme, target)


@pytest.mark.parametrize(
    ("url", "found"),
    [
        ("http://host:80", "http"),
        ("sockets://host:80", "Did you mean 'socket'"),
        ("tcp://host:80", "Did you mean 'socket'"),
        ("modbus+tcp://host:502", "found no device number; allowed: 0 … 247"),
        ("modbus+tcp://host:502/300", "found device '300'; allowed: 0 … 247"),
        ("socket://host", "host:port"),
        ("socket://host:65536", "65535"),
        ("socket://host:0", "65535"),
        ("serial://", "no device"),
        ("", "no device"),
        ("/dev/ttyS0?baud=9600", "neither a device nor a URL"),
        ("/mnt/cnc/tango-readings.txt", "e.g. file:///mnt/cnc/tango-readings.txt"),
        ("tango-readings.txt", "e.g. file:///mnt/control/tango-readings.txt"),
        ("Z:\\my cnc\\TANGO.TXT", "e.g. file://Z:/my%20cnc/TANGO.TXT"),
        (r"\\CNC\share\TANGO.TXT", "e.g. file:////CNC/share/TANGO.TXT"),
        ("file:tango-readings.txt", "e.g. file:///mnt/control/tango-readings.txt"),
        ("file://tango-readings.txt", "allowed: the whole path of the file, e.g. file:///mnt/control/tango-readings.txt"),
        ("127.0.0.1:8193", "Perhaps you mean socket://127.0.0.1:8193$"),
        ("socket//127.0.0.1:8193", "neither a device nor a URL"),
        ("socket:/127.0.0.1:8193", "neither a device nor a URL"),
        ("serial:///dev/ttyS0?speed=9600", "'speed'"),
        ("serial:///dev/ttyS0?parity=gerade", "'gerade'"),
        ("serial:///dev/ttyS0?baud=fast", "'fast'"),
        ("serial:///dev/ttyS0?bits=5", "'5'"),
        ("socket://127.0.0.1:8193?parity=even", "parity without bits=7"),
    ],
)
def test_a_url_that_means_nothing_is_refused(url, found):
    with pytest.raises(InputError, match=found):
        parse(url, dnc.OPTIONS)


def test_a_port_that_does_not_open_says_which_ones_there_are_and_what_to_do():
    with pytest.raises(
        LinkError, match=r"/dev/nowhere does not open: No such file.* Serial ports of this computer: .* Check the cable"
    ):
        opened("/dev/nowhere")


def test_nobody_listening(listener):
    port = listener.getsockname()[1]
    listener.close()
    with pytest.raises(LinkError, match=r"Connection refused.* switched on"):
        opened(f"socket://127.0.0.1:{port}")


@posix
def test_a_pty_carries_bytes_both_ways(pty):
    controller, name = pty
    line = opened(name)
    everything = bytes(range(256))
    sent, got = 0, b""
    while sent < len(everything):
        sent += line.write(everything[sent:])
    while len(got) < len(everything):
        got += os.read(controller, 1000)
    assert got == everything
    os.write(controller, everything)
    got = b""
    while len(got) < 256:
        got += line.read(1.0)
    assert got == everything
    assert line.read(0.0) == b""
    line.close()


@posix
def test_a_second_opener_is_refused(pty):
    _, name = pty
    first = opened(name)
    with pytest.raises(LinkError, match="Another program has it open"):
        opened(name)
    first.close()
    opened(name).close()


@posix
def test_a_device_that_vanishes_is_noticed(pty):
    controller, ours = os.openpty()
    name = os.ttyname(ours)
    line = opened(name)
    os.close(ours)
    os.close(controller)
    with pytest.raises(Lost, match="the port is gone"):
        line.read(0.5)
    line.close()


def until(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, "it has not happened"
        time.sleep(0.02)


@posix
def test_a_pty_that_nobody_reads_takes_no_more_bytes_and_does_not_block(pty):
    _, name = pty
    line = opened(name)
    before = time.monotonic()
    taken = [line.write(b"x" * 64) for _ in range(5000)]
    assert taken[0] > 0
    assert taken[-1] == 0
    assert time.monotonic() - before < 60  # waiting for somebody who reads would have no end
    line.close()


@posix
def test_the_driver_takes_over_flow_control_with_the_first_byte_sent(pty):
    """Until then the control's DC1 is for the client, which may be waiting for it."""
    import termios

    controller, name = pty
    line = opened(f"serial://{name}?flow=xonxoff")

    def input_flags():
        return termios.tcgetattr(line._port.fileno())[0]

    os.write(controller, b"\x11")
    assert line.read(1.0) == b"\x11"
    line.write(b"%\n")
    assert input_flags() & termios.IXON
    os.write(controller, b"\x13")
    until(lambda: line.write(b"O0001\n") == 0)  # the driver holds it, once it has heard of it
    os.write(controller, b"\x11")
    until(lambda: line.write(b"O0001\n") == 6)
    line.close()


@posix
def test_a_serial_port_marks_bytes_of_wrong_parity(pty, monkeypatch):
    """A pty stands in for the port: the driver's flags can be seen on it, though it never finds a parity wrong."""
    import termios

    _, name = pty
    monkeypatch.setattr("tango_cnc.link.address.PTY", ("nothing",))
    line = opened(f"serial://{name}?parity=even&bits=7&exclusive=no&flow=xonxoff")
    line.write(b"%")
    flags = termios.tcgetattr(line._port.fileno())[0]
    assert flags & termios.INPCK
    assert flags & termios.PARMRK
    assert not flags & (termios.IGNPAR | termios.ISTRIP)
    line.close()


@posix
def test_a_pty_carries_the_parity_that_its_url_states(pty):
    controller, name = pty
    line = opened(f"serial://{name}?bits=7&parity=even")
    line.write(b"%\nO1")
    assert os.read(controller, 100) == b"\xa5\n\xcf\xb1"
    os.write(controller, b"\xd8\xb1\x31\n")
    assert line.read(1.0) == b"X1\x1a\n"
    line.close()


def test_pace_is_that_of_a_uart():
    class Pipe:
        chunk, taken = 256, 0

        def write(self, data):
            self.taken += len(data)
            return len(data)

    pipe, now = Pipe(), [100.0]
    line = Paced(pipe, 960.0, lambda: now[0])
    for _ in range(1000):
        while line.write(b"x" * 64):
            pass
        now[0] += 0.001
    assert 960 + 17 <= pipe.taken <= 960 + 19, "a byte is there when its last bit is"


def test_bytes_of_wrong_parity_are_marked():
    assert unmarked(b"X1\xff\x002.5\xff\xff") == (b"X1\x1a.5\xff", b"")
    assert unmarked(b"X1\xff") == (b"X1", b"\xff")
    assert unmarked(b"X1\xff\x00") == (b"X1", b"\xff\x00")


def test_tcp_keeps_what_the_control_says_on_accepting(listener):
    line = opened(f"socket://127.0.0.1:{listener.getsockname()[1]}")
    control, _ = listener.accept()
    control.sendall(b"\x11")
    time.sleep(0.05)
    assert line.read(1.0) == b"\x11"
    assert line.write(b"%\n") == 2
    assert control.recv(10) == b"%\n"
    control.close()
    with pytest.raises(Lost, match="closed the connection"):
        line.read(1.0)
    line.close()


def test_tcp_that_nobody_reads_takes_no_more_bytes_and_does_not_block(listener):
    line = opened(f"socket://127.0.0.1:{listener.getsockname()[1]}")
    control, _ = listener.accept()
    for _ in range(200000):
        if line.write(b"x" * 4096) == 0:
            break
    else:
        pytest.fail("the line took everything")
    control.close()
    line.close()


class Echo:
    """The serial port behind the converter: what is written comes back."""

    def __init__(self):
        self.baudrate, self.bytesize, self.parity, self.stopbits = 9600, 8, "N", 1
        self.xonxoff = self.rtscts = self.rts = self.dtr = self.cts = self.dsr = self.ri = self.cd = False
        self.break_condition = False

    def reset_input_buffer(self):
        pass

    def reset_output_buffer(self):
        pass


@pytest.mark.few(0)
@pytest.mark.filterwarnings("ignore::DeprecationWarning:serial")
def test_rfc2217_sets_the_line_of_the_converter(listener):
    from serial import rfc2217

    behind = Echo()

    def serve():
        connection, _ = listener.accept()

        class Wire:
            def write(self, data):
                connection.sendall(data)

        manager = rfc2217.PortManager(behind, Wire())
        while data := connection.recv(1024):
            for byte in manager.filter(data):
                connection.sendall(b"".join(manager.escape(byte)))

    server = threading.Thread(target=serve, daemon=True)
    server.start()
    line = opened(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}?baud=4800&bits=7&parity=even&stop=2")
    assert (behind.baudrate, behind.bytesize, behind.parity, behind.stopbits) == (4800, 7, "E", 2)
    assert line.read(0.0) == b""
    line.write(b"O0001\n")
    got = b""
    end = time.monotonic() + 60
    while len(got) < 6 and time.monotonic() < end:
        got += line.read(0.2)
    assert got == b"O0001\n"
    line.close()
    server.join(2)


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("socket://h:1?listen=no&listen=auto", "'listen' more than once"),
        ("file:///cell/machine.yaml", "no control may write"),
        ("file:///cell/readings.csv", "no control may write"),
    ],
)
def test_a_port_that_contradicts_itself_or_names_a_file_of_ours_is_refused(url, why):
    with pytest.raises(InputError, match=why):
        parse(url, {"listen": ("auto", "no"), "from": ("now", "last")})
