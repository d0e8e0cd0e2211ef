"""A port's URL taken apart: which protocol, what to open, the settings of the line, and what the client is told."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl, unquote, urlsplit

from ..records import InputError

LINE: Mapping[str, tuple[str, ...]] = {
    "baud": ("9600", "110", "300", "600", "1200", "2400", "4800", "19200", "38400", "57600", "115200"),
    "bits": ("8", "7"),
    "parity": ("none", "even", "odd"),
    "stop": ("1", "2"),
    "flow": ("none", "xonxoff", "rtscts"),
    "exclusive": ("yes", "no"),
}
DEFAULTS = {name: allowed[0] for name, allowed in LINE.items()}
PTY = ("/dev/pts/", "/dev/ttyp")
SCHEMES = ("serial", "socket", "rfc2217")
# First part of a scheme → the protocol that it stands for and the schemes that may follow it.
SPOKEN: Mapping[str, tuple[str, ...]] = {"modbus": ("tcp", "rtu"), "grbl": ("serial", "socket"), "linuxcnc": (), "file": ()}
ALONE = {"linuxcnc": "rsh", "file": "file"}  # protocols with one way to travel
LAST_PORT = 65535
HOST = r"(\[[0-9A-Fa-f:.]+\]|[^:\[\]@/]+):\d{1,5}"


@dataclass(frozen=True)
class Address:
    """A port's URL taken apart: what to open, the settings of the line, and what the protocol client is told."""

    url: str
    scheme: str  # serial, socket, rfc2217, tcp and rtu (of Modbus), rsh (of LinuxCNC), file
    target: str  # device, or host:port
    line: Mapping[str, str] = field(default_factory=dict)
    uart: bool = True  # somebody keeps to the settings of the line: a driver, a converter
    options: Mapping[str, str] = field(default_factory=dict)
    unit: int = 1  # of a Modbus device


def spoken(url: str) -> str | None:
    """URL → the protocol that its scheme names (modbus+tcp://, grbl+serial://, linuxcnc://), None when it names none."""
    protocol = url.partition("://")[0].lower().partition("+")[0] if "://" in url else ""
    return protocol if protocol in SPOKEN else None


def parse(url: str, options: Mapping[str, tuple[str, ...]]) -> Address:
    """URL or device, {option of the client: allowed values, none for any text} → address.

    Raises InputError for what it cannot mean.
    """
    scheme, target, query = _parts(url)
    unit = 1
    if scheme in ("tcp", "rtu"):
        target, _, number = target.rpartition("/")
        if not target or not number.isdecimal() or not 0 <= int(number) <= 247:
            raise InputError(f"port {url!r}: no device number; e.g. modbus+tcp://192.168.1.20:502/1 or modbus+rtu:///dev/ttyUSB0/1")
        unit = int(number)
    if scheme in ("serial", "rtu") and not target:
        raise InputError(f"port {url!r}: no device; e.g. serial:///dev/ttyUSB0?baud=9600&flow=xonxoff or COM3")
    if scheme in ("socket", "rfc2217", "tcp", "rsh") and not (
        re.fullmatch(HOST, target) and 0 < int(target.rpartition(":")[2]) <= LAST_PORT
    ):
        raise InputError(
            f"port {url!r}: found {target!r}; allowed: host:port, port 1 … {LAST_PORT}, e.g. socket://192.168.1.20:8193"
        )
    if scheme == "file" and not target:
        raise InputError(f"port {url!r}: no file; e.g. file:///mnt/control/TANGO.TXT, on Windows file://Z:/TANGO.TXT")
    uart = scheme not in ("socket", "tcp", "rsh", "file") and not target.startswith(PTY)
    line: dict[str, str] = {}
    told: dict[str, str] = {}
    known: dict[str, tuple[str, ...]] = {**LINE, **options}
    for name, text in parse_qsl(query, keep_blank_values=True):
        value = text or "yes" if name == "exclusive" else text
        if name not in known:
            raise InputError(f"port {url!r}: found the unknown setting {name!r}; allowed: {', '.join(known)}")
        if known[name] and value not in known[name] and not (name == "baud" and value.isdecimal() and int(value) > 0):
            raise InputError(f"port {url!r}: {name}: found {value!r}; allowed: {', '.join(known[name])}")
        if name in LINE:
            line[name] = value
        if name in options:
            told[name] = value
    if line.get("parity", "none") != "none" and line.get("bits") != "7" and not uart:
        raise InputError(
            f"port {url!r}: found parity without bits=7; allowed here: bits=7&parity=…, as nobody else adds the parity"
        )
    return Address(url, scheme, target, {**DEFAULTS, **line} if uart else line, uart, told, unit)


def _parts(url: str) -> tuple[str, str, str]:
    """URL or device → (scheme without the protocol, target, settings). Raises InputError for an unknown scheme."""
    if "://" not in url:
        return "serial", url, ""
    parts = urlsplit(url)
    first, _, second = parts.scheme.lower().partition("+")
    if first in SPOKEN and second in (SPOKEN[first] or ("",)):
        scheme = second or ALONE[first]
    elif parts.scheme.lower() in SCHEMES:
        scheme = parts.scheme.lower()
    else:
        allowed = ", ".join(
            [f"{name}://" for name in SCHEMES] + [f"{n}{'+' * bool(s)}{s}://" for n, more in SPOKEN.items() for s in more or ("",)]
        )
        raise InputError(f"port {url!r}: found scheme {parts.scheme!r}; allowed: {allowed} or a device path")
    if scheme == "file":  # file:///C:/TANGO.TXT has a slash that is no part of the path
        return scheme, re.sub(r"^/(?=[A-Za-z]:)", "", unquote(parts.netloc + parts.path)), parts.query
    return scheme, parts.netloc + (parts.path if scheme in ("serial", "tcp", "rtu") else ""), parts.query
