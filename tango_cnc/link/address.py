"""A port's URL taken apart: which protocol, what to open, the settings of the line, and what the client is told."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl, quote, unquote, urlsplit

from ..files.checked import printable
from ..nearest import suggestion
from ..records import InputError
from .protocols import schemes
from .secrets import SECRET, named_only, revealed, shown
from .ways import ways

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
SCHEMES = ("serial", "socket", "rfc2217")  # every protocol may have these
OTHERS = {"tcp": "socket", "telnet": "socket", "com": "serial", "tty": "serial", "rs232": "serial", "ssh": "sftp", "cifs": "smb"}
# Endings of what a cell consists of, and of what its commands write.
OWN = (".yaml", ".yml", ".csv", ".json", ".jsonl", ".journal", ".lock", ".db", ".py", ".toml", ".html", ".pdf")
LAST_PORT = 65535
DEVICE = re.compile(r"[/\\.][^?]*|[^:/?]+")  # a path, or the name of a port
HOST = re.compile(r"(?:\[(?P<six>[0-9A-Fa-f:.]+)\]|(?P<name>[A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*\.?)):(?P<port>[0-9]{1,5})")
FILE = re.compile(r"file:(?!//).*|(?:[A-Za-z]:[\\/]|\\\\[^.\\]).*|(?:[^:?]*[/\\])?[^:?/\\]+\.(?!\d)[A-Za-z0-9]{1,4}", re.IGNORECASE)
WHOLE = re.compile(r"/|[A-Za-z]:|\\\\")  # how a path begins that is the same one wherever somebody stands
LONGEST = 2000  # characters of a URL


@dataclass(frozen=True)
class Address:
    """A port's URL taken apart: what to open, the settings of the line, and what the protocol client is told."""

    url: str  # as it may be shown
    scheme: str  # the way, one of ways(): serial, socket, tcp and rtu (of Modbus), rsh (of LinuxCNC) …
    target: str  # device, or host:port
    line: Mapping[str, str] = field(default_factory=dict)
    uart: bool = True  # somebody keeps to the settings of the line: a driver, a converter
    options: Mapping[str, str] = field(default_factory=dict)
    unit: int = 1  # of a Modbus device
    hidden: tuple[str, ...] = ()  # words that are never shown


def spoken(url: str) -> str | None:
    """URL → the protocol that its scheme names (modbus+tcp://, grbl+serial://, linuxcnc://), None when it names none."""
    scheme, there, _ = url.partition("://")
    return schemes().get(scheme.lower(), (None, ""))[0] if there else None


def completed(url: str, setting: str) -> str:
    """URL or device, name=value → the URL that has this setting, too, in place of another value of it."""
    where, _, query = (url if "://" in url else f"serial://{url}").partition("?")
    name = setting.partition("=")[0]
    others = [each for each in query.split("&") if each and each.partition("=")[0] != name]
    return f"{where}?{'&'.join([*others, setting])}"


def linked(url: str) -> str | None:
    """URL → the protocol that its setting `link` names, None when there is none."""
    return dict(parse_qsl(url.partition("?")[2])).get("link") if "://" in url else None


def parse(url: str, options: Mapping[str, tuple[str, ...]]) -> Address:
    """URL or device, {option of the client: allowed values, none for any text} → address.

    Raises InputError for what it cannot mean.
    """
    if len(url) > LONGEST or not url.isprintable():
        raise InputError(f"port: found {shown(url)[:60]!r}… of {len(url)} characters; allowed: {LONGEST} printable ones")
    named_only(url)
    if "://" in url and "#" in url:  # what stands behind it would be left out without a word
        raise InputError(f"port {shown(url)!r}: found #; allowed: %23 where a name has one")
    scheme, target, query = _parts(url)
    url = shown(url)
    unit, way, typed = 1, ways()[scheme], url.partition("://")[0].lower() if "://" in url else "serial"
    if way.unit:
        target, _, number = target.rpartition("/")
        if not target or not re.fullmatch("[0-9]{1,3}", number) or not 0 <= int(number) <= 247:
            found = f"found device {printable(repr(number), 80)}" if target else "found no device number"
            raise InputError(
                f"port {url!r}: {found}; allowed: 0 … 247 at its end, "
                f"e.g. {typed}://{'192.168.1.20:502' if way.needs == 'host' else '/dev/ttyUSB0'}/1"
            )
        unit = int(number)
    if way.needs in ("device", "path") and not target:
        device = f"{typed}:///dev/ttyUSB0?baud=9600&flow=xonxoff or COM3" if way.needs == "device" else f"{typed}:///run/control"
        raise InputError(f"port {url!r}: no {way.needs}; e.g. {way.example or device}")
    if way.needs == "host" and not _host(target):
        raise InputError(
            f"port {url!r}: found {printable(repr(target), 80)}; allowed: host:port, port 1 … {LAST_PORT}, "
            f"e.g. {way.example or typed + '://192.168.1.20:8193' + '/1' * way.unit}"
        )
    if way.needs == "disk":
        place, _, path = target.rpartition("@")[2].partition("/")
        if not _host(place if re.search(r":[0-9]+$", place) else f"{place}:1") or not path or path.endswith("/"):
            raise InputError(f"port {url!r}: found no host, or no file on it; allowed: e.g. {way.example}")
    if way.needs == "file" and not target:
        raise InputError(f"port {url!r}: no file; e.g. {typed}:///mnt/control/TANGO.TXT, on Windows {typed}://Z:/TANGO.TXT")
    if way.needs == "file" and not WHOLE.match(target):  # else it is another file for a timer, or from another folder
        raise InputError(f"port {url!r}: found {target!r}; allowed: the whole path of the file, e.g. {_as_file(target)}")
    if way.needs == "file" and target.lower().endswith(OWN):
        raise InputError(
            f"port {url!r}: found {target!r}, a name of tango's own files, into which no control may write; allowed: another name, "
            "e.g. TANGO.TXT"
        )
    uart = way.uart and not target.startswith(PTY)
    line: dict[str, str] = {}
    told: dict[str, str] = {}
    known: dict[str, tuple[str, ...]] = {**LINE, **options}
    settings = _settings(query, url)
    for name, text in settings:
        if [other for other, _ in settings].count(name) > 1:
            raise InputError(f"port {url!r}: found {printable(repr(name), 80)} more than once; allowed: each setting once")
        value = text or "yes" if name == "exclusive" else text
        if name not in known:
            found, other = printable(repr(name), 80), suggestion(name[:80], known)
            raise InputError(f"port {url!r}: found the unknown setting {found}; allowed: {', '.join(known)}{other and '.' + other}")
        if known[name] and value not in known[name] and not (name == "baud" and re.fullmatch("[1-9][0-9]{0,7}", value)):
            rates = " or another whole number" if name == "baud" else ""
            raise InputError(f"port {url!r}: {name}: found {printable(repr(value), 80)}; allowed: {', '.join(known[name])}{rates}")
        if not value and not known[name]:
            raise InputError(f"port {url!r}: {name}: found nothing; allowed: a value, or leave {name}= out")
        if name in LINE:
            line[name] = value
        if name in options:
            told[name] = value
    if line.get("parity", "none") != "none" and line.get("bits") != "7" and not uart:
        raise InputError(
            f"port {url!r}: found parity without bits=7; allowed here: bits=7&parity=…, as nobody else adds the parity"
        )
    said = revealed(told)
    hidden = tuple({said[name] for name in told if name in SECRET and said[name]})
    return Address(url, scheme, target, {**DEFAULTS, **line} if uart else line, uart, said, unit, hidden)


def _host(target: str) -> bool:
    """'192.168.1.20:502' → whether that names a host and a port of it."""
    match = HOST.fullmatch(target)
    if match is None or not 0 < int(match["port"]) <= LAST_PORT:
        return False
    host = match["six"] or match["name"]
    try:
        if match["six"] or re.fullmatch(r"[0-9.]+", host):
            ipaddress.ip_address(host)
    except ValueError:
        return False
    return len(host) <= 253 and all(0 < len(part) <= 63 for part in host.rstrip(".").split("."))


def _settings(query: str, url: str) -> list[tuple[str, str]]:
    """text after ? → (name, value) of each. Raises InputError for what cannot be settings."""
    try:
        plain = query.replace("+", "%2B")  # a blank in forms of the web: here half of all hashes of keys have one
        return parse_qsl(plain, keep_blank_values=True, errors="strict")
    except ValueError:
        raise InputError(f"port {url!r}: found settings {shown('?' + query)!r}; allowed: name=value&name=value") from None


def written_into(url: str) -> str | None:
    """URL or device → the file that the control writes its records into: '' where it is not on this computer, None for a line."""
    scheme, target, _ = _parts(url)
    if ways()[scheme].needs == "file":
        return target
    return "" if ways()[scheme].stored else None


def _as_file(path: str) -> str:
    """path of a file as it was typed → the URL that means it; one that begins nowhere is put into a folder of the control."""
    plain = path.removeprefix("file:").replace("\\", "/")
    whole = plain if WHOLE.match(plain) else f"/mnt/control/{plain}"
    return f"file://{quote(whole, safe='/:')}"


def _parts(url: str) -> tuple[str, str, str]:
    """URL or device → (scheme without the protocol, target, settings). Raises InputError for an unknown scheme."""
    if "://" not in url:
        if FILE.fullmatch(url) and not url.startswith("/dev/"):
            raise InputError(
                f"port {shown(url)!r}: found the path of a file; allowed: a serial port such as /dev/ttyUSB0 or COM3, or the whole "
                f"path of the file of the records with file:// in front, e.g. {_as_file(url)}"
            )
        if url and not DEVICE.fullmatch(url):
            meant = f". Perhaps you mean socket://{url}" if HOST.fullmatch(url) else ""
            raise InputError(
                f"port {shown(url)!r}: found neither a device nor a URL; allowed: e.g. /dev/ttyUSB0, COM3, "
                f"serial:///dev/ttyUSB0?baud=9600 or socket://192.168.1.20:8193{meant}"
            )
        return "serial", url, ""
    try:
        parts = urlsplit(url)
    except ValueError:
        raise InputError(
            f"port {shown(url)!r}: found brackets that hold no address; allowed: e.g. socket://[fe80::1]:8193"
        ) from None
    known = {name: name for name in SCHEMES} | {name: way for name, (_, way) in schemes().items()}
    scheme = known.get(parts.scheme.lower(), "")
    if not scheme:
        allowed = ", ".join(f"{name}://" for name in known)
        asked = parts.scheme.lower()
        meant = f" Did you mean {OTHERS[asked]!r}?" if asked in OTHERS else suggestion(asked[:80], known)
        raise InputError(
            f"port {shown(url)!r}: found scheme {parts.scheme!r}; allowed: {allowed} or a device path{meant and '.' + meant}"
        )
    if ways()[scheme].needs == "file":  # file:///C:/TANGO.TXT has a slash that is no part of the path
        return scheme, re.sub(r"^/(?=[A-Za-z]:)", "", unquote(parts.netloc + parts.path)), parts.query
    return scheme, parts.netloc + (parts.path if ways()[scheme].path else ""), parts.query
