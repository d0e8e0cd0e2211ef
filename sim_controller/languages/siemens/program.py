"""Sinumerik programs as lists of blocks: labels, comments, structures, jumps."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .alarms import alarm


@dataclass(frozen=True)
class Block:
    """One line without comment; label apart."""

    text: str
    label: str | None
    raw: str


def block_of(line: str) -> Block:
    """line → block; a `;` in a string begins no comment."""
    text = re.match(r'(?:[^";]|"[^"]*"?)*', line)
    assert text is not None
    bare = re.sub(r"^(N\d+\s*)", "", text[0].strip())
    label = re.match(r"([A-Za-z_]{2}[A-Za-z0-9_]*)\s*:(?!=)", bare)
    return Block(bare[label.end() :].strip() if label else bare, label[1].upper() if label else None, line.strip())


def partners_of(blocks: list[Block]) -> dict[int, int]:
    """→ index of IF → its ELSE or ENDIF, of ELSE → its ENDIF, of WHILE and ENDWHILE → each other.

    Raises Alarm for what is not closed.
    """
    pairs: dict[int, int] = {}
    begun: list[int] = []
    for index, block in enumerate(blocks):
        text = block.text.upper()
        jumps = re.search(r"\bGOTO[FB]?\b", re.sub(r'"[^"]*"', "", text))
        if text.startswith("WHILE") or (text.startswith("IF") and not jumps):
            begun.append(index)
        elif text in ("ELSE", "ENDIF", "ENDWHILE"):
            if not begun or blocks[begun[-1]].text.upper().startswith("WHILE") != (text == "ENDWHILE"):
                raise alarm("12640", block.raw)
            if text == "ENDWHILE":
                pairs[index] = begun[-1]
            pairs[begun.pop()] = index
            if text == "ELSE":
                begun.append(index)
    if begun:
        raise alarm("12640", blocks[begun[-1]].raw)
    return pairs


def jumped_to(blocks: list[Block], index: int, jump: str, label: str) -> int:
    """blocks, index, GOTOF GOTOB or GOTO, label → index of its block. Raises Alarm for none in that direction."""
    ahead, behind = range(index + 1, len(blocks)), range(index, -1, -1)
    for at in {"GOTOF": [*ahead], "GOTOB": [*behind], "GOTO": [*ahead, *behind]}[jump]:
        if blocks[at].label == label:
            return at
    raise alarm("14080", label)
