"""RS-274/NGC as LinuxCNC, grbl and Mach understand it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ..blocks import Block, Modal
from . import _iso

SAYS = "RS-274: LinuxCNC, grbl, Mach"
READS = ("rs274", "grbl", "mach3", "mach4")
LENGTH = False
COUNTED = False
UNITS = ("G21", "G90")
HEAD = re.compile(r"\s*(%|[oO]\d+\b.*|[;(].*)?\s*")
STYLE = _iso.Style(
    re.compile(rf"(?P<letter>[A-Za-z])\s*(?P<value>{_iso.NUMBER})(?![#\[])"),
    re.compile(r"\([^)]*\)|;.*|^\s*[oO]\d+(?=\s*(?:$|[(;]))"),
    _iso.REFUSED,
    passed=frozenset({21, 40, 61, 61.1, 64, 80, 90.1, 91.1, 94, 95, 97, 98, 99}),
    alone=frozenset({28.1, 30.1, 69, 92.1}),  # 28.1 and 30.1: LinuxCNC stores a place, Mach goes there
    offsets=frozenset({*range(54, 60), 59.1, 59.2, 59.3}),
    numbered=frozenset({64}),
)


def mark(text: str) -> str:
    """text → a comment line."""
    return f"({text})"


def read(line: str, number: int, modal: Modal, axes: str) -> Block:
    """line, its number, modal state, axes → block. Raises InputError by name."""
    return _iso.read(STYLE, line, number, modal, axes)


def write(block: Block, moves: Sequence[Mapping[str, float]], decimals: int) -> list[str]:
    """block, corrected parts → lines."""
    return _iso.write(block, moves, decimals)
