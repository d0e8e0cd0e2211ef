"""A history that does not answer, and what somebody has to look at then."""

from __future__ import annotations

from dataclasses import dataclass

from .remembered import file_of, looks_of


@dataclass(frozen=True)
class Away:
    """A history that does not answer: until when nobody asks it, why, its file, and what somebody has to look at."""

    until: float
    why: str
    file: object
    kind: str  # database, file, settings


def why_of(away: Away | None) -> str:
    """history that does not answer, None for none → why; ''."""
    return "" if away is None else away.why


def kind_of(away: Away | None) -> str:
    """history that does not answer, None for none → what somebody has to look at; ''."""
    return "" if away is None else away.kind


def look(where: str) -> object:
    """file or URL of a history → what differs once another file is there; None of a URL."""
    return None if "://" in where else (file_of(where), looks_of(where), looks_of(f"{where}-wal"))
