"""A TCP connection, of a control or of a serial-to-Ethernet converter in raw mode."""

from __future__ import annotations

import select
import socket
from urllib.parse import urlsplit

from ..address import Address
from ..ways import Way
from ._line import PATIENCE, Lost, reason


class Tcp:
    """A TCP connection; what the other side says at once after accepting is not lost."""

    chunk = 256

    def __init__(self, address: Address) -> None:
        parts = urlsplit(f"//{address.target}")
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
            raise Lost(f"the connection broke: {reason(error)}") from None
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
            raise Lost(f"the connection broke: {reason(error)}") from None

    def close(self) -> None:
        """Gives the port back."""
        self._socket.close()


WAYS = {"socket": Way(Tcp, "host")}
