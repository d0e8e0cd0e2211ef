"""Lines of a tape → blocks: sequence number, comment, condensed text; and the words of an NC block."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal
from functools import cached_property, lru_cache

from .alarms import alarm
from .expressions import Expression, Get, arithmetic

_ALLOWED = re.compile(r"[A-Z0-9+\-*/=#\[\].,:;%]*")
_NUMBER = re.compile(r"\d*\.?\d*")
MACRO = re.compile(r"#|IF\[|WHILE\[|DO\d|END\d|GOTO|POPEN|PCLOS|DPRNT\[|BPRNT\[")


@dataclass(frozen=True)
class Block:
    """One line: text without spaces and comments, sequence number apart."""

    text: str
    number: int | None
    comment: str
    raw: str

    @cached_property
    def is_macro(self) -> bool:
        """→ whether it is a macro statement rather than an NC statement."""
        return MACRO.match(self.text) is not None


@dataclass(frozen=True)
class Word:
    """One address and its value; `literal` is how a plain number was spelt."""

    letter: str
    value: float
    literal: str | None


@lru_cache(4096)
def block(line: str) -> Block:
    """line without its end → block. Raises Alarm for characters that the control does not know."""
    comment = " ".join(re.findall(r"\(([^)]*)\)?", line))
    bare = re.sub(r"\([^)]*\)?", "", line)
    text = re.sub(r"[\s;]", "", bare)
    if not _ALLOWED.fullmatch(text):
        raise alarm("PS0009", line.strip())
    head = re.match(r"/\d?", text)
    rest = text[head.end() :] if head else text
    match = re.match(r"N(\d+)", rest)
    if match and not 1 <= int(match[1]) <= 99_999_999:
        raise alarm("PS0004", line.strip())
    return Block(rest[match.end() :] if match else rest, int(match[1]) if match else None, comment, line.strip())


def words(text: str, get: Get) -> Iterator[Word]:
    """condensed text → its words; a word whose variable is vacant is left out. Raises Alarm for what is no word."""
    at = 0
    while at < len(text):
        letter = text[at]
        if letter in "#=":
            raise alarm("PS0127", text)
        if not letter.isalpha():
            raise alarm("PS0004", text)
        at += 1
        bare = text[at + 1 :] if text.startswith(("-", "+"), at) else text[at:]
        if bare.startswith(("#", "[")):
            expression = Expression(text, get, at)
            value = expression.primary()
            at = expression.at
            if value is not None:
                yield Word(letter, arithmetic(value), None)
            continue
        start = at
        at += text.startswith(("-", "+"), at)
        match = _NUMBER.match(text, at)
        assert match is not None
        at = match.end()
        spelt = text[start:at]
        digits = spelt.lstrip("+-")
        if digits in ("", "."):
            raise alarm("PS0005", text)
        if text.startswith(".", at):
            raise alarm("PS0007", text)
        if len(digits.replace(".", "")) > 9:
            raise alarm("PS0003", text)
        yield Word(letter, float(spelt), spelt)


def axis_value(word: Word, increment: Decimal, calculator: bool) -> float:
    """axis word → mm or deg: without a decimal point in least increments, digits beyond them cut; variables are rounded."""
    if word.literal is None:
        return float(Decimal(repr(word.value)).quantize(increment, ROUND_HALF_UP))
    value = Decimal(word.literal)
    if "." not in word.literal and not calculator:
        value *= increment
    return float(value.quantize(increment, ROUND_DOWN))
