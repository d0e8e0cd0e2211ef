"""The address that pages are served at: taken before anything is printed, or a sentence that says who has it and what to do."""

from __future__ import annotations

import errno
import os
import socket
from contextlib import suppress
from pathlib import Path

from ..files.checked import printable
from ..records import InputError

PROC = Path("/proc")
LISTENS = "0A"  # state of a socket in /proc/net/tcp


def listening(host: str, port: int) -> socket.socket:
    """address, port (0: a free one) → the socket that listens there.

    Raises InputError where another program has the port, where this user may not have it, and where the address is not of this
    computer.
    """
    try:
        family, kind, proto, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except socket.gaierror:
        raise InputError(
            f"--host: found {host}, which is no address of this computer; allowed: 127.0.0.1, or one of its own"
        ) from None
    taken = socket.socket(family, kind, proto)
    if os.name == "posix":  # a port whose last connections are still closing is free; Windows would share it with another program
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        taken.bind(address)
        taken.listen()
    except OSError as error:
        taken.close()
        raise _refused(host, port, error) from None
    return taken


def _refused(host: str, port: int, error: OSError) -> InputError:
    if error.errno == errno.EADDRINUSE:
        who = holder(port)
        return InputError(
            f"--port: {port} of {host} is in use: "
            + (
                f"{who} listens there"
                if who
                else "another program listens there ('ss -ltnp' says which; on Windows 'netstat -ano')"
            )
            + f". Open http://{host}:{port}/ to see whether it is a 'tango serve' that shows "
            f"these machines already; end that program, or take another port: --port {port + 1 if port < 65535 else 8026}"
        )
    if error.errno == errno.EACCES:
        return InputError(
            f"--port: {port} is not for this user (below 1024 only root may listen); allowed: another one, such as --port 8026"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return InputError(f"--host: found {host}, which is no address of this computer; allowed: 127.0.0.1, or one of its own")
    return InputError(f"--port: nothing can listen at {host}, port {port}: {error.strerror}; allowed: another address or port")


def holder(port: int) -> str:
    """port → number and name of the program that listens there; '' where this computer does not say. No argument of it: one
    may be a secret.
    """
    wanted = _inodes(port)
    if not wanted:
        return ""
    for process in PROC.glob("[0-9]*"):
        with suppress(OSError):
            if any(os.readlink(link) in wanted for link in (process / "fd").iterdir()):
                name = (process / "comm").read_text(encoding="utf-8", errors="replace").strip()
                return f"process {process.name} ({printable(name)})"
    return ""


def _inodes(port: int) -> set[str]:
    """port → names of the sockets that listen there, as /proc/N/fd has them."""
    found = set()
    for table in (PROC / "net" / "tcp", PROC / "net" / "tcp6"):
        with suppress(OSError):
            rows = [line.split() for line in table.read_text(encoding="ascii").splitlines()[1:]]
            found |= {f"socket:[{row[9]}]" for row in rows if row[3] == LISTENS and int(row[1].rpartition(":")[2], 16) == port}
    return found
