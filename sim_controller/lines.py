"""The line to the other side: a TCP connection or a pseudo-terminal, and the parity that neither of them has."""

from __future__ import annotations

import os
import select
import socket
import struct
import time
from typing import Protocol

from tango_cnc.records import InputError, LinkError

CHUNK = 4096
BAD = 0x1A  # SUB: a character that was received in error
READ_OUT = 1.0  # s without anybody reading after which what is left is thrown away


class Closed(Exception):
    """The other side has hung up."""


class Line(Protocol):
    """Bytes both ways."""

    def receive(self, timeout: float) -> bytes:
        """s → what has come, b"" when nothing has. Raises Closed when nothing can come any more."""

    def send(self, data: bytes) -> None:
        """Sends everything. Raises Closed when nobody is there."""

    def close(self) -> None:
        """Hangs up."""


class TcpLine:
    """One TCP connection, as behind a serial device server."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, timeout: float) -> bytes:
        """s → what has come. Raises Closed at the end of the stream."""
        try:
            if not select.select([self._socket], [], [], timeout)[0]:
                return b""
            data = self._socket.recv(CHUNK)
        except (OSError, ValueError) as error:
            raise Closed from error
        if not data:
            raise Closed
        return data

    def send(self, data: bytes) -> None:
        """bytes → all sent. Raises Closed when the connection is gone."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise Closed from error

    def close(self) -> None:
        """Closes the connection."""
        self._socket.close()


class PtyLine:
    """A pseudo-terminal that looks like a serial port; like one it does not notice when nobody is there. Not on Windows."""

    def __init__(self) -> None:
        import tty

        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)

    def receive(self, timeout: float) -> bytes:
        """s → what has come."""
        try:
            if not select.select([self._master], [], [], timeout)[0]:
                return b""
            return os.read(self._master, CHUNK)
        except (OSError, ValueError) as error:
            raise Closed from error

    def send(self, data: bytes) -> None:
        """bytes → all sent, or thrown away when nobody has read for a while, as on a cable without a reader."""
        while data:
            if not select.select([], [self._master], [], 1.0)[1]:
                return
            data = data[os.write(self._master, data) :]

    def close(self) -> None:
        """Removes the terminal when what was sent has been read, or nobody reads on: closing would throw it away."""
        import fcntl
        import termios

        left, since = 1, time.monotonic()
        while left and time.monotonic() - since < READ_OUT:
            time.sleep(0.02)
            before = left
            left = struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))[0]
            since = time.monotonic() if left != before else since
        os.close(self._master)
        os.close(self._slave)


class ParityLine:
    """7 data bits and even parity on a line that carries 8 bits: the parity is the eighth bit, and is checked."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self.errors = 0

    def receive(self, timeout: float) -> bytes:
        """s → what has come, without parity; characters with wrong parity come as `BAD`."""
        data = self._line.receive(timeout)
        self.errors += sum(byte.bit_count() % 2 for byte in data)
        return bytes(byte & 0x7F if byte.bit_count() % 2 == 0 else BAD for byte in data)

    def send(self, data: bytes) -> None:
        """7-bit bytes → sent with even parity."""
        self._line.send(even(data))

    def close(self) -> None:
        """Hangs up."""
        self._line.close()


class PacedLine:
    """A line that sends no faster than a UART of this rate: ten bits a character, 7 and parity or 8."""

    def __init__(self, line: Line, baud: int) -> None:
        self._line, self._seconds = line, 10 / baud
        self._free = 0.0  # when the last character will have left

    def receive(self, timeout: float) -> bytes:
        """s → what has come."""
        return self._line.receive(timeout)

    def send(self, data: bytes) -> None:
        """bytes → sent one by one, each when the one before has left. Raises Closed."""
        for byte in data:
            self._free = max(self._free, time.monotonic()) + self._seconds
            if (ahead := self._free - time.monotonic()) > 0.005:
                time.sleep(ahead)
            self._line.send(bytes([byte]))

    def close(self) -> None:
        """Hangs up."""
        self._line.close()


def even(data: bytes) -> bytes:
    """7-bit bytes → the same with the eighth bit making the number of ones even."""
    return bytes((byte & 0x7F) | (((byte & 0x7F).bit_count() % 2) << 7) for byte in data)


def listen(address: str) -> socket.socket:
    """'127.0.0.1:8193' → listening socket. Raises InputError for a bad address, LinkError when it is taken."""
    host, separator, port = address.rpartition(":")
    if not separator or not port.isdecimal() or int(port) > 65535:
        raise InputError(f"--tcp: found {address!r}; allowed: HOST:PORT, e.g. 127.0.0.1:8193 (port 0 takes any free one)")
    try:
        return socket.create_server((host or "127.0.0.1", int(port)))
    except OSError as error:
        raise LinkError(f"--tcp {address}: {error.strerror}; choose another port or end the program that uses this one") from None
