"""Fanuc and its relatives: Haas, Mitsubishi, Mazak EIA, Brother; without macros."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ..blocks import Block, Modal
from . import _iso

SAYS = "Fanuc and relatives (Haas, Mitsubishi, Mazak EIA, Brother)"
LENGTH = False
HEAD = re.compile(r"\s*(%|[oO:]\d+.*|<.*>.*|\(.*)?\s*")
STYLE = _iso.Style(
    re.compile(rf"(?P<letter>[A-Za-z])\s*(?P<value>{_iso.NUMBER})(?![#\[])"),
    re.compile(r"\([^)]*\)|^\s*[oO:]\d+|<[^>]*>"),
    {**_iso.REFUSED, 52.0: _iso.REFUSED[52], 100: "macros are not followed", 5.4: "what this does to the path is not known"},
    harmless=frozenset({"%"}),
)


def mark(text: str) -> str:
    """text → a comment line."""
    return f"({text.upper()})"


def read(line: str, number: int, modal: Modal, axes: str) -> Block:
    """line, its number, modal state, axes → block. Raises InputError by name; numbers of axes need a decimal point."""
    from ..blocks import refused

    block = _iso.read(STYLE, line, number, modal, axes)
    for w in block.words:
        if w.letter in "XYZABCIJKR" and "." not in line[w.begin : w.end] and w.value:
            raise refused(number, line[w.begin : w.end], "without a decimal point it may be millimetres or thousandths of them")
    return block


def write(block: Block, moves: Sequence[Mapping[str, float]], decimals: int) -> list[str]:
    """block, corrected parts → lines."""
    return _iso.write(block, moves, decimals)
