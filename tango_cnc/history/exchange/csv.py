"""Comma-separated values, one row a night and parameter; values in mm, rad, mm/mm …"""

from __future__ import annotations

import csv
import io
from pathlib import Path

from ...files import write_text
from ..store import History
from ._rows import COLUMNS, rows

ENDINGS = (".csv",)
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # with which a formula begins


def write(history: History, machine: str, file: Path, entry: int) -> None:
    """history, machine, file → written; `entry` is not used."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows(history, machine):
        writer.writerow([repr(v) if isinstance(v, float) else _text(v) if isinstance(v, str) else v for v in row])
    write_text(file, out.getvalue())


def _text(value: str) -> str:
    """text → the same; with an apostrophe in front where a spreadsheet would take it for a formula and compute it."""
    return f"'{value}" if value.startswith(FORMULA) else value
