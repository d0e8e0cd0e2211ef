"""The folder of programs: which of its files belong to a plan of another day."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

PROGRAM = re.compile(rb"\bPROGRAM [0-9A-F]{12} PLAN ([0-9A-F]{12})\b")
REST = "rest"  # folder beside the program, for the touches that a run has left
HEAD = 2000  # bytes of a program within which its mark stands


def stale(folder: Path, written: Collection[Path], plan_mark: str) -> list[str]:
    """folder, files just written, hash of their plan → a sentence on each program there that is not theirs, those of `REST` too.

    A program of this plan for another control is not stale.
    """
    endings = {file.suffix for file in written}
    found = []
    for file in sorted(f for place in (folder, folder / REST) if place.is_dir() for f in place.iterdir()):
        if file in written or not file.is_file() or not (mark := PROGRAM.search(_head(file))):
            continue
        other = mark[1].decode() != plan_mark
        if other or file.suffix in endings:
            what = "of another plan" if other else "an earlier program of this plan"
            found.append(f"{file} is {what}. It was left as it is: delete it, so that nobody runs it")
    return found


def _head(file: Path) -> bytes:
    with file.open("rb") as opened:
        return opened.read(HEAD)
