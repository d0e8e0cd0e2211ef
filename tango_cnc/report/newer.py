"""A report that was made of readings after the newest night, and says No by them: whoever answers for the machine asks here."""

from __future__ import annotations

import json
from pathlib import Path

NAME = "report.html"
SAID = "report.json"  # beside it: what pages ask of it; a shop's own template of the page need not know of that
FORMAT = "tango-report-answer/1"
MOST = 100_000  # characters of a file that can be one


def report_of(folder: Path | None) -> Path | None:
    """folder of a cell, None for none → its report; None when it has none, or when the file links to a place outside the cell."""
    if folder is None:
        return None
    root = folder.resolve()
    file = (root / NAME).resolve()
    return file if file.is_relative_to(root) and file.is_file() else None


def says_no(folder: Path | None, ended_utc: object) -> bool:
    """folder of a cell, moment at which its newest night ended → whether its report was made of readings that are newer than that
    night, and says No by them. A report of an earlier version says nothing of it, nor does a file that cannot be read.
    """
    if not ended_utc or (file := report_of(folder)) is None:
        return False
    said = file.with_name(SAID)
    try:
        if said.resolve() != said or not said.is_file():
            return False
        with said.open(encoding="utf-8", errors="replace") as text:
            found = json.loads(text.read(MOST))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(found, dict) and found.get("format") == FORMAT and found.get("no_after") == str(ended_utc)


def answer_text(may: str, no_after: str) -> str:
    """whether parts may be made by a report, when the newest night ended that its No is newer than ('': none) → text of its
    report.json.
    """
    return json.dumps({"format": FORMAT, "may_make_parts": may, "no_after": no_after or None}, indent=1) + "\n"
