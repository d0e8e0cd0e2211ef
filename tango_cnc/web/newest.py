"""A history in which former names of a machine are looked for, read once: each machine's newest record until something is added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..history import Decision, History, Night


@dataclass(frozen=True)
class NewestRecords:
    """Of a history that 200 machines share each newest record would be read again whenever one of them has had a night.

    `heads`: the end of the chain of each machine; `known`: what was read before, by machine, with the end that it was read at.
    """

    history: History
    heads: Mapping[str, object]
    known: dict[str, tuple[object, tuple[Any, ...]]]

    def machines(self) -> tuple[str, ...]:
        """→ names, in the order of the alphabet."""
        return self.history.machines()

    def nights(self, machine: str | None = None, last: int | None = None) -> tuple[Night, ...]:
        """machine, how many → newest first."""
        return self.history.nights(machine, last)

    def records(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """machine, how many → tango-night/1, newest first."""
        if last != 1:
            return self.history.records(machine, last)
        head, before = self.heads.get(machine), self.known.get(machine)
        if head is None or before is None or before[0] != head:
            before = self.known[machine] = head, self.history.records(machine, 1)
        return before[1]

    def alarmed(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """machine, how many → its nights with alarms, newest first."""
        return self.history.alarmed(machine, last)

    def decisions(self, machine: str) -> Sequence[Decision]:
        """machine → what was decided, oldest first."""
        return self.history.decisions(machine)
