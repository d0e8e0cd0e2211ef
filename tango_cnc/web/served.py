"""A machine as pages name it, and as the list of all has it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..history import History, Night, Standing


@dataclass(frozen=True)
class Served:
    """One machine: its place in addresses, its name, its cell where it is on this computer, its history where it has one."""

    slug: str
    name: str
    folder: Path | None
    history: History | None
    trouble: str = ""  # why its cell cannot be read
    unread: str = ""  # what somebody has to look at whose history cannot be read (database, file, settings): nothing is known then
    former: tuple[str, ...] = ()  # nights cut off, what its cell has under other names, or dated in the future, as sentences


@dataclass(frozen=True)
class Row:
    """A machine in the list of the fleet."""

    machine: Served
    standing: Standing | None
    nights: tuple[Night, ...]  # of the strip, newest first
    record: Mapping[str, Any] | None = None  # of the newest night
    before: Mapping[str, Any] | None = None  # where that one did not measure: of the last that did


def slug_of(name: str) -> str:
    """name of a machine → its part of an address: letters, digits, - and _; with a mark of its own where letters were lost."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-")[:60]
    return plain if plain == name else f"{plain or 'machine'}-{hashlib.sha256(name.encode()).hexdigest()[:6]}"
