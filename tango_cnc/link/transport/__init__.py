"""Bytes to and from a port named by a URL: the only importers of serial, socket and pymodbus; one file a kind of line.

    serial:///dev/ttyUSB0?baud=9600&bits=7&parity=even&stop=2&flow=xonxoff      serial://COM3?baud=4800
    /dev/ttyUSB0, COM3, /dev/pts/4       the same with what DEFAULTS says
    socket://192.168.1.20:8193           TCP, also of a serial-to-Ethernet converter in raw mode
    rfc2217://192.168.1.20:2217?baud=…   a converter that lets the line be set from here
    modbus+tcp://192.168.1.20:502/1      modbus+rtu:///dev/ttyUSB0/1?baud=19200      requests and answers of device 1, in words
    file:///mnt/control/TANGO.TXT        a file that the control writes, as it grows

Everything after `?` that is not of the line is handed to the protocol client. Behind socket:// and a pty the settings of the
line are somebody else's; stated all the same, `baud` slows the sending down to that rate and `parity` is added and checked here.
Found out by others: a readline returns half a
line at the timeout, an unplugged port still says it is open, two programs may open one port unless both ask for exclusive,
and drivers deliver bytes of wrong parity without a word. Here reads return what there is, every error of the system means
that the line is lost, serial ports are locked twice, and a character of wrong parity arrives as SUB, which no client takes.
"""

from __future__ import annotations

import contextlib
import ssl
import time
from collections.abc import Iterator

import serial
from serial.tools import list_ports

from ...records import LinkError
from ..address import Address
from ..address import parse as parse
from ..ways import ways
from ..wire import Paced, Parity
from ._line import Lost as Lost
from ._line import Transport as Transport
from ._line import reason


def ports() -> list[tuple[str, str]]:
    """→ (device, description) of the serial ports of this computer."""
    return sorted((str(port.device), str(port.description)) for port in list_ports.comports())


def foreseen(address: Address) -> None:
    """address → nothing, and nothing is opened. Raises InputError for what is named there and no run may or can use."""
    ways()[address.scheme].foreseen(address)


def fits(address: Address, program: bytes) -> None:
    """address, program → nothing, and nothing is opened. Raises InputError for one that can never go where the address says."""
    ways()[address.scheme].fits(address, program)


def said_before(address: Address) -> str:
    """address → what a person has to know of what is there before the run begins; '' for nothing."""
    return ways()[address.scheme].before(address)


def look_into(address: Address, port: Transport) -> None:
    """address, open transport, now that it is said that nothing moves → looked into, where that needs rest.

    Raises as `open_port`.
    """
    with _opening(address):
        ways()[address.scheme].look(port)


@contextlib.contextmanager
def _opening(address: Address) -> Iterator[None]:
    """address → within it, errors of the system are a port that does not open."""
    try:
        yield
    except (
        OSError,
        EOFError,
        ValueError,
        serial.SerialException,
    ) as error:  # SerialException is an OSError; ValueError: baud rates
        raise LinkError(f"port {address.url} does not open: {reason(error)}. {_advice(address, error)}") from None


def open_port(address: Address, *, rests: bool = False) -> Transport:
    """address, whether it is said that nothing moves → open transport, looked into where that needs rest.

    Raises LinkError saying what did not open, which ports there are and what to do; InputError for what no run can use there.
    """
    with _opening(address):
        port: Transport = ways()[address.scheme].open(address)
        if rests:
            ways()[address.scheme].look(port)
    if ways()[address.scheme].unit:
        return port
    if not address.uart and "baud" in address.line:
        characters = int(address.line["baud"]) / (
            2 + int(address.line.get("bits", "8")) + (address.line.get("parity", "none") != "none")
        )
        port = Paced(port, characters, time.monotonic)
    if not address.uart and address.line.get("parity", "none") != "none":
        port = Parity(port, address.line["parity"] == "odd")
    return port


def _advice(address: Address, error: Exception) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return (
            "Renew it, or name the host as it does. The environment variable SSL_CERT_FILE names a file with the certificate of a "
            "shop's own issuer; verify=no looks at no certificate"
        )
    way = ways()[address.scheme]
    if way.advice:
        return way.advice
    if way.needs in ("file", "path"):
        return f"Is what stands at {address.target} there, open to you, and no other program connected to it?"
    if way.needs != "device":
        return "Is the controller or converter switched on, the address right, and no other program connected to it?"
    busy = getattr(error, "errno", None) in (11, 16, 35) or "lock" in str(error) or "PermissionError(13" in str(error)  # Windows
    there = ", ".join(f"{device} ({text})" for device, text in ports()) or "none"
    step = "Another program has it open: close that one" if busy else "Check the cable, the name and your permission to use it"
    return f"Serial ports of this computer: {there}. {step}."
