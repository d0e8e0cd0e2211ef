"""Whether readings were made by a program that switches tool center point control off: what their record and the post say."""

from __future__ import annotations

from pathlib import Path

import postprocessors as posts

from ..files.origin import by_no_machine, read_origin
from ..records import Cell


def switched_off(cell: Cell, readings: Path) -> bool:
    """cell, readings → whether they are on record as measured by a program of this project that switches it off."""
    known = read_origin(readings) or {}
    if cell.controller is None or by_no_machine(known) or not (known.get("run") or {}).get("program_hash"):
        return False
    post = posts.load(cell.controller.post)
    option, word = post.tcp_off
    given = {o.name: o.default for o in post.options} | dict(cell.controller.options)
    return bool(option) and given.get(option) not in (None, False) and word in str(given[option]).upper()
