"""A report that was made of readings after the newest night, and says No by them: whoever answers for the machine asks here."""

from __future__ import annotations

import re
from pathlib import Path

NAME = "report.html"
NO_AFTER = re.compile(r'<meta name="tango-no-after" content="([0-9T:Z+.-]+)">')
HEAD = 2000  # characters of a report in which it says so


def report_of(folder: Path | None) -> Path | None:
    """folder of a cell, None for none → its report; None when it has none, or when the file links to a place outside the cell."""
    if folder is None:
        return None
    root = folder.resolve()
    file = (root / NAME).resolve()
    return file if file.is_relative_to(root) and file.is_file() else None


def says_no(folder: Path | None, ended_utc: object) -> bool:
    """folder of a cell, moment at which its newest night ended → whether its report was made of readings that are newer than that
    night, and says No by them. A report of an earlier version says nothing of it.
    """
    if not ended_utc or (file := report_of(folder)) is None:
        return False
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            found = NO_AFTER.search(text.read(HEAD))
    except OSError:
        return False
    return found is not None and found[1] == str(ended_utc)
