"""The ways in which bytes travel: each is declared in the file of `transport/` that opens it, and found there."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from .address import Address


def _nothing(address: Address) -> None:
    """Most ways have nothing to foresee."""


def _anything(address: Address, program: bytes) -> None:
    """Most ways take any program."""


def _open_already(port: Any) -> None:
    """Most ways have asked for all when they are open."""


def _silent(address: Address) -> str:
    """Most ways have nothing to say before a run."""
    return ""


@dataclass(frozen=True)
class Way:
    """How a port is opened, and what its URL has to name. `WAYS` of a file in `transport/` holds one for each of its ways."""

    open: Callable[[Address], Any]  # → an open Transport
    # host:port; a serial device; a file on a host; a file on this computer; another path of this computer, as of a UNIX socket
    needs: Literal["host", "device", "disk", "file", "path"]
    path: bool = False  # what stands after host or device in the URL belongs to the target
    uart: bool = False  # somebody keeps to the settings of the line: a driver, a converter
    unit: bool = False  # the URL ends with the number of a device
    stored: bool = False  # the control writes its records into a file that is not read as a file of this computer
    foreseen: Callable[[Address], None] = _nothing  # refuses what no run can use; opens nothing
    fits: Callable[[Address, bytes], None] = _anything  # refuses a program that can never go where the URL says; opens nothing
    look: Callable[[Any], None] = _open_already  # of an open port, where nothing is asked for before nothing moves
    before: Callable[[Address], str] = _silent  # what a person has to know of what is there already, before the run begins
    example: str = ""  # of a URL, for messages; "": one by `needs`
    advice: str = ""  # what to do where it does not open, a sentence; "": one by `needs`


@cache
def ways() -> Mapping[str, Way]:
    """→ {way: how it is opened}, of all files of `transport/`."""
    package = import_module(f"{__package__}.transport")
    found: dict[str, Way] = {}
    for module in sorted(one.name for one in pkgutil.iter_modules(package.__path__)):
        found |= vars(import_module(f"{package.__name__}.{module}")).get("WAYS", {})
    return found
