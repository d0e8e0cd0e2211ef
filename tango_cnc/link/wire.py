"""What a serial line does to bytes where no UART does it: parity, the pace of the baud rate, marks of bad characters.

A pty and a TCP connection carry eight bits as fast as they can. When the other end is a converter that passes the characters
of a 7-bit line through, or holds fewer bytes than it is sent before its DC3 arrives, this end has to behave like a UART.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

SUB = 0x1A  # ASCII: stands for a character that was received in error


class Line(Protocol):
    """Bytes there and back; see `transport.Transport`."""

    chunk: int

    def read(self, timeout: float) -> bytes:
        """s → what has arrived."""

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took."""

    def close(self) -> None:
        """Gives the port back."""


class Parity:
    """Seven data bits; the eighth is parity, given to what is sent and checked in what arrives."""

    def __init__(self, line: Line, odd: bool) -> None:
        self._line, self.chunk = line, line.chunk
        self._coded = bytes(byte & 0x7F | ((byte & 0x7F).bit_count() + odd) % 2 << 7 for byte in range(256))
        self._plain = bytes(byte & 0x7F if self._coded[byte] == byte else SUB for byte in range(256))

    def read(self, timeout: float) -> bytes:
        """s → what has arrived, SUB for characters of wrong parity. Raises Lost."""
        return self._line.read(timeout).translate(self._plain)

    def write(self, data: bytes) -> int:
        """7-bit bytes → how many of them the line took, without waiting. Raises Lost."""
        return self._line.write(data.translate(self._coded))

    def close(self) -> None:
        """Gives the port back."""
        self._line.close()


class Paced:
    """No more bytes than a UART of this rate would have sent by now."""

    def __init__(self, line: Line, per_second: float, clock: Callable[[], float]) -> None:
        self._line, self._rate, self._clock = line, per_second, clock
        self.chunk = max(16, int(per_second / 50))  # 20 ms: twice what passes between two looks at a line that takes nothing
        self._free = clock()  # when the last byte taken will have left

    def read(self, timeout: float) -> bytes:
        """s → what has arrived, at once when there is something, empty after the timeout. Raises Lost."""
        return self._line.read(timeout)

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took, without waiting. Raises Lost."""
        now = self._clock()
        room = self.chunk - int(max(0.0, self._free - now) * self._rate + 0.999)
        if room <= 0:
            return 0
        taken = self._line.write(data[:room])
        self._free = max(self._free, now) + taken / self._rate
        return taken

    def close(self) -> None:
        """Gives the port back."""
        self._line.close()


def unmarked(data: bytes) -> tuple[bytes, bytes]:
    """bytes with the kernel's marks (FF 00 x: x had bad parity; FF FF: FF) → (bytes with SUB for bad ones, unfinished rest)."""
    out = bytearray()
    at = 0
    while at < len(data):
        if data[at] != 0xFF:
            out.append(data[at])
            at += 1
        elif data[at + 1 : at + 2] == b"\xff":
            out.append(0xFF)
            at += 2
        elif at + 2 < len(data) and data[at + 1] == 0:
            out.append(SUB)
            at += 3
        elif at + 2 >= len(data) and data[at + 1 : at + 2] in (b"", b"\0"):
            break
        else:
            out.append(SUB)
            at += 1
    return bytes(out), bytes(data[at:])
