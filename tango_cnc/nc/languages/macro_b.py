"""Fanuc and its relatives: Haas, Mitsubishi, Mazak EIA, Brother; without macros."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ..blocks import Block, Modal, refused
from . import _iso

SAYS = "Fanuc and relatives (Haas, Mitsubishi, Mazak EIA, Brother)"
READS = ("macro_b",)
LENGTH = False
COUNTED = False
UNITS = ("G21", "G90")
HEAD = re.compile(r"\s*(%|[oO:]\d+.*|<.*>.*|\(.*)?\s*")
OWN: dict[float, str] = {
    12: "pockets are cycles: let the post-processor write their moves",
    13: "pockets are cycles: let the post-processor write their moves",
    150: "pockets are cycles: let the post-processor write their moves",
    63: "tapping is not compensated",
    47: "engraving is a cycle: let the post-processor write its moves",
    66.1: "macros are not followed: expand them in the post-processor",
    7.1: "polar and cylindrical interpolation is not followed",
    107: "polar and cylindrical interpolation is not followed",
    112: "polar and cylindrical interpolation is not followed",
    100: "mirroring is not followed",
    101: "mirroring is not followed",
    141: "radius compensation changes the path after this program",
    154: "additional work offsets are not followed",
    234: _iso.REFUSED[43.4],
    254: "offsets that follow the table are not followed: compensate the control instead",
    268: "tilted planes are not followed",
    **dict.fromkeys(range(110, 112), "additional work offsets are not followed"),
    **dict.fromkeys(range(113, 130), "additional work offsets are not followed"),
}
STYLE = _iso.Style(
    re.compile(rf"(?P<letter>[A-Za-z])\s*(?P<value>{_iso.NUMBER})(?![#\[])"),
    re.compile(r"\([^)]*\)|^\s*[oO:]\d+|<[^>]*>"),
    {k: v for k, v in _iso.REFUSED.items() if k not in (5.1, 15)} | OWN,
    harmless=frozenset({"%", ";"}),
    # 9, 61, 62 and 64 say how exactly, 94 and 95 what F is, 98 and 99 where cycles end.
    passed=frozenset({9, 21, 40, 61, 62, 64, 80, 94, 95, 97, 98, 99}),
    # 5.1, 8 and 103 look ahead, 187 says how exactly, 13.1 15 50 67 69 cancel; 22 23 25 26 supervise, and X of 22 is a limit.
    alone=frozenset({5.1, 8, 13.1, 15, 22, 23, 25, 26, 50, 67, 69, 103, 187}),
    forgets=frozenset({28, 30, 30.1}),
    dwell="X",
    numbered=frozenset({5.1, 8, 103, 187}),
)


def mark(text: str) -> str:
    """text → a comment line."""
    return f"({text.upper()})"


def read(line: str, number: int, modal: Modal, axes: str) -> Block:
    """line, its number, modal state, axes → block. Raises InputError by name; numbers of axes need a decimal point."""
    block = _iso.read(STYLE, line, number, modal, axes)
    if any(w.letter == "Q" and w.value not in (0, 1) for w in block.words):
        raise refused(number, "G5.1 with Q2 or more", "smoothing would take the correction away: let it be Q1")
    for w in block.words:
        if w.letter in "XYZABCIJKR" and "." not in line[w.begin : w.end] and w.value:
            raise refused(number, line[w.begin : w.end], "without a decimal point it may be millimeters or thousandths of them")
    return block


def write(block: Block, moves: Sequence[Mapping[str, float]], decimals: int) -> list[str]:
    """block, corrected parts → lines."""
    return _iso.write(block, moves, decimals)
