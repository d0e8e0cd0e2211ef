"""What the simulated control is where nobody states it: what the cell says of its own control, and of the port to it."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from tango_cnc.records import Cell, InputError

from . import named, server
from .session import Setup, language

HERE = re.compile(r"(localhost|127\.\d+\.\d+\.\d+|\[::1\]):\d+")  # this computer, and a port of it
ALLOWED = "one of them, or port: of this computer under controller: in tango.yaml (socket://127.0.0.1:8193, file:///tmp/TANGO.TXT)"


@dataclass(frozen=True)
class Place:
    """Where the simulated control is reached: one of TCP, pseudo-terminal and file of records; how it talks."""

    tcp: str | None
    pty: bool
    records: Path | None
    protocol: str


def place(cell: Cell, tcp: str | None, pty: bool, records: Path | None, protocol: str | None) -> Place:
    """cell, what is stated → where the control is reached; where nothing is stated, at the port of the cell.

    Raises InputError for several of them, and for a port that is not on this computer.
    """
    known = server.protocols_by_port()
    usual = known["socket://"]
    if (count := [tcp is not None, pty, records is not None].count(True)) == 1:
        return Place(tcp, pty, records, protocol or usual)
    port = cell.controller.port if cell.controller is not None and count == 0 else None
    scheme, separator, rest = (port or "").partition("://")
    where = re.split(r"[/?]", rest)[0]
    if scheme + separator in known and HERE.fullmatch(where):
        return Place(where, False, None, protocol or known[scheme + separator])
    if scheme == "file" and rest:
        path = re.sub(r"^/(?=[A-Za-z]:)", "", unquote(rest.partition("?")[0]))
        return Place(None, False, Path(path), protocol or usual)
    found = "several of --tcp, --pty, --records" if count else "none of --tcp, --pty, --records"
    raise InputError(f"found {found}{f', and port {port!r} in the cell' if port else ''}; allowed: {ALLOWED}")


def kind(cell: Cell, stated: str | None, settings: Mapping[str, str]) -> tuple[str, dict[str, str], tuple[str, ...]]:
    """cell, --language, {field: text} of --set → language, fields, lines of programs that are stored in the control.

    Where no language is stated, all three are those of the control that the post of the cell names, and its probe is wired as the
    profile says. A post of one's own says neither.
    """
    post, options = (cell.controller.post, cell.controller.options) if cell.controller is not None else ("", {})
    if stated is not None:
        return stated, dict(settings), ()
    if (control := named.stand_in(post)) is not None:
        keys = language(control.language).CONTROLS.wired
        wired = {name: str(options[key]) for key, name in keys.items() if type(options.get(key)) is int}
        return control.language, {**control.settings, **wired, **settings}, control.stored
    usual = Setup().family
    if post:
        print(f"sim_controller: no control is known by the name {post}: --language {usual} is taken", file=sys.stderr, flush=True)
    return usual, dict(settings), ()
