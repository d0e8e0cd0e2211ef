"""Nights of a cell under another name of its machine: a name in machine.yaml that was changed takes no alarm away."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from ..texts import Said, say
from .answers import of_machine
from .records import Decision, Night


class Names(Protocol):
    """A history, as far as names are looked for in it."""

    def machines(self) -> tuple[str, ...]:
        """→ names."""

    def nights(self, machine: str | None = None, last: int | None = None) -> tuple[Night, ...]:
        """machine, how many → newest first."""

    def records(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """machine, how many → tango-night/1, newest first."""

    def alarmed(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """machine, how many → its nights with alarms, newest first."""

    def decisions(self, machine: str) -> Sequence[Decision]:
        """machine → what was decided, oldest first."""


@dataclass(frozen=True)
class Former:
    """Another name of the machine of a cell: its nights, the date of the last one, and its alarms that nobody has closed."""

    machine: str
    nights: int
    last: str
    alarms: tuple[Mapping[str, Any], ...]  # without an answer
    held: tuple[Mapping[str, Any], ...] = ()  # somebody has answered them: acknowledged, or ignored until a date

    def told(self, name: str, new: bool) -> Said:
        """name of the machine today, whether it has no night yet → what that means and what to do, as sentences."""
        values = {"old": self.machine, "name": name, "count": self.nights, "night": self.last, "machine": shlex.quote(self.machine)}
        counts = {"alarms": len(self.alarms)} | ({"held": len(self.held)} if self.held else {})
        return say(f"history.former.{'new' if new else 'known'}{'_held' if self.held else ''}", **values, **counts)


def formers(
    history: Names, name: str, folder: Path, within: bool = False, others: Collection[str] = (), today: str = ""
) -> tuple[Former, ...]:
    """history, name of the machine of a cell today, its folder, whether the history is a file in that folder, names of machines of
    other cells, local date ('': that of the clock) → the other names under which nights of this cell are in it.

    A night belongs to the cell that its record names. In a file of the cell every other name is one of this cell. What was ignored
    until a date counts as unanswered after that day.
    """
    found, today = [], today or datetime.now().astimezone().strftime("%Y-%m-%d")
    for other in history.machines():
        if other == name or not (newest := history.records(other, 1)):
            continue
        elsewhere = other in others or not within  # where another cell may have this name, the record says whose nights they are
        if elsewhere and not _same(str(newest[0].get("cell") or ""), folder):
            continue
        known = of_machine(history, other, today)
        open_, held = (tuple(known.newest[key][1] for key in keys) for keys in (known.unanswered(), known.held()))
        nights = history.nights(other)
        found.append(Former(other, len(nights), nights[0].night, open_, held))
    return tuple(found)


def of_folder(place: str | Path, folder: Path) -> bool:
    """history, folder of a cell → whether it is a file in that folder, and so of this cell alone."""
    return isinstance(place, Path) and place.resolve().parent == folder.resolve()


def _same(recorded: str, folder: Path) -> bool:
    try:
        return bool(recorded) and Path(recorded).resolve() == folder.resolve()
    except OSError:
        return False
