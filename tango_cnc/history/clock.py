"""Nights that the clock dates in the future: they are left out, and what the last of them has found must not be lost with them."""

from __future__ import annotations

from typing import Protocol

from ..texts import Said, say
from .records import Night


class Dated(Protocol):
    """A history that is read by a clock."""

    def nights(self, machine: str | None = None, last: int | None = None) -> tuple[Night, ...]:
        """machine, how many → nights that the clock does not date in the future, newest first."""

    def ahead(self, machine: str) -> tuple[Night, ...]:
        """machine → its nights that the clock dates in the future, newest first."""


def in_future(history: Dated, machine: str) -> Night | None:
    """history, machine → the night that measured last, where the clock dates it in the future; else None."""
    later = [n for n in history.ahead(machine) if n.verdict != "not_measured"]
    newest = max(later, key=lambda n: n.entry, default=None)
    if newest is None or any(
        n.entry > newest.entry and n.verdict != "not_measured" for n in history.nights(machine, 1 + len(later))
    ):
        return None
    return newest


def asks(night: Night) -> bool:
    """night that is left out → whether somebody has to look at what it has found."""
    return night.verdict != "good"


def told(night: Night) -> Said:
    """night that is left out → what it says, and what to do, as sentences."""
    return say("history.clock.left_out", night=night.night, headline=night.headline, entry=night.entry, alarms=int(asks(night)))
