"""Numbers → pictures made of characters, for the terminal: sparkline of a trend, bar of a value with its interval.

Color is used only where the output is a terminal and NO_COLOR is not set (https://no-color.org); color alone says nothing.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

BLOCKS = "▁▂▃▄▅▆▇█"
SIGNS = {"good": "✓", "look": "▲", "stop": "✕", "unknown": "?"}
TONES = {"good": "32", "look": "33", "stop": "31", "unknown": "35"}
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
    numbers = numbers[ends(len(numbers), most)]
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


def ends(count: int, most: int) -> list[int]:
    """nights, room → the index at which each character ends: one night a character, or equal runs of them."""
    return list(range(count)) if count <= most else [int(x) - 1 for x in np.linspace(0, count, most + 1)[1:]]


def marks(flags: Sequence[bool], most: int = 60) -> str:
    """flags, room → `!` below each character of the sparkline that holds a flag, else blanks."""
    starts = [0, *(e + 1 for e in ends(len(flags), most))]
    return "".join("!" if any(flags[a:b]) else " " for a, b in pairwise(starts)).rstrip()


@dataclass(frozen=True)
class Course:
    """A parameter over the nights, in the unit of people: values, 95 % half interval of the last one, nights with an alarm."""

    name: str
    values: Sequence[float]
    half: float
    unit: str
    alarms: Sequence[bool] = ()


def courses(found: Sequence[Course], columns: int) -> str:
    """parameters over the nights, columns → one line each: sparkline, first → last value ± its interval; alarms marked below.

    What has no room goes: first the interval, then the first value, then nights (equal runs of them share a character).
    """
    return _courses(found, columns)[0]


def told(found: Sequence[Course], columns: int) -> str:
    """parameters over the nights, columns → which numbers their lines have room for: `all`, `values` (no interval) or `last`."""
    return _courses(found, columns)[1]


def _courses(found: Sequence[Course], columns: int) -> tuple[str, str]:
    if not found:
        return "", "all"
    head = max(len(c.name) for c in found)
    lasts = [f"{c.values[-1]:.2f}" for c in found]
    firsts = [f"{c.values[0]:.2f} →" for c in found]
    spreads = [f"± {c.half:.2f}" for c in found]
    units = [c.unit for c in found]
    shapes = {"all": (firsts, lasts, spreads, units), "values": (firsts, lasts, units), "last": (lasts, units)}
    word, wanted = "", min(max(len(c.values) for c in found), 20)
    for shape, parts in shapes.items():
        word = shape
        wide = [max(map(len, p)) for p in parts]
        tails = [
            "  ".join(f"{text:{'<' if p is units else '>'}{w}}" for p, text, w in zip(parts, row, wide, strict=True))
            for row in zip(*parts, strict=True)
        ]
        room = columns - head - max(map(len, tails)) - 4
        if room >= wanted:
            break
    room, lines = max(room, 5), []
    for c, tail in zip(found, tails, strict=True):
        drawn = sparkline(c.values, room)
        lines.append(f"{c.name:<{head}}  {drawn:<{min(room, max(len(x.values) for x in found))}}  {tail}".rstrip())
        below = marks(c.alarms, room)
        if below and (c is found[-1] or marks(found[-1].alarms, room) != below):  # the same below all of them: once
            lines.append(f"{'':<{head}}  {colored(below, 'look')}")
    return "\n".join(lines), word
