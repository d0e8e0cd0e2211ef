"""A row that a table of the documentation lacks, put where it belongs: what `TANGO_GOLDEN=write` does for the tests that ask."""

from __future__ import annotations

import os


def writing() -> bool:
    """→ whether this run writes what is missing (`TANGO_GOLDEN=write`)."""
    return os.environ.get("TANGO_GOLDEN") == "write"


def added(text: str, head: str, row: str) -> str:
    """page, first line of a table, row → the page with that row before the first one that comes after it in the alphabet.

    Fails where no table begins so.
    """
    begin, there, rest = text.partition(f"{head}\n")
    assert there, f"no table begins with {head}"
    table, gap, after = rest.partition("\n\n")
    rule, *rows = table.split("\n")
    place = next((i for i, other in enumerate(rows) if other > row), len(rows))
    return "\n".join([f"{begin}{head}", rule, *rows[:place], row, *rows[place:]]) + gap + after
