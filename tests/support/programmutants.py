"""Programs with one thing wrong in them: what a bad edit, a bad line or a bad post does to them."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator

NUMBER = re.compile(r"(?<![#A-Z0-9.<_])\d*\.\d*|(?<=[XYZABCRIJKFP])\d+\.\d*|(?<=[-+])\d+\.\d*")
KINDS = ("deleted", "guard", "passage", "sign", "point", "digit", "lost digit", "unit", "swapped", "twice", "word")
GUARD = re.compile(r"#3000|#3006|GOTO|ABORT|\bIF\b|VDOUT|STOPRE|WAIT FOR SYNC|^G53$|#\[?50[246]\d|MEAS=|ERROR")
UNITS = [("G21", "G20"), ("G71", "G70"), ("G94", "G95"), ("G90", "G91"), (" MM", " INCH"), ("M91", "M92"), ("F", "F0"), ("G94", "")]
WORDS = [
    *(("G31", "G1"), ("G31", "G0"), ("G1 ", "G0 "), ("G38.3", "G1"), ("G38.3", "G38.2"), ("G53 G0", "G0"), ("G53 G1", "G1")),
    *(
        ("G53 G1", "G53 G0"),
        ("GT", "LT"),
        ("LT", "GT"),
        (">", "<"),
        ("EQ", "NE"),
        ("<>", "=="),
        ("THEN", ""),
        ("X", "Y"),
        ("Y", "Z"),
    ),
    *(("B", "C"), ("-", "+"), ("+", "-"), ("SUPA ", ""), (" MEAS=1", ""), ("D0 ", "D1 "), ("DC(", "AC("), ("AC(", "IC(")),
    *(("$AA_MM", "$AA_IM"), ("$AA_IM", "$AA_IW"), ("TG_STOP_2", "TG_STOP_3"), ("OR", "AND"), ("GOTOF", "GOTOB")),
    *((" M91", ""), ("SYSTEM: 1", "SYSTEM: 0"), ("ID240", "ID270"), ("IDX1", "IDX2"), ("Q21", "Q22"), ("LBL 1", "LBL 2")),
    *(("MB+0", "MB+50"), ("FMAX", "F100"), ("NR1", "NR2"), ("#110", "#111"), ("#506", "#504"), ("#502", "#504")),
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
    if (code in ("", "%") or code.startswith(";")) and not re.match(r"\((LOG|ABORT)", line):
        return
    numbers = [m for m in NUMBER.finditer(code) if m[0].strip(".")]
    if kind == "deleted" or (kind == "guard" and GUARD.search(code)):
        yield before + after
    elif kind == "passage":
        yield before + after[rng.randint(1, 12) :]
    elif kind == "twice":
        yield [*before, line, line, *after]
    elif kind == "swapped" and after:
        yield [*before, after[0], line, *after[1:]]
    elif kind in ("word", "unit"):
        old, new = rng.choice([pair for pair in (WORDS if kind == "word" else UNITS) if pair[0] in code] or [("", "")])
        yield [*before, code.replace(old, new, 1) + line[len(code) :], *after]
    elif numbers:
        m = rng.choice(numbers)
        start, text = m.start(), m[0]
        if kind == "sign":
            sign = line[start - 1 : start]
            start -= sign in ("-", "+") and line[start - 2 : start - 1] in (*" =XYZABC[(", "")
            text = {"-": "+" if "+" in code else "", "+": "-"}.get(line[start], "-") + text
        elif kind == "point":
            text = text.replace(".", "")
        elif kind == "digit":
            place = rng.choice([i for i, c in enumerate(text) if c.isdigit()])
            text = text[:place] + str((int(text[place]) + rng.randint(1, 9)) % 10) + text[place + 1 :]
        elif kind == "lost digit":
            place = rng.choice([i for i, c in enumerate(text) if c.isdigit()])
            text = text[:place] + text[place + 1 :]
        yield [*before, line[:start] + text + line[m.end() :], *after]
