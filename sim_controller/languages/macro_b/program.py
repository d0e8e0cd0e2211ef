"""Programs as lists of blocks, possibly still arriving: sequence numbers, loops, several programs on one tape."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from .alarms import alarm
from .blocks import Block, block
from .expressions import Expression

_LOOP = re.compile(r"(?:WHILE\[.*\])?DO(\d+)|END(\d+)")


class Program:
    """Blocks by index; those of a drip-fed program are fetched when they are needed."""

    def __init__(self, name: str, lines: Iterable[str], streamed: bool = False) -> None:
        self.name, self.streamed = name, streamed
        self._source: Iterator[str] = iter(lines)
        self._blocks: list[Block] = []
        self._pairs: dict[int, int] | None = None

    def at(self, index: int) -> Block | None:
        """index from 0 → block, None after the last one. Raises Alarm for a line that cannot be read."""
        while len(self._blocks) <= index:
            line = next(self._source, None)
            if line is None:
                return None
            self._blocks.append(block(line))
        return self._blocks[index]

    def sequence(self, number: int, after: int) -> int:
        """sequence number, index → index of that block, looked for behind the present one first. Raises Alarm for none."""
        index = after + 1
        while (found := self.at(index)) is not None:
            if found.number == number:
                return index
            index += 1
        for index in range(min(after + 1, len(self._blocks))):
            if self._blocks[index].number == number:
                return index
        raise alarm("PS0128", f"N{number}")

    def partner(self, index: int) -> int:
        """index of DOm or ENDm → index of the other. Raises Alarm for loops that are not closed or cross each other."""
        if self._pairs is None:
            self._pairs = self._matched()
        return self._pairs[index]

    def _matched(self) -> dict[int, int]:
        pairs: dict[int, int] = {}
        begun: list[tuple[str, int]] = []
        index = 0
        while (found := self.at(index)) is not None:
            match = _LOOP.fullmatch(found.text)
            if match:
                number = match[1] or match[2]
                if number not in ("1", "2", "3"):
                    raise alarm("PS0126", found.raw)
                if match[1]:
                    begun.append((number, index))
                else:
                    if not begun or begun[-1][0] != number:
                        raise alarm("PS0124", found.raw)
                    start = begun.pop()[1]
                    pairs[start], pairs[index] = index, start
            index += 1
        if begun:
            raise alarm("PS0124", f"DO{begun[-1][0]} of {self.name}")
        return pairs


def main_of(tape: list[tuple[int, list[str]]]) -> tuple[int, list[str]]:
    """programs of a tape → the one that is started: the last one that ends with M30 or M02, else the first."""
    mains = [item for item in tape if any(re.match(r"\s*M(30|0?2)\b", line) for line in item[1])]
    return mains[-1] if mains else tape[0]


def split(lines: Iterable[str], stops: bool = False) -> list[tuple[int, list[str]]]:
    """lines of a tape → (O-number, its lines) of every program on it; lines before the first O-number are program 0.

    `stops`: reading ends with M30 or M02, and what stands behind it is not on the control.
    """
    programs: list[tuple[int, list[str]]] = []
    for line in lines:
        match = re.match(r"\s*[O:](\d+)", line)
        if match:
            programs.append((int(match[1]), []))
        elif line.strip():
            if not programs:
                programs.append((0, []))
            programs[-1][1].append(line)
            if stops and re.match(r"\s*M(30|0?2)\b", line):
                break
    return programs


def condition_and_rest(text: str, expression: Expression) -> tuple[bool, str]:
    """`[…]GOTO5` → truth of the bracket and what follows it. Raises Alarm when the bracket is no condition."""
    value = expression.bracketed()
    if not isinstance(value, bool):
        raise alarm("PS0114", f"no condition in {text!r}")
    return value, text[expression.at :]
