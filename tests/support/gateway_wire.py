"""The gateway of `gateway` behind real frames: Modbus TCP and Modbus RTU, written from the standard, spoken to by pymodbus.

(Modbus Application Protocol V1.1b3; Modbus over Serial Line V1.02.) `Near` answers in the process of the computer, `Far` over a
socket or a pseudo-terminal. What the gateway does with time stays virtual; an answer that it loses comes late now and then, with
the number of its own request over TCP, and as it is over RTU. `Near` also cuts frames anywhere, joins them, turns a bit of a
frame (RTU, which has check sums) and closes connections (TCP).
"""

from __future__ import annotations

import array
import contextlib
import fcntl
import itertools
import os
import select
import socket
import struct
import termios
import threading
import tty
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import pymodbus.client
import pymodbus.client.tcp

from support import gateway
from tango_cnc.link.protocols import modbus
from tango_cnc.link.transport import _modbus, open_port, parse

ONLY_NOW = SimpleNamespace(select=lambda read, write, other, timeout=None: select.select(read, write, other, 0.0))


def _shifted(value: int) -> int:
    """byte → what its eight bits leave of the polynomial."""
    for _ in range(8):
        value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return value


SHIFTED = [_shifted(byte) for byte in range(256)]


def crc(data: bytes) -> bytes:
    """frame → its check sum, low byte first."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ SHIFTED[(value ^ byte) & 0xFF]
    return struct.pack("<H", value)


class Wire(gateway.Gateway):
    """A gateway that understands frames."""

    kind = "tcp"
    frames = 0  # in all of this class

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._late: list[tuple[bytes, bytes]] = []

    def answers(self, got: bytes) -> tuple[list[bytes], bytes]:
        """what has come → the frames that go back, the rest that is no whole frame yet."""
        said: list[bytes] = []
        while frame := self._first(got):
            got = got[len(frame) :]
            if self.kind == "tcp":
                for head, data in self._said(frame[:2], frame[7:]):
                    said.append(head + b"\0\0" + struct.pack(">HB", len(data) + 1, 1) + data)
            elif crc(frame[:-2]) == frame[-2:]:
                said += [b"\1" + data + crc(b"\1" + data) for _, data in self._said(b"", frame[1:-2])]
            else:
                return said, b""  # the pause behind it ends a frame, whatever its length said
        return said, got

    def _first(self, got: bytes) -> bytes:
        """bytes → the frame that they begin with, empty when it is not whole."""
        if self.kind == "tcp":
            size = 6 + struct.unpack(">H", got[4:6])[0] if len(got) >= 7 else 7
        else:
            size = 8 if len(got) < 8 or got[1] != 16 else 9 + got[6]
        return got[:size] if len(got) >= size else b""

    def _said(self, head: bytes, request: bytes) -> list[tuple[bytes, bytes]]:
        """number of the request, its function and data → the answers that go back now, late ones of before first."""
        type(self).frames += 1
        code, at, count = struct.unpack(">BHH", request[:5])
        words = struct.unpack(f">{count}H", request[6 : 6 + 2 * count]) if code == 16 else (count,)
        answer = self.ask(" ".join(map(str, (code, at, *words))))
        late, self._late = self._late, []
        if answer.startswith("-"):
            if self.chance.random() < 0.5:  # it comes with the next one
                self._late = [(head, self._data(self._answered([code, at, *words]) if code == 3 else f"16 {at} {count}"))]
            return []
        return [*late, (head, self._data(answer))]

    @staticmethod
    def _data(answer: str) -> bytes:
        code, *rest = map(int, answer.split())
        if code == 16:
            return struct.pack(">BHH", 16, *rest)
        return struct.pack(f">BB{len(rest)}H", 3, 2 * len(rest), *rest)


@dataclass
class WireRun(gateway.Run):
    """A computer whose requests go through pymodbus."""

    line: Any = None

    def answer(self, gateway: Any, request: bytes) -> bytes:
        if self.line is None:
            self.line = open_port(parse(gateway.url, modbus.OPTIONS))
        self.line.write(request)
        return bytes(self.line.read(0.0))

    def gone(self) -> None:
        if self.line is not None:
            self.line.close()
            self.line = None


class Near(Wire):
    """A gateway in the process of the computer: what is written is answered before the write returns, and nobody ever waits."""

    KINDS = (*gateway.Gateway.KINDS, "frame in pieces", "frame spoilt", "connection closed")
    known: ClassVar[dict[str, Near]] = {}
    numbers: ClassVar[Any] = itertools.count(20_000)

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.name = str(next(self.numbers))
        self.known[self.name] = self
        self.url = f"modbus+{self.kind}://{'127.0.0.1:' if self.kind == 'tcp' else 'near'}{self.name}/1"

    def close(self) -> None:
        self.known.pop(self.name)

    def came(self, data: bytes) -> list[bytes] | None:
        """frame of the computer → pieces that come back; None when the connection is closed."""
        if self.kind == "tcp":
            if self._now("connection closed"):
                if self.chance.random() < 0.5:
                    self.answers(data)
                return None
            said, _ = self.answers(data)
        else:
            said = [self._spoilt(one) for one in self.answers(self._spoilt(data))[0]]
        if self._now("frame in pieces"):
            joined = self.chance.random() < 0.5
            return [piece for one in ([b"".join(said)] if joined else said) for piece in self._pieces(one)]
        return [*filter(None, said)]

    def _spoilt(self, frame: bytes) -> bytes:
        if not self._now("frame spoilt"):
            return frame
        at = self.chance.randrange(len(frame))
        if self.chance.random() < 0.5:
            return frame[:at] + frame[at + 1 :]
        return frame[:at] + bytes([frame[at] ^ 1 << self.chance.randrange(8)]) + frame[at + 1 :]

    def _pieces(self, frame: bytes) -> list[bytes]:
        at = self.chance.randrange(len(frame) + 1)
        return [piece for piece in (frame[:at], frame[at:]) if piece]


class Line:
    """What pymodbus takes for its socket or its serial port: each piece that comes back is read by itself."""

    def __init__(self, gateway: Near) -> None:
        self._gateway = gateway
        self._ours, self._theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for end in (self._ours, self._theirs):
            end.setblocking(False)

    def send(self, data: bytes) -> int:
        pieces = self._gateway.came(bytes(data))
        if pieces is None:
            self._theirs.close()
        for piece in pieces or ():
            self._theirs.send(piece)
        return len(data)

    write = send

    def fileno(self) -> int:
        return self._ours.fileno()

    def setblocking(self, flag: bool) -> None:
        pass

    def recv(self, most: int) -> bytes:
        return self._ours.recv(most)

    @property
    def in_waiting(self) -> int:
        size = array.array("i", [0])
        fcntl.ioctl(self._ours.fileno(), termios.FIONREAD, size)
        return size[0]

    def read(self, count: int) -> bytes:
        got = b""
        while len(got) < count:
            if not (more := self._ours.recv(count - len(got))):
                raise ConnectionError("the other end of the line is closed")
            got += more
        return got

    def close(self) -> None:
        self._ours.close()
        self._theirs.close()


class _Here:
    """Mixed into the clients of pymodbus: connects to a gateway of this process."""

    def connect(self) -> bool:
        if not self.socket:  # type: ignore[has-type]
            host, port = self.comm_params.host, self.comm_params.port  # type: ignore[attr-defined]
            self.socket = Line(Near.known[str(port) if host == "127.0.0.1" else host.removeprefix("near")])
        return True


class TcpHere(_Here, pymodbus.client.ModbusTcpClient):
    """Frames of Modbus TCP, without a network."""


class SerialHere(_Here, pymodbus.client.ModbusSerialClient):
    """Frames of Modbus RTU, without a port."""


def near(monkeypatch: Any, kind: str) -> None:
    """kind → gateways are `Near` of that kind; who waits for an answer finds at once that there is none."""
    monkeypatch.setattr(Near, "kind", kind)
    monkeypatch.setattr(Near, "frames", 0)
    monkeypatch.setattr(pymodbus.client, "ModbusTcpClient", TcpHere)
    monkeypatch.setattr(pymodbus.client, "ModbusSerialClient", SerialHere)
    monkeypatch.setattr(pymodbus.client.tcp, "select", ONLY_NOW)
    monkeypatch.setattr(_modbus, "select", ONLY_NOW)
    monkeypatch.setattr(_modbus, "time", SimpleNamespace(sleep=lambda seconds: None))  # even no time at all gives the core away


class Far(Wire):
    """A gateway that listens on a socket or on a pseudo-terminal, in threads of its own."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._lock = threading.Lock()
        if self.kind == "tcp":
            self._door = socket.create_server(("127.0.0.1", 0))
            self.url = f"modbus+tcp://127.0.0.1:{self._door.getsockname()[1]}/1"
            threading.Thread(target=self._listen, daemon=True).start()
        else:
            self._ours, self._theirs = os.openpty()
            tty.setraw(self._theirs)
            self.url = f"modbus+rtu://{os.ttyname(self._theirs)}/1"
            threading.Thread(target=self._serve, args=(self._read, self._write), daemon=True).start()

    def wait(self, seconds: float) -> None:
        with self._lock:
            super().wait(seconds)

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                line = self._door.accept()[0]
                threading.Thread(target=self._serve, args=(lambda: line.recv(4096), line.sendall), daemon=True).start()  # noqa: B023

    def _read(self) -> bytes:
        return os.read(self._ours, 4096)

    def _write(self, data: bytes) -> None:
        os.write(self._ours, data)

    def _serve(self, read: Any, write: Any) -> None:
        with contextlib.suppress(OSError, struct.error):
            got = b""
            while data := read():
                with self._lock:
                    said, got = self.answers(got + data)
                for frame in said:
                    write(frame)

    def close(self) -> None:
        """Nobody listens any more."""
        if self.kind == "tcp":
            self._door.close()
            return
        for handle in (self._ours, self._theirs):
            with contextlib.suppress(OSError):
                os.close(handle)
