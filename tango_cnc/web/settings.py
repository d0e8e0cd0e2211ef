"""What a server was started with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Role = Literal["view", "operate", "write-back"]
ROLES: tuple[Role, ...] = ("view", "operate", "write-back")
LOOPBACK = ("127.0.0.1", "::1", "localhost")


@dataclass(frozen=True)
class Settings:
    """Cells to show, the history of a fleet, who may do what, and under which names the server is called."""

    cells: tuple[Path, ...]
    history: str | None = None  # file or URL of one history for all; None: each cell's own
    users: Path | None = None  # None: everybody who reaches this computer sees all and changes nothing
    names: tuple[str, ...] = LOOPBACK  # allowed in the header Host
    https: bool = False
    late_hours: float = 36.0
    templates: Path | None = None
    find: Callable[[], tuple[Path, ...]] | None = None  # the cells that there are now; None: always those of `cells`
    rate: float = 200.0  # requests a second of one address, and twice as many at once
    behind_proxy: bool = False  # a request from this computer may be one of a stranger that a proxy hands on


def may(role: Role | None, wanted: Role) -> bool:
    """role of a user or None, role that is wanted → whether it is enough."""
    return role is not None and ROLES.index(role) >= ROLES.index(wanted)
