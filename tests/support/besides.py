"""What is read beside a run: keys and certificates, the hosts that are known, what a night was to touch, the end of a journal."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import paramiko
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.x509.oid import NameOID

from support.mutants import Reader
from tango_cnc.files import read_cell
from tango_cnc.link import lock, transport
from tango_cnc.nightly.edited import edited
from tango_cnc.web import tls
from tango_cnc.web.live import touched_by

NIGHT = "2026-10-01T020000Z"
KEY = (  # of nobody
    "b3BlbnNzaC1rZXktdjEAAAAABG5vbmUAAAAEbm9uZQAAAAAAAAABAAAAMwAAAAtzc2gtZW",
    "QyNTUxOQAAACCJKxoZxgpOc9Vo0qpaiUpjQl2o3V5PCzqsoumOtXYgygAAAJDy0aiJ8tGo",
    "iQAAAAtzc2gtZWQyNTUxOQAAACCJKxoZxgpOc9Vo0qpaiUpjQl2o3V5PCzqsoumOtXYgyg",
    "AAAEAuiq7bXQiJVV4gwjlYCff2a4r6Ru75kfruuqMN9V5PzokrGhnGCk5z1WjSqlqJSmNC",
    "XajdXk8LOqyi6Y61diDKAAAAB3Jvb3RAdm0BAgMEBQY=",
)
PUBLIC = "AAAAC3NzaC1lZDI1NTE5AAAAIIkrGhnGCk5z1WjSqlqJSmNCXajdXk8LOqyi6Y61diDK"
HOSTS = f"a,10.0.0.1 ssh-ed25519 {PUBLIC}\n# mine\n[b]:2222 ssh-ed25519 {PUBLIC} anna\n|1|aGVsbG8=|d29ybGQ= ssh-ed25519 {PUBLIC}\n"
ENTRIES = [
    {"n": 0, "kind": "journal", "format": "tango-journal/1", "before": ""},
    {"n": 1, "kind": "begun", "before": "00", "utc": "2026-10-01T02:00:00.000+00:00", "time_s": 0.0},
    {"n": 2, "kind": "end", "before": "00", "complete": False, "stands": False, "why": "stopped by the user"},
]


def _key(folder: Path) -> bytes:
    word = "OPENSSH PRIVATE KEY"
    return "\n".join([f"-----BEGIN {word}-----", *KEY, f"-----END {word}-----", ""]).encode()


def _opened(folder: Path) -> None:
    transport._refused.opens(paramiko, {"key": str(folder / "key")})


def _known(folder: Path) -> None:
    before = os.environ.get("HOME", "")
    os.environ["HOME"] = str(folder)
    try:
        transport._refused.knows(paramiko.SSHClient())
    finally:
        os.environ["HOME"] = before


@cache
def _pair() -> tuple[bytes, bytes]:
    """→ certificate and key of a server, the same every time."""
    key = Ed25519PrivateKey.from_private_bytes(bytes(range(32)))
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "shop")])
    made = x509.CertificateBuilder(
        name, name, key.public_key(), 17, datetime(2026, 1, 1, tzinfo=UTC), datetime(2056, 1, 1, tzinfo=UTC)
    )
    pem = serialization.Encoding.PEM
    own = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    return made.sign(key, None).public_bytes(pem), own


def _served(folder: Path) -> None:
    for name, text in zip(("server.pem", "server.key"), _pair(), strict=True):
        if not (folder / name).exists():
            (folder / name).write_bytes(text)
    tls.checked(folder / "server.pem", folder / "server.key")


def _planned(folder: Path) -> None:
    touched_by(folder / "nights" / NIGHT / "readings.journal", read_cell(folder))


def _tail(folder: Path) -> bytes:
    return b"".join(b"00000000 %s\n" % json.dumps(entry).encode() for entry in ENTRIES)


def _broken_off(folder: Path) -> None:
    lock.broken_off(folder)
    lock.newest_run(folder)


def _edited(folder: Path) -> Any:
    last = SimpleNamespace(entry=1, night="2026-09-30")
    record = {"artefacts": {"folder": f"nights/{NIGHT}"}}
    past = SimpleNamespace(latest_knowledge=lambda machine: (last,), night=lambda entry: SimpleNamespace(record=record))
    text = (folder / "origin.json").read_bytes().decode("utf-8", "replace")
    disk = SimpleNamespace(read=lambda stamp, name: text)
    return edited(past, disk, "small", NIGHT, now={"machine.yaml": "name: other\n"})  # type: ignore[arg-type]


BESIDES: dict[str, Reader] = {
    "private-key": Reader("key", _key, _opened),
    "known_hosts": Reader(".ssh/known_hosts", lambda f: HOSTS.encode(), _known),
    "certificate": Reader("server.pem", lambda f: _pair()[0], _served),
    "key-of-certificate": Reader("server.key", lambda f: _pair()[1], _served),
    "planned.json": Reader(f"nights/{NIGHT}/planned.json", lambda f: b'{"kind": "full", "touches": [1, 2]}', _planned),
    "journal-tail": Reader("other.journal", _tail, _broken_off),
    "origin-of-a-night": Reader("origin.json", lambda f: json.dumps({"cell": {"machine.yaml": "name: small\n"}}).encode(), _edited),
}
