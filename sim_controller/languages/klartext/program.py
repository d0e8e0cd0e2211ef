"""Klartext programs as files: numbered blocks, labels, comments."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from .expressions import error


def blocks_of(lines: Iterable[str]) -> list[str]:
    """numbered lines → blocks without their numbers. Raises Alarm unless they count from 0 between BEGIN PGM and END PGM."""
    blocks: list[str] = []
    for i, line in enumerate(_whole(line for line in lines if line.strip())):
        match = re.fullmatch(r"(\d+) (.*)", line.rstrip())
        if match is None or int(match[1]) != i:
            raise error("BLOCK NUMBER FAULTY", line.strip())
        blocks.append(match[2].strip())
    begun = re.fullmatch(r"BEGIN PGM (\S+) MM", blocks[0]) if blocks else None
    if begun is None or blocks[-1] != f"END PGM {begun[1]} MM":
        raise error("PROGRAM IS INCOMPLETE")
    return blocks


def _whole(lines: Iterable[str]) -> Iterator[str]:
    """lines → blocks: what ends with a ~ goes on with the next line, remarks taken out."""
    begun: list[str] = []
    for line in lines:
        text = line.rstrip()
        begun.append(bare(text.removesuffix("~")) if begun or text.endswith("~") else line)
        if not text.endswith("~"):
            yield " ".join(begun)
            begun = []
    if begun:
        raise error("PROGRAM IS INCOMPLETE")


def labels_of(blocks: list[str]) -> dict[str, int]:
    """blocks → {label: index of its block}. Raises Alarm for one that appears twice."""
    labels: dict[str, int] = {}
    for i, block in enumerate(blocks):
        match = re.fullmatch(r"LBL ([1-9]\d*)", bare(block))
        if match:
            if match[1] in labels:
                raise error("LABEL NUMBER ALLOCATED TWICE", block)
            labels[match[1]] = i
    return labels


def place_of(labels: Mapping[str, int], which: str) -> int:
    """label → index of its block. Raises Alarm for none."""
    if which not in labels:
        raise error("LABEL NUMBER NOT FOUND", which)
    return labels[which]


def bare(block: str) -> str:
    """block → without comment; a `;` in a text begins none."""
    match = re.match(r'(?:[^";]|"[^"]*"?)*', block)
    assert match is not None
    return match[0].strip()
