"""Programs with one thing wrong in them."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator

NUMBER = re.compile(r"(?<![#A-Z0-9.<_])-?\d*\.\d*|(?<=[XYZABCRIJKF])-?\d+\.\d*")
KINDS = ("deleted", "sign", "point", "digit", "swapped", "twice", "word")
WORDS = [
    ("G31", "G1"),
    ("G31", "G0"),
    ("G1 ", "G0 "),
    ("G38.3", "G1"),
    ("G38.3", "G38.2"),
    ("GT", "LT"),
    ("G90", "G91"),
    ("G21", "G20"),
]
WORDS += [
    ("G53 G0", "G0"),
    ("G53 G1", "G1"),
    ("G53 G1", "G53 G0"),
    ("X", "Y"),
    ("Y", "Z"),
    ("B", "C"),
    ("-", "+"),
    ("EQ", "NE"),
    ("THEN", ""),
]


def mutant(lines: list[str], rng: random.Random) -> tuple[str, int, list[str]]:
    """lines of a program, randomness → what was done, index of the line, the changed lines; never the same lines."""
    while True:
        kind, at = rng.choice(KINDS), rng.randrange(len(lines))
        for found in _changed(kind, lines, at, rng):
            if found != lines:
                return kind, at, found


def _changed(kind: str, lines: list[str], at: int, rng: random.Random) -> Iterator[list[str]]:
    before, line, after = lines[:at], lines[at], lines[at + 1 :]
    code = re.sub(r"\([^)]*\)$", "", line)
    if code in ("", "%") and not re.match(r"\((LOG|ABORT)", line):
        return
    numbers = [m for m in NUMBER.finditer(code) if m[0].strip("-.")]
    if kind == "deleted":
        yield before + after
    elif kind == "twice":
        yield [*before, line, line, *after]
    elif kind == "swapped" and after:
        yield [*before, after[0], line, *after[1:]]
    elif kind == "word":
        old, new = rng.choice(WORDS)
        yield [*before, code.replace(old, new, 1) + line[len(code) :], *after]
    elif numbers:
        m = rng.choice(numbers)
        text = m[0]
        if kind == "sign":
            text = text[1:] if text.startswith("-") else f"-{text}"
        elif kind == "point":
            text = text.replace(".", "")
        elif kind == "digit":
            place = rng.choice([i for i, c in enumerate(text) if c.isdigit()])
            text = text[:place] + str((int(text[place]) + rng.randint(1, 9)) % 10) + text[place + 1 :]
        yield [*before, line[: m.start()] + text + line[m.end() :], *after]
