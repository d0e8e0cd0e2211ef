"""The protocols of the link: a file of this folder is a protocol, and its name the name that `link=` and posts give it.

URL ──SCHEMES──▶ protocol: a file with `Client`, `OPTIONS` and `SCHEMES`  (`Module` says what they are)
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Protocol, cast

from ...records import InputError
from ..client import Client


class Module(Protocol):
    """What the file of a protocol holds."""

    @property
    def Client(self) -> type[Client]:
        """→ the class of its clients."""

    @property
    def OPTIONS(self) -> Mapping[str, tuple[str, ...]]:
        """→ {setting of the port's URL: allowed values, the usual one first; none for any text}."""

    @property
    def SCHEMES(self) -> Mapping[str, str]:
        """→ {scheme of a URL that only this protocol has: how it travels, one of `link.ways.ways()`}."""


def names() -> list[str]:
    """→ names of the protocols: the files of this folder that are no helpers."""
    return [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]


def load(name: str) -> Module:
    """name of a protocol → its module.

    Raises ModuleNotFoundError for a name that is none of `names()`, InputError for a file that lacks something.
    """
    found = import_module(f"{__package__}.{name}")
    lacking = [part for part in ("Client", "OPTIONS", "SCHEMES") if part not in vars(found)]
    if lacking:
        raise InputError(f"{found.__file__}: found no {', '.join(lacking)}; docs/link.md, 'Another protocol', says what they are")
    return cast(Module, found)


@cache
def schemes() -> Mapping[str, tuple[str, str]]:
    """→ {scheme of a URL: (protocol, how it travels)}, of all protocols."""
    return {scheme: (name, way) for name in names() for scheme, way in load(name).SCHEMES.items()}
