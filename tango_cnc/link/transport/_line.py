"""What every kind of line is to its users, and the errors of the system in words."""

from __future__ import annotations

import os
import ssl
from typing import Protocol

import serial

from ...records import LinkError

SLICE = 0.05  # s, the longest wait inside a port that cannot be waited for together with others
PATIENCE = 5.0  # s, to open a TCP connection
REST = 0.002  # s from one question to the same one again


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


def reason(error: Exception) -> str:
    """error of the system → why, in its words."""
    number = getattr(error, "errno", None)
    if isinstance(error, EOFError):
        return "the connection was closed"
    if isinstance(error, ssl.SSLCertVerificationError):  # its number is that of another error of the system
        return f"the certificate of the control is refused ({error.verify_message.rstrip('.')})"
    if isinstance(error, ssl.SSLError):
        return f"TLS fails ({error.reason or error})"
    if isinstance(error, TimeoutError):
        return f"no answer within {PATIENCE:.0f} s"
    if isinstance(number, int) and number > 0:
        return os.strerror(number)
    behind = error.__context__
    match behind.args if behind else ():  # pyserial puts the number and the words of the system into one text
        case (int(), str(words)) if isinstance(error, serial.SerialException):
            return f"it is not a serial port, or takes none of these settings ({words})"
    return str(error)
