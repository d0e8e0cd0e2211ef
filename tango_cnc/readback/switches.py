"""Words of the profile in their places: the probe is on while anything moves, an axis is free while it turns, then held."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..records import InputError


class Switches:
    """What the words that a profile states have switched so far; one that states none wants none."""

    def __init__(self, options: Mapping[str, Any]) -> None:
        """options of a profile → nothing is switched yet."""
        self._on, self._off = options.get("probe_on") or "", options.get("probe_off") or ""
        self._unclamp: Mapping[str, str] = options.get("unclamp") or {}
        self._clamp: Mapping[str, str] = options.get("clamp") or {}
        self._watching = False
        self._loose: set[str] = set()
        self._unheld: set[str] = set()

    def switch(self, word: str) -> None:
        """A line of the program switches what its word stands for. An empty one, of which a comment was all, switches nothing."""
        if word and word in (self._on, self._off):  # one word for both switches over
            self._watching = not self._watching if self._on == self._off else word == self._on
        self._loose |= {name for name, own in self._unclamp.items() if own == word}
        held = {name for name, own in self._clamp.items() if own == word}
        self._loose -= held
        self._unheld -= held

    def moves(self) -> None:
        """A linear axis moves. Raises InputError while the probe is off or an axis is not held."""
        if self._on and not self._watching:
            raise InputError(f"something moves before {self._on} has switched the probe on, or after it was switched off")
        self._held()

    def turns(self, name: str) -> None:
        """axis letter: it turns. Raises InputError when nothing has freed it, or the axis before is not held."""
        self._held()
        if name in self._unclamp and name not in self._loose:
            raise InputError(f"{name} turns before {self._unclamp[name]} has freed it")
        if name in self._clamp:
            self._unheld.add(name)

    def ends(self) -> None:
        """The program is over. Raises InputError when the probe is still on or an axis is not held."""
        if self._off and self._watching:
            raise InputError(f"the program ends before {self._off} has switched the probe off")
        self._held()

    def _held(self) -> None:
        if self._unheld:
            name = min(self._unheld)
            raise InputError(f"something else happens before {self._clamp[name]} holds {name}")
