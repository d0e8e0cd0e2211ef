"""A row that a table of the documentation lacks, put where it belongs: what `TANGO_GOLDEN=write` does for the tests that ask."""

from __future__ import annotations

import os
import re
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]


def command(test: str) -> str:
    """test file and options → the command that writes what it finds missing, with the Python that these tests run on."""
    python = Path(sys.executable)
    shown = python.relative_to(ROOT) if python.is_relative_to(ROOT) else python
    return f"TANGO_GOLDEN=write {shown.as_posix()} -m pytest {test}"


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


def last(text: str, head: str, row: str) -> str:
    """page, first line of a table, row → the page with that row at the end of the table. Fails where no table begins so."""
    begin, there, rest = text.partition(f"{head}\n")
    assert there, f"no table begins with {head}"
    table, gap, after = rest.partition("\n\n")
    return f"{begin}{head}\n{table}\n{row}{gap}{after}"


def behind(text: str, head: str, words: str, row: str) -> str:
    """page, first line of a table, words, row → the page with that row behind the last one whose first cell has those words."""
    begin, _, rest = text.partition(f"{head}\n")
    table, gap, after = rest.partition("\n\n")
    rows = table.split("\n")
    place = max(i for i, other in enumerate(rows) if words in other.split(" | ")[0]) + 1
    return "\n".join([f"{begin}{head}", *rows[:place], row, *rows[place:]]) + gap + after


def names_in(text: str, head: str) -> dict[str, str]:
    """page, first line of a table → {name in the first cell of a row, where several may stand: the row}."""
    rows = text.split(f"{head}\n")[1].split("\n\n")[0].splitlines()[1:]
    return {name.strip("` "): row for row in rows for name in row.split(" | ")[0].strip("|").split(",")}


def beside(text: str, head: str, name: str, relatives: Iterable[str], row: str) -> str:
    """page, first line of a table, name, its relatives, row → the page with the name in the row that most relatives share.

    Where none of them has a row, `row` comes to the end of the table.
    """
    known = names_in(text, head)
    shared = [known[relative] for relative in relatives if relative in known]
    if not shared:
        return last(text, head, row)
    old = max(shared, key=shared.count)
    first, cells = old.removeprefix("| ").split(" | ", 1)
    there = first.split(", ")
    now = [*there, f"`{name}`" if first.startswith("`") else name]
    return text.replace(old, f"| {', '.join(sorted(now) if there == sorted(there) else now)} | {cells}")


def sentence(names: Iterable[str]) -> str:
    """names → as a sentence of the documentation has them."""
    *most, end = (name.capitalize() for name in sorted(names))
    return f"{', '.join(most)} and {end}" if most else end


def with_list(text: str, before: str, after: str, now: str) -> str:
    """page, words before and behind a list of names, list → the page with that list, its paragraph broken into lines anew.

    Fails where the page lacks the words.
    """
    around = re.compile(rf"({_spaced(before)}\s+)[A-Z][\w,\s]*?(?=\s*{_spaced(after)})")
    blocks = re.split(r"(\n\n|\n(?=\* ))", text)
    (place,) = [i for i, block in enumerate(blocks) if around.search(block)]
    words = " ".join(around.sub(lambda found: f"{found[1]}{now}", blocks[place]).split())
    indent = "  " if words.startswith("* ") else ""
    blocks[place] = textwrap.fill(words, 100, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False)
    return "".join(blocks)


def _spaced(words: str) -> str:
    return r"\s+".join(map(re.escape, words.split()))
