"""Modbus through pymodbus, whose traps end here."""

from __future__ import annotations

import contextlib
import logging
import os
import select
import time
from typing import Any
from urllib.parse import quote, urlsplit

from ..address import DEFAULTS, Address
from ..ways import Way
from ._line import REST, Lost, reason

ANSWER = 1.0  # s that a device may take to answer


class Modbus:
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
            43: lambda: self._client.read_device_information(read_code=1, object_id=address, device_id=self._unit),
        }
        try:
            reply = calls[code]()
        except ConnectionException:
            raise Lost("the serial port is gone" if self._serial else "the device has closed the connection") from None
        except (ModbusException, OSError):
            self._drain()
            return "- no answer"
        if reply.isError() and reply.function_code & 0x7F == code:
            return f"! {reply.exception_code}"
        if code == 43 and reply.function_code == code:
            texts = (value.decode("latin-1") for value in reply.information.values() if isinstance(value, bytes))
            return f"43 {' '.join(quote(text) for text in texts)}"
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
            raise Lost(f"the port is gone: {reason(error)}") from None


WAYS = {
    "tcp": Way(Modbus, "host", path=True, unit=True),
    "rtu": Way(Modbus, "device", path=True, uart=True, unit=True),
}
