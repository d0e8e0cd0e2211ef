"""Programs of an OSP file: a name O…, blocks, sequence names N…; comments in ( ), the file's own line with $ or %."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from .alarms import alarm

NAME = re.compile(r"O[A-Z0-9]{1,4}")
SEQUENCE = re.compile(r"(N[A-Z0-9]{1,5})(?:\s+(.*))?")
LOCAL = re.compile(r"(?![NOV])[A-Z]{2}[A-Z0-9]{0,2}")  # two letters, then up to two more signs


@dataclass
class Program:
    """Blocks without comments and sequence names, and where each of both is."""

    name: str
    blocks: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)  # what stands in brackets in each line

    def sequence(self, name: str) -> int:
        """sequence name → index of its block. Raises Alarm."""
        if name not in self.names:
            raise alarm("name", f"{name} in {self.name}")
        return self.names[name]


def split(lines: Iterable[str]) -> dict[str, Program]:
    """lines of a file → {name: program}, the first is the main one. Raises Alarm for a name that appears twice."""
    found: dict[str, Program] = {}
    current: Program | None = None
    for number, line in enumerate(lines, 1):
        if line.startswith(("%", "$")):
            continue
        text = re.sub(r"\([^)]*\)", "", line).strip()
        if NAME.fullmatch(text):
            if text in found:
                raise alarm("name", f"{text} appears twice")
            current = found[text] = Program(text)
            continue
        if current is None:
            if text:
                raise alarm("name", f"{text!r} before any program name")
            continue
        if match := SEQUENCE.fullmatch(text):
            if match[1] in current.names:
                raise alarm("name", f"{match[1]} appears twice in {current.name}")
            current.names[match[1]] = len(current.blocks)
            text = match[2] or ""
        current.blocks.append(text)
        current.lines.append(number)
        current.remarks.append(" ".join(re.findall(r"\(([^)]*)\)", line)))
    return found
