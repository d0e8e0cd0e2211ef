"""Bytes to and from a port named by a URL: the only importer of serial and socket.

    serial:///dev/ttyUSB0?baud=9600&bits=7&parity=even&stop=2&flow=xonxoff      serial://COM3?baud=4800
    /dev/ttyUSB0, COM3, /dev/pts/4       the same with what DEFAULTS says
    socket://192.168.1.20:8193           TCP, also of a serial-to-Ethernet converter in raw mode
    rfc2217://192.168.1.20:2217?baud=…   a converter that lets the line be set from here

Everything after `?` that is not of the line is handed to the protocol client. Behind socket:// and a pty the settings of the
line are somebody else's; stated all the same, `baud` slows the sending down to that rate and `parity` is added and checked here.
Found out by others: a readline returns half a
line at the timeout, an unplugged port still says it is open, two programs may open one port unless both ask for exclusive,
and drivers deliver bytes of wrong parity without a word. Here reads return what there is, every error of the system means
that the line is lost, serial ports are locked twice, and a character of wrong parity arrives as SUB, which no client takes.
"""

from __future__ import annotations

import contextlib
import os
import re
import select
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol
from urllib.parse import parse_qsl, urlsplit

import serial
from serial.tools import list_ports

from ..records import InputError, LinkError
from ._wire import Paced, Parity, unmarked

SLICE = 0.05  # s, the longest wait inside a port that cannot be waited for together with others
PATIENCE = 5.0  # s, to open a TCP connection

LINE: Mapping[str, tuple[str, ...]] = {
    "baud": ("9600", "110", "300", "600", "1200", "2400", "4800", "19200", "38400", "57600", "115200"),
    "bits": ("8", "7"),
    "parity": ("none", "even", "odd"),
    "stop": ("1", "2"),
    "flow": ("none", "xonxoff", "rtscts"),
    "exclusive": ("yes", "no"),
}
DEFAULTS = {name: allowed[0] for name, allowed in LINE.items()}
PTY = ("/dev/pts/", "/dev/ttyp")


class Lost(LinkError):
    """The line is gone: unplugged, closed by the other side, or broken."""


@dataclass(frozen=True)
class Address:
    """A port's URL taken apart: what to open, the settings of the line, and what the protocol client is told."""

    url: str
    scheme: str  # serial, socket, rfc2217
    target: str  # device, or host:port
    line: Mapping[str, str] = field(default_factory=dict)
    uart: bool = True  # somebody keeps to the settings of the line: a driver, a converter
    options: Mapping[str, str] = field(default_factory=dict)


class Transport(Protocol):
    """Bytes there and back."""

    chunk: int  # bytes that may be on their way when the other side says stop

    def read(self, timeout: float) -> bytes:
        """s → what has arrived, at once when there is something, empty after the timeout. Raises Lost."""

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took, without waiting. Raises Lost."""

    def close(self) -> None:
        """Gives the port back."""


def parse(url: str, options: Mapping[str, tuple[str, ...]]) -> Address:
    """URL or device, {option of the client: allowed values} → address. Raises InputError for what it cannot mean."""
    if "://" not in url:
        url_split, scheme, target = urlsplit(""), "serial", url
    else:
        url_split = urlsplit(url)
        scheme, target = url_split.scheme.lower(), url_split.netloc + (url_split.path if url_split.scheme == "serial" else "")
    if scheme not in ("serial", "socket", "rfc2217"):
        raise InputError(f"port {url!r}: found scheme {scheme!r}; allowed: serial://, socket://, rfc2217:// or a device path")
    if scheme == "serial" and not target:
        raise InputError(f"port {url!r}: no device; e.g. serial:///dev/ttyUSB0?baud=9600&flow=xonxoff or COM3")
    if scheme != "serial" and not re.fullmatch(r"(\[[0-9A-Fa-f:.]+\]|[^:\[\]@/]+):\d{1,5}", target):
        raise InputError(f"port {url!r}: found {target!r}; allowed: host:port, e.g. {scheme}://192.168.1.20:8193")
    uart = scheme != "socket" and not target.startswith(PTY)
    line: dict[str, str] = {}
    told: dict[str, str] = {}
    known: dict[str, tuple[str, ...]] = {**LINE, **options}
    for name, text in parse_qsl(url_split.query, keep_blank_values=True):
        value = text or "yes" if name == "exclusive" else text
        if name not in known:
            raise InputError(f"port {url!r}: found the unknown setting {name!r}; allowed: {', '.join(known)}")
        if value not in known[name] and not (name == "baud" and value.isdecimal() and int(value) > 0):
            raise InputError(f"port {url!r}: {name}: found {value!r}; allowed: {', '.join(known[name])}")
        if name in LINE:
            line[name] = value
        if name in options:
            told[name] = value
    if line.get("parity", "none") != "none" and line.get("bits") != "7" and not uart:
        raise InputError(
            f"port {url!r}: found parity without bits=7; allowed here: bits=7&parity=…, as nobody else adds the parity"
        )
    return Address(url, scheme, target, {**DEFAULTS, **line} if uart else line, uart, told)


def ports() -> list[tuple[str, str]]:
    """→ (device, description) of the serial ports of this computer."""
    return sorted((str(port.device), str(port.description)) for port in list_ports.comports())


def open_port(address: Address) -> Transport:
    """address → open transport. Raises LinkError saying what did not open, which ports there are and what to do."""
    try:
        port: Transport = _Tcp(address) if address.scheme == "socket" else _Port(address)
    except (OSError, ValueError, serial.SerialException) as error:  # SerialException is an OSError; ValueError: baud rates
        raise LinkError(f"port {address.url} does not open: {_reason(error)}. {_advice(address, error)}") from None
    if not address.uart and "baud" in address.line:
        characters = int(address.line["baud"]) / (
            2 + int(address.line.get("bits", "8")) + (address.line.get("parity", "none") != "none")
        )
        port = Paced(port, characters, time.monotonic)
    if not address.uart and address.line.get("parity", "none") != "none":
        port = Parity(port, address.line["parity"] == "odd")
    return port


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if isinstance(error, TimeoutError):
        return f"no answer within {PATIENCE:.0f} s"
    return os.strerror(number) if isinstance(number, int) and number > 0 else str(error)


def _advice(address: Address, error: Exception) -> str:
    if address.scheme != "serial":
        return "Is the controller or converter switched on, the address right, and no other program connected to it?"
    busy = getattr(error, "errno", None) in (11, 16, 35) or "lock" in str(error)
    there = ", ".join(f"{device} ({text})" for device, text in ports()) or "none"
    step = "Another program has it open: close that one" if busy else "Check the cable, the name and your permission to use it"
    return f"Serial ports of this computer: {there}. {step}."


class _Tcp:
    """A TCP connection; what the other side says at once after accepting is not lost."""

    chunk = 256

    def __init__(self, address: Address) -> None:
        parts = urlsplit(address.url)
        self._socket = socket.create_connection((parts.hostname or "", parts.port or 0), timeout=PATIENCE)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._socket.setblocking(False)

    def read(self, timeout: float) -> bytes:
        """s → what has arrived, at once when there is something, empty after the timeout. Raises Lost."""
        try:
            if not select.select([self._socket], [], [], timeout)[0]:
                return b""
            data = self._socket.recv(4096)
        except OSError as error:
            raise Lost(f"the connection broke: {_reason(error)}") from None
        if not data:
            raise Lost("the other side closed the connection")
        return data

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took, without waiting. Raises Lost."""
        try:
            return self._socket.send(data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Lost(f"the connection broke: {_reason(error)}") from None

    def close(self) -> None:
        """Gives the port back."""
        self._socket.close()


class _Port:
    """A serial port, a pty or an RFC 2217 converter through pyserial."""

    def __init__(self, address: Address) -> None:
        line = address.line if address.uart else {**DEFAULTS, **address.line, "bits": "8", "parity": "none"}
        self.chunk = max(32, int(line["baud"]) // 500)  # 20 ms
        self._local = address.scheme == "serial"
        self._posix = self._local and os.name == "posix"  # then the descriptor is waited for and written to directly
        settings: dict[str, Any] = {
            "baudrate": int(line["baud"]),
            "bytesize": int(line["bits"]),
            "parity": line["parity"][0].upper(),
            "stopbits": int(line["stop"]),
            "rtscts": line["flow"] == "rtscts",
            "timeout": SLICE,
        }
        if self._local:
            settings["write_timeout"] = 0
        if self._local and line["exclusive"] == "yes":
            settings["exclusive"] = True
        self._port = serial.serial_for_url(address.target if self._local else f"rfc2217://{address.target}", **settings)
        # Switched on at the first write: until then DC1 is for the client to see. A driver would not know DC3 with a parity bit.
        self._flow = line["flow"] == "xonxoff" and (address.uart or address.line.get("parity", "none") == "none")
        self._marked = self._posix and line["parity"] != "none"
        self._rest = b""
        if self._posix:
            self._settle(lock=line["exclusive"] == "yes" and address.uart)

    def _settle(self, lock: bool = False) -> None:
        """What pyserial leaves out on POSIX: bad parity is marked; the kernel refuses other openers (a pty would remember it)."""
        import fcntl
        import termios

        if lock:
            fcntl.ioctl(self._port.fileno(), termios.TIOCEXCL)
        if self._marked:
            mode = termios.tcgetattr(self._port.fileno())
            mode[0] = (mode[0] | termios.INPCK | termios.PARMRK) & ~(termios.IGNPAR | termios.ISTRIP)
            termios.tcsetattr(self._port.fileno(), termios.TCSANOW, mode)

    def read(self, timeout: float) -> bytes:
        """s → what has arrived, at once when there is something, empty after the timeout. Raises Lost."""
        try:
            data = self._arrived(timeout)
        except OSError as error:
            raise Lost(f"the port is gone: {_reason(error)}") from None
        if self._marked:
            data, self._rest = unmarked(self._rest + data)
        return data

    def _arrived(self, timeout: float) -> bytes:
        if self._posix:
            if not select.select([self._port.fileno()], [], [], timeout)[0]:
                return b""
            data = os.read(self._port.fileno(), 4096)
            if not data:
                raise OSError("it is ready to be read but nothing is there")
            return data
        until = time.monotonic() + timeout
        while True:
            data = bytes(self._port.read(max(1, self._port.in_waiting)))
            if data or time.monotonic() >= until:
                return data

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took, without waiting. Raises Lost."""
        try:
            if self._flow:
                self._port.xonxoff, self._flow = True, False
                if self._posix:
                    self._settle()
            if self._local and self._port.out_waiting > 0:
                return 0
            piece = data[: self.chunk]
            return os.write(self._port.fileno(), piece) if self._posix else int(self._port.write(piece) or 0)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Lost(f"the port is gone: {_reason(error)}") from None

    def close(self) -> None:
        """Gives the port back; what the control did not take is thrown away, it must not follow later."""
        with contextlib.suppress(Exception):  # an unplugged port fails in ways of its own, and there is nothing left to lose
            self._port.reset_output_buffer()
        with contextlib.suppress(Exception):
            self._port.close()
