"""Bytes to and from a port named by a URL: the only importer of serial, socket and pymodbus.

    serial:///dev/ttyUSB0?baud=9600&bits=7&parity=even&stop=2&flow=xonxoff      serial://COM3?baud=4800
    /dev/ttyUSB0, COM3, /dev/pts/4       the same with what DEFAULTS says
    socket://192.168.1.20:8193           TCP, also of a serial-to-Ethernet converter in raw mode
    rfc2217://192.168.1.20:2217?baud=…   a converter that lets the line be set from here
    modbus+tcp://192.168.1.20:502/1      modbus+rtu:///dev/ttyUSB0/1?baud=19200      requests and answers of device 1, in words

Everything after `?` that is not of the line is handed to the protocol client. Behind socket:// and a pty the settings of the
line are somebody else's; stated all the same, `baud` slows the sending down to that rate and `parity` is added and checked here.
Found out by others: a readline returns half a
line at the timeout, an unplugged port still says it is open, two programs may open one port unless both ask for exclusive,
and drivers deliver bytes of wrong parity without a word. Here reads return what there is, every error of the system means
that the line is lost, serial ports are locked twice, and a character of wrong parity arrives as SUB, which no client takes.
"""

from __future__ import annotations

import contextlib
import logging
import os
import select
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

import serial
from serial.tools import list_ports

from ..records import LinkError
from ._address import DEFAULTS, Address
from ._address import parse as parse
from ._wire import Paced, Parity, unmarked

SLICE = 0.05  # s, the longest wait inside a port that cannot be waited for together with others
PATIENCE = 5.0  # s, to open a TCP connection
ANSWER = 1.0  # s that a Modbus device may take to answer
REST = 0.002  # s from one Modbus request to the same one again


class Lost(LinkError):
    """The line is gone: unplugged, closed by the other side, or broken."""


class Transport(Protocol):
    """Bytes there and back."""

    chunk: int  # bytes that may be on their way when the other side says stop

    def read(self, timeout: float) -> bytes:
        """s → what has arrived, at once when there is something, empty after the timeout. Raises Lost."""

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took, without waiting. Raises Lost."""

    def close(self) -> None:
        """Gives the port back."""


def ports() -> list[tuple[str, str]]:
    """→ (device, description) of the serial ports of this computer."""
    return sorted((str(port.device), str(port.description)) for port in list_ports.comports())


def open_port(address: Address) -> Transport:
    """address → open transport. Raises LinkError saying what did not open, which ports there are and what to do."""
    try:
        port: Transport = OPENERS.get(address.scheme, _Port)(address)
    except (OSError, ValueError, serial.SerialException) as error:  # SerialException is an OSError; ValueError: baud rates
        raise LinkError(f"port {address.url} does not open: {_reason(error)}. {_advice(address, error)}") from None
    if address.scheme in ("tcp", "rtu"):
        return port
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
    if address.scheme not in ("serial", "rtu"):
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


class _Modbus:
    """Requests and answers in words (`modbus.py`), made by pymodbus: one at a time, never repeated, never mixed up.

    pymodbus hands the late answer to one request out as the answer to the next: over RTU nothing in it says which one it
    answers. After a silence the line is therefore drained until nothing has come for as long as an answer may take (RTU), or
    opened anew (TCP), and every answer is compared with its request. Whatever passes all that is found by the sequence.
    """

    chunk = 1024

    def __init__(self, address: Address) -> None:
        import pymodbus
        from pymodbus.client import ModbusSerialClient, ModbusTcpClient

        pymodbus.pymodbus_apply_logging_config(logging.CRITICAL)
        self._unit, self._request, self._before = address.unit, b"", b""
        self._client: Any
        if address.scheme == "tcp":
            parts = urlsplit(f"//{address.target}")
            self._client = ModbusTcpClient(parts.hostname or "", port=parts.port or 0, timeout=ANSWER, retries=0)
        else:
            line = address.line if address.uart else {**DEFAULTS, **address.line, "bits": "8", "parity": "none"}
            self._client = ModbusSerialClient(
                address.target,
                baudrate=int(address.line.get("baud", "9600" if address.uart else "115200")),  # pymodbus waits in character times
                bytesize=int(line["bits"]),
                parity=line["parity"][0].upper(),
                stopbits=int(line["stop"]),
                timeout=ANSWER,
                retries=0,
            )
        self._client.set_max_no_responses(1 << 30)
        self._serial = address.scheme == "rtu"
        if self._serial and os.name == "posix":
            self._client.recv = self._arrived  # pymodbus looks every few milliseconds, twice
        if not self._client.connect():
            raise OSError(f"nothing answers at {address.target}" if not self._serial else f"{address.target} cannot be opened")

    def read(self, timeout: float) -> bytes:
        """s → the answer to the request written last; empty when there is none to answer. Raises Lost."""
        line, end, rest = self._request.partition(b"\n")
        if not end:
            time.sleep(timeout)
            return b""
        self._request = rest
        if line == self._before:  # the control is being waited for
            time.sleep(REST)
        self._before = line
        return f"{self._transact(*map(int, line.split()))}\n".encode("ascii")

    def write(self, data: bytes) -> int:
        """bytes of a request → how many of them are taken: all."""
        self._request += data
        return len(data)

    def close(self) -> None:
        """Gives the port back."""
        with contextlib.suppress(Exception):
            self._client.close()

    def _transact(self, code: int, address: int, *words: int) -> str:
        """function code, address, count or values → the answer in words. Raises Lost when the line is gone."""
        from pymodbus.exceptions import ConnectionException, ModbusException

        calls = {
            3: lambda: self._client.read_holding_registers(address, count=words[0], device_id=self._unit),
            4: lambda: self._client.read_input_registers(address, count=words[0], device_id=self._unit),
            16: lambda: self._client.write_registers(address, list(words), device_id=self._unit),
        }
        try:
            reply = calls[code]()
        except ConnectionException as error:
            raise Lost(f"the connection broke: {error}") from None
        except (ModbusException, OSError) as error:
            self._drain()
            return f"- {' '.join(str(error).split())}" if isinstance(error, ModbusException) else "- no answer"
        if reply.isError() and reply.function_code & 0x7F == code:
            return f"! {reply.exception_code}"
        said = list(reply.registers) if code != 16 else [reply.address, reply.count]
        fits = reply.function_code == code and (len(said) == words[0] if code != 16 else said == [address, len(words)])
        if fits:
            return " ".join(map(str, [code, *said]))
        self._drain()
        return "- the answer to another request"

    def _arrived(self, size: int | None) -> bytes:
        """→ the bytes that come next, empty when none come in time; pymodbus puts frames together."""
        port = self._client.socket
        return os.read(port.fileno(), 4096) if select.select([port.fileno()], [], [], ANSWER)[0] else b""

    def _drain(self) -> None:
        """Late answers come now or never. Raises Lost when a connection cannot be opened again."""
        if not self._serial:
            self._client.close()
            if not self._client.connect():
                raise Lost("the connection broke and cannot be opened again")
            return
        try:
            port = self._client.socket
            while port is not None and select.select([port.fileno()], [], [], ANSWER)[0]:
                if not os.read(port.fileno(), 4096):
                    raise OSError("it is ready to be read but nothing is there")
        except OSError as error:
            raise Lost(f"the port is gone: {_reason(error)}") from None


class _LinuxCnc(_Tcp):
    """linuxcncrsh on this computer, and the two files that it cannot carry: `put` writes the program, the log is read."""

    def __init__(self, address: Address) -> None:
        missing = [name for name in ("file", "log") if name not in address.options]
        if missing:
            raise LinkError(
                f"port {address.url}: found no {' and no '.join(missing)}; e.g. ?file=/tmp/tango.ngc&log=/tmp/tango-readings.txt"
            )
        self._file, self._log = Path(address.options["file"]), Path(address.options["log"])
        self._at, self._due, self._rest = 0, 0.0, b""
        self._answers = b""
        super().__init__(address)

    def read(self, timeout: float) -> bytes:
        """s → what linuxcncrsh answers, and new whole lines of the log with LOG in front. Raises Lost."""
        new = self._answers + self._logged()
        self._answers = b""
        return new or super().read(min(timeout, SLICE))

    def write(self, data: bytes) -> int:
        """bytes → all taken; whole lines go out, LF CR of some dialects is no line end here. Raises Lost."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if line.startswith(b"put "):
                self._put(bytes.fromhex(line.split()[2].decode("ascii")))
                continue
            time.sleep(max(0.0, self._due - time.monotonic()))  # the log and the status are looked at, not hammered
            self._due = time.monotonic() + REST
            self._socket.setblocking(True)
            try:
                self._socket.sendall(line + b"\n")
            except OSError as error:
                raise Lost(f"the connection broke: {_reason(error)}") from None
            finally:
                self._socket.setblocking(False)
        return len(data)

    def _put(self, program: bytes) -> None:
        try:
            self._file.write_bytes(program)
            self._log.unlink(missing_ok=True)
        except OSError as error:
            raise Lost(f"{error.filename}: cannot be written ({error.strerror})") from None
        self._at, self._answers = 0, b"PUT\n"

    def _logged(self) -> bytes:
        try:
            with self._log.open("rb") as log:
                log.seek(self._at)
                whole = log.read().rpartition(b"\n")
        except OSError:
            return b""
        self._at += len(whole[0] + whole[1])
        return b"".join(b"LOG %s\n" % line for line in whole[0].split(b"\n") if line.strip())


OPENERS: dict[str, Callable[[Address], Transport]] = {"socket": _Tcp, "tcp": _Modbus, "rtu": _Modbus, "rsh": _LinuxCnc}
