"""The gateway of `gateway` behind real frames: Modbus TCP on a socket, Modbus RTU on a pseudo-terminal, written from the standard.

(Modbus Application Protocol V1.1b3; Modbus over Serial Line V1.02.) What the gateway does with time stays virtual; an answer that
it loses comes late now and then, with the number of its own request over TCP, and as it is over RTU.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import threading
import tty
from dataclasses import dataclass
from typing import Any

from support import gateway
from tango_cnc.link._client import Ended, Event, Failed, Touched
from tango_cnc.link.protocols import modbus
from tango_cnc.link.transport import Lost, open_port, parse


def crc(data: bytes) -> bytes:
    """frame → its check sum, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


class Wire(gateway.Gateway):
    """A gateway that listens on a socket or on a pseudo-terminal."""

    kind = "tcp"
    opened: list[Wire] = []  # noqa: RUF012  closed by `sessions`

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._lock, self._late, self.frames = threading.Lock(), [], 0
        self.lines: list[Any] = []
        Wire.opened.append(self)
        if self.kind == "tcp":
            self._door = socket.create_server(("127.0.0.1", 0))
            self.url = f"modbus+tcp://127.0.0.1:{self._door.getsockname()[1]}/1"
            threading.Thread(target=self._listen, daemon=True).start()
        else:
            self._ours, theirs = os.openpty()
            tty.setraw(theirs)
            self._theirs, self.url = theirs, f"modbus+rtu://{os.ttyname(theirs)}/1"
            threading.Thread(target=self._serial, daemon=True).start()

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=self._joined, args=(self._door.accept()[0],), daemon=True).start()

    def _joined(self, line: socket.socket) -> None:
        with contextlib.suppress(OSError, struct.error), line:
            got = b""
            while data := line.recv(4096):
                got += data
                while len(got) >= 7 and len(got) >= 6 + struct.unpack(">H", got[4:6])[0]:
                    size = 6 + struct.unpack(">H", got[4:6])[0]
                    frame, got = got[:size], got[size:]
                    for head, said in self._said(frame[:2], frame[7:]):
                        line.sendall(head + b"\0\0" + struct.pack(">HB", len(said) + 1, 1) + said)

    def _serial(self) -> None:
        with contextlib.suppress(OSError):
            got = b""
            while data := os.read(self._ours, 4096):
                got += data
                while len(got) >= 8:
                    size = 9 + got[6] if got[1] == 16 else 8
                    if len(got) < size:
                        break
                    frame, got = got[:size], got[size:]
                    if crc(frame[:-2]) != frame[-2:]:
                        got = b""
                        break
                    for _, said in self._said(b"", frame[1:-2]):
                        os.write(self._ours, b"\1" + said + crc(b"\1" + said))

    def _said(self, head: bytes, request: bytes) -> list[tuple[bytes, bytes]]:
        """number of the request, its function and data → the frames that go back now, late ones of before first."""
        with self._lock:
            self.frames += 1
            code, at, count = struct.unpack(">BHH", request[:5])
            words = struct.unpack(f">{count}H", request[6 : 6 + 2 * count]) if code == 16 else (count,)
            answer = self.ask(" ".join(map(str, (code, at, *words))))
            late, self._late = self._late, []
            if answer.startswith("-"):
                if self.chance.random() < 0.5:  # it comes with the next one
                    self._late = [(head, self._frame(self._answered([code, at, *words]) if code == 3 else f"16 {at} {count}"))]
                return []
            return [*late, (head, self._frame(answer))]

    @staticmethod
    def _frame(answer: str) -> bytes:
        code, *rest = map(int, answer.split())
        if code == 16:
            return struct.pack(">BHH", 16, *rest)
        return struct.pack(f">BB{len(rest)}H", 3, 2 * len(rest), *rest)

    def close(self) -> None:
        """Nobody listens any more."""
        for line in self.lines:
            line.close()
        if self.kind == "tcp":
            self._door.close()
        else:
            for handle in (self._ours, self._theirs):
                with contextlib.suppress(OSError):
                    os.close(handle)


@dataclass
class WireRun(gateway.Run):
    """A computer whose requests go through pymodbus and a real line."""

    line: Any = None

    def step(self, gateway: Any) -> None:
        before = gateway.control.now
        request = self.client.bytes_to_send(1 << 16)
        events: list[Event] = []
        try:
            if request:
                if self.line is None:
                    if gateway.kind == "rtu":  # the process that was killed has the port no more
                        for line in gateway.lines:
                            line.close()
                    self.line = open_port(parse(gateway.url, modbus.OPTIONS))
                    gateway.lines.append(self.line)
                self.line.write(request)
                events += self.client.receive(self.line.read(0.0))
            else:
                with gateway._lock:
                    gateway.pass_time(0.05)
        except Lost as error:
            events.append(Failed(str(error)))
        events += self.client.elapsed(gateway.control.now - before)
        for event in events:
            if isinstance(event, Touched):
                self.touched.append(event)
            elif isinstance(event, Ended | Failed):
                self.ended, self.complete = gateway.control.now, isinstance(event, Ended)
                self.why = event.why if isinstance(event, Failed) else ""
        if self.ended is not None and self.line is not None:
            self.line.close()
