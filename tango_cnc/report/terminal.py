"""Numbers → pictures made of characters, for the terminal: sparkline of a trend, bar of a value with its interval.

Color is used only where the output is a terminal and NO_COLOR is not set (https://no-color.org); nothing is told by color alone.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .facts import Facts, verdict
from .page import parameters, sentence
from .texts import texts

BLOCKS = "▁▂▃▄▅▆▇█"
SIGNS = {"good": "✓", "look": "▲", "stop": "✕"}
TONES = {"good": "32", "look": "33", "stop": "31"}
NARROW = 40


def width(environ: Mapping[str, str] | None = None) -> int:
    """environment → columns of the terminal, at least 40: COLUMNS where it is set."""
    return max(NARROW, shutil.get_terminal_size((80, 24)).columns if environ is None else int(environ.get("COLUMNS", 80)))


def colored(text: str, level: str, *, out: Any = None, environ: Mapping[str, str] | None = None) -> str:
    """text, good | look | stop → the text in its color, or as it is where no color is wanted."""
    environ = os.environ if environ is None else environ
    stream = sys.stdout if out is None else out
    if environ.get("NO_COLOR") or environ.get("TERM") == "dumb" or not stream.isatty():
        return text
    return f"\x1b[{TONES[level]}m{text}\x1b[0m"


def sparkline(values: Sequence[float], most: int = 60) -> str:
    """numbers, room → one character each; where there are more than room, the last of equal runs. Gaps (NaN) are blanks."""
    numbers = np.asarray(values, dtype=float)
    if len(numbers) > most:
        ends = np.linspace(0, len(numbers), most + 1).astype(int)[1:] - 1
        numbers = numbers[ends]
    real = numbers[np.isfinite(numbers)]
    if not len(real):
        return " " * len(numbers)
    low, span = float(real.min()), float(np.ptp(real))
    level = (numbers - low) / span * (len(BLOCKS) - 1) if span else np.where(np.isfinite(numbers), 3.0, np.nan)
    return "".join(BLOCKS[round(v)] if math.isfinite(v) else " " for v in level)


def bar(value: float, half: float, span: float, room: int = 31) -> str:
    """value, half interval, what the half width stands for, characters → `·····│══●══ ··`: zero, value and interval."""
    room = max(room | 1, 7)
    middle, k = room // 2, (room // 2) / (span or 1.0)

    def place(v: float) -> int:
        return min(max(middle + round(k * v), 0), room - 1)

    cells = ["·"] * room
    for i in range(place(value - half), place(value + half) + 1):
        cells[i] = "═"
    cells[middle] = "│" if cells[middle] == "·" else "╪"
    cells[place(value)] = "●"
    return "".join(cells)


def summary(found: Facts, columns: int | None = None) -> str:
    """facts of a report, columns → verdict, every check, and the largest parameters with a bar of their interval."""
    t = texts()
    columns = columns or width()
    judged = verdict(found, t)
    head = f"{SIGNS[judged.level]} {t('level.' + judged.level)}"
    lines = textwrap.wrap(f"{head}: {sentence(judged, t)}", columns)
    lines[0] = lines[0].replace(head, colored(head, judged.level), 1)
    for check in judged.checks:
        sign = "–" if check.open else colored(SIGNS[check.level], check.level)
        lines.append(f"  {sign} {t('check.' + check.name):<12} {check.value}")
    rows = parameters(found, t, most=8)
    if rows:
        span: dict[str, float] = {}
        for r in rows:
            span[r["unit"]] = max(span.get(r["unit"], 0.0), abs(r["number"]) + r["half"])
        ends = [f"{r['value']:>9} {r['unit']:<7}" for r in rows]
        whole = [f"{end} {r['low']} … {r['high']}" for end, r in zip(ends, rows, strict=True)]
        indent = max(len(r["name"]) for r in rows) + 4
        if indent + 11 + max(map(len, whole)) <= columns:  # a number is shown whole or not at all
            ends = whole
        room = min(41, columns - indent - max(map(len, ends)))
        lines.append("")
        for r, end in zip(rows, ends, strict=True):
            drawn = bar(r["number"], r["half"], span[r["unit"]], room - 1 + room % 2)
            lines.append(f"  {r['name']:<{indent - 4}} {drawn} {end}")
    return "\n".join(lines)
