"""Waits for somebody to talk to, on TCP or on a pseudo-terminal, and lets the protocol do the talking."""

from __future__ import annotations

import importlib
import pkgutil
import socket
from collections.abc import Callable

from tango_cnc.records import InputError

from . import protocols
from .lines import Closed, Line, ParityLine, PtyLine, TcpLine
from .protocols import Talk
from .session import Session

Wrapper = Callable[[Line], Line]  # a line → the same line with its faults


def talks() -> list[str]:
    """→ names of the protocols: the files of `protocols/`."""
    return sorted(m.name for m in pkgutil.iter_modules(protocols.__path__) if not m.name.startswith("_"))


def protocol(name: str) -> Talk:
    """name → the protocol. Raises InputError for one that there is no file for."""
    if name not in talks():
        raise InputError(f"--protocol: found {name!r}; allowed: {', '.join(talks())}")
    found: Talk = importlib.import_module(f"{protocols.__name__}.{name}").TALK
    return found


def protocols_by_port() -> dict[str, str]:
    """→ {how the URL of a port begins: protocol}; of several the first by name."""
    return {protocol(name).tcp.partition("{")[0]: name for name in reversed(talks())}


def serve_tcp(listening: socket.socket, talk: Talk, session: Session, *, parity: bool, once: bool, disturbed: Wrapper) -> None:
    """listening socket, protocol → one connection after the other, each with a control just switched on; one only with `once`."""
    with listening:
        while True:
            connection, _ = listening.accept()
            _talk(TcpLine(connection), talk, session, parity, once, disturbed)
            if once:
                return


def serve_pty(line: PtyLine, talk: Talk, session: Session, *, parity: bool, once: bool, disturbed: Wrapper) -> None:
    """pseudo-terminal, protocol → served until the process is ended, or one program has ended with `once`."""
    _talk(line, talk, session, parity, once, disturbed)


def _talk(line: Line, talk: Talk, session: Session, parity: bool, once: bool, disturbed: Wrapper) -> None:
    try:
        bad = disturbed(line)
        talk.serve(ParityLine(bad) if parity else bad, session, once)
    except Closed:
        session.note("line", state="closed")
    finally:
        line.close()
