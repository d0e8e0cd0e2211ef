"""A serial port, a pseudo-terminal or an RFC 2217 converter through pyserial."""

from __future__ import annotations

import contextlib
import os
import select
import time
from typing import Any

import serial

from ..address import DEFAULTS, Address
from ..ways import Way
from ..wire import SUB, unmarked
from ._line import REST, SLICE, Lost, reason


class Port:
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
        self._parity = line["parity"] != "none"
        self._marked = self._posix and self._parity
        self._rest = self._sent = b""
        self._settle(lock=line["exclusive"] == "yes" and address.uart)

    def _settle(self, lock: bool = False) -> None:
        """What pyserial leaves out. POSIX: bad parity is marked; the kernel refuses other openers (a pty would remember it).

        Windows: the driver puts SUB in the place of bad parity. Raises OSError.
        """
        if self._local and not self._posix and self._parity:
            _replacing(self._port)
        if not self._posix:
            return
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
            raise Lost(f"the port is gone: {reason(error)}") from None
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
        while timeout < SLICE and not self._port.in_waiting:  # bytes wait to be sent: a read would hold each piece up for a slice
            if time.monotonic() >= until:
                return b""
            time.sleep(REST)
        while True:
            data = bytes(self._port.read(max(1, self._port.in_waiting)))
            if data or time.monotonic() >= until:
                return data

    def write(self, data: bytes) -> int:
        """bytes → how many of them the line took, without waiting. Raises Lost."""
        try:
            if self._flow:
                self._port.xonxoff, self._flow = True, False
                self._settle()
            if self._local and self._port.out_waiting > 0:
                return 0
            piece = self._sent = data[: self.chunk]  # Windows may read it from here after the call
            return os.write(self._port.fileno(), piece) if self._posix else int(self._port.write(piece) or 0)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Lost(f"the port is gone: {reason(error)}") from None

    def close(self) -> None:
        """Gives the port back; what the control did not take is thrown away, it must not follow later."""
        with contextlib.suppress(Exception):  # an unplugged port fails in ways of its own, and there is nothing left to lose
            self._port.reset_output_buffer()
        with contextlib.suppress(Exception):
            self._port.close()


def _replacing(port: Any) -> None:
    """open port of Windows → a character of wrong parity arrives as SUB: pyserial has it delivered as it came. Raises OSError."""
    from ctypes import byref, sizeof

    from serial import win32

    state = win32.DCB()
    state.DCBlength = sizeof(state)
    done = win32.GetCommState(port._port_handle, byref(state))
    state.fErrorChar, state.ErrorChar = 1, bytes([SUB])
    if not done or not win32.SetCommState(port._port_handle, byref(state)):
        raise OSError("its driver does not replace characters of wrong parity; allowed here: parity=none")


WAYS = {"serial": Way(Port, "device", path=True, uart=True), "rfc2217": Way(Port, "host", uart=True)}
