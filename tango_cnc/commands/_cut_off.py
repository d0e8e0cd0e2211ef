"""Nights that were cut off: a power cut or a kill leaves their mark, and nobody else tells anybody before the next night."""

from __future__ import annotations

from pathlib import Path

from ..link.lock import at_work


def cut_off(folder: Path) -> list[str]:
    """folder of a cell → stamps of nights that were begun and have not ended while nobody is at work there any more."""
    try:
        begun = sorted(f.name for f in (folder / "nights" / "begun").iterdir() if not f.name.startswith("."))
    except OSError:
        return []
    return begun if begun and not at_work(folder) else []
