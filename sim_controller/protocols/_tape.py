"""A tape as it arrives: leader, `%`, lines, `%`; filled by the line and emptied by the control, with XON and XOFF between them.

Its reader stops with an alarm at a character of wrong parity (TH) and, where it is told to count, at a block of an odd number of
characters, end of block included and carriage returns left out (TV). Codes and texts as in Fanuc manuals, from memory: unverified.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator

from ..languages import Alarm
from ..lines import BAD


class Tape:
    """Bytes in, lines out. `wants_pause` and `wants_more` say what the flow control has to tell the other side."""

    def __init__(self, capacity: int, counted: bool = False) -> None:
        """bytes that it holds, whether characters of blocks are counted (TV check) → an empty tape."""
        self._capacity, self._counted = capacity, counted
        self._count = 1  # characters of the block so far, its end included; that of the % is not counted
        self._first = True
        self._alarm: Alarm | None = None
        self._buffer = bytearray()
        self._changed = threading.Condition()
        self._begun = self._ended = False

    @property
    def begun(self) -> bool:
        """→ whether the first % has come."""
        return self._begun

    @property
    def ended(self) -> bool:
        """→ whether the closing % has come, or nothing can come any more."""
        return self._ended

    def put(self, data: bytes) -> bytes:
        """7-bit bytes as they come, cut anywhere → what follows the closing %."""
        with self._changed:
            for i, byte in enumerate(data):
                if self._ended:
                    return data[i:]
                if byte in (0x00, 0x7F):
                    continue
                if not self._begun:
                    self._begun = byte == ord("%")
                elif byte == ord("%"):
                    self._ended = True
                elif fault := self._fault(byte):
                    self._alarm, self._ended = fault, True
                else:
                    self._buffer.append(byte)
            self._changed.notify_all()
        return b""

    def _fault(self, byte: int) -> Alarm | None:
        """7-bit byte → the alarm of the reader, if that is one too many."""
        if byte == BAD:
            return Alarm("PS0001", "TH ALARM", "a character of wrong parity")
        if byte != ord("\n"):
            self._count += byte != ord("\r")
            return None
        odd = self._counted and not self._first and self._count % 2 == 1
        self._count, self._first = 1, False
        return Alarm("PS0002", "TV ALARM", "a block of an odd number of characters") if odd else None

    def close(self) -> None:
        """Nothing will come any more."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    @property
    def wants_pause(self) -> bool:
        """→ whether the buffer is nearly full, of complete lines among others."""
        with self._changed:
            return len(self._buffer) > 0.75 * self._capacity and b"\n" in self._buffer

    @property
    def wants_more(self) -> bool:
        """→ whether there is room again, or nothing but the beginning of a line, which only more of it can complete."""
        with self._changed:
            return len(self._buffer) < 0.25 * self._capacity or b"\n" not in self._buffer

    def lines(self) -> Iterator[str]:
        """→ lines between the two %, each as soon as it is complete; waits for them. What follows % on its line is its title.

        Raises Alarm where the reader has stopped.
        """
        self._next_line()
        while (line := self._next_line()) is not None:
            if line.strip():
                yield line

    def _next_line(self) -> str | None:
        with self._changed:
            while (end := self._buffer.find(b"\n")) < 0 and not self._ended:
                self._changed.wait()
            if end < 0 and self._alarm is not None:
                raise self._alarm
            if end < 0:
                rest = self._buffer.decode("latin-1")
                self._buffer.clear()
                return rest if rest.strip() else None
            line = self._buffer[:end].decode("latin-1")
            del self._buffer[: end + 1]
            return line.strip("\r")
