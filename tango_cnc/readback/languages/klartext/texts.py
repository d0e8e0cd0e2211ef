"""What Klartext is made of: labels, formulas, and texts that are put together piece by piece."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache

from ....records import InputError

PIECE = re.compile(r"\s*(?:(QS\d)|TOCHAR \( DAT\+(Q\d+) DECIMALS(\d) \))\s*")
START = re.compile(r"TANGO START ([0-9A-F]{12}) (\d+)")
END = re.compile(r"TANGO END ([0-9A-F]{12}) (\d+)")
RECORD = re.compile(r"P\{(Q\d+):0\} H\{(Q\d+):0\}((?: [A-Z]\{Q\d+:4\})+)")
STALE = "{}"  # a text that holds a parameter which has got another value since


def whole(lines: Iterable[str]) -> Iterator[str]:
    """lines → blocks: what ends with a ~ goes on in the next line, without its remark."""
    begun = ""
    for line in lines:
        text = line.rstrip()
        more = text.endswith("~")
        begun += f" {text.rstrip('~').partition(';')[0].strip()}" if begun or more else line
        if not more:
            yield begun.lstrip()
            begun = ""
    if begun:
        raise InputError("the last line goes on with ~")


@lru_cache(maxsize=4096)
def spelt(text: str) -> str:
    """formula as this control spells it → as the reader of expressions does."""
    text = re.sub(r"Q\d+", lambda match: f"#<{match[0]}>", text)
    return text.replace("(", "[").replace(")", "]").replace("^", "**").replace("INT", "FIX")


def labels(blocks: Iterable[str]) -> dict[str, list[str]]:
    """blocks → {label: blocks up to its LBL 0, bare} of those behind M30. Raises InputError for a label that appears twice."""
    found: dict[str, list[str]] = {}
    known: set[str] = set()
    behind, current = False, ""
    body: list[str] = []
    for block in blocks:
        code = block.partition(";")[0].strip()
        if match := re.fullmatch(r"LBL ([1-9]\d*)", code):
            if match[1] in known:
                raise InputError(f"label {match[1]} appears twice")
            known.add(match[1])
        if not behind:
            behind = code == "M30"
        elif match and not current:
            current, body = match[1], []
        elif code == "LBL 0" and current:
            found[current], current = body, ""
        elif current and code:
            body.append(code)
    return found


class Texts:
    """String parameters, each as text with {Q parameter:decimals} where numbers are."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}

    def changed(self, parameter: str) -> None:
        """Q parameter with another value from now on: what a text says of it is no longer true."""
        stale = re.compile(rf"\{{{parameter}:\d\}}")
        self._texts = {name: stale.sub(STALE, text) for name, text in self._texts.items()}

    def assign(self, name: str, source: str) -> None:
        """QS1, pieces joined by || → it holds that. Raises InputError for what is none."""
        found = ""
        for part in source.split("||"):
            match = PIECE.fullmatch(part)
            if match is None or (match[1] and match[1] not in self._texts):
                raise InputError(f"{part.strip()!r} is no string parameter, or one without value")
            found += self._texts[match[1]] if match[1] else f"{{{match[2]}:{match[3]}}}"
        self._texts[name] = found

    def declare(self, name: str, text: str) -> None:
        """QS1, characters → it holds them."""
        self._texts[name] = text

    def printed(self) -> tuple[str, list[str]]:
        """→ what QS1 is (start, end, record), and its values; those of a record as letter and expression. Raises InputError."""
        text = self._texts.get("QS1", "")
        if match := START.fullmatch(text):
            return "start", [match[1], match[2]]
        if match := END.fullmatch(text):
            return "end", [match[1], match[2]]
        if match := RECORD.fullmatch(text):
            places = re.findall(r" ([A-Z])\{(Q\d+):4\}", match[3])
            return "record", [f"#<{match[1]}>", f"#<{match[2]}>", *(f"{letter}#<{q}>" for letter, q in places)]
        raise InputError(f"nobody knows what {text!r} is")
