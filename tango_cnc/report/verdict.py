"""Checks of an estimate → one verdict, the worst of them, which every box of the report knows of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

Level = Literal["good", "look", "stop", "unknown"]  # unknown: of an answer, never of a check
ORDER: tuple[Level, ...] = ("good", "look", "stop")
RATIO = (1.5, 4.0)  # scatter of a touch over what the probe repeats to: above these, look and stop
PREDICTED = (1.4, 3.0)  # held-out touches over what was promised
MISSING = 0.2  # of the planned touches: above it the rest is not to be trusted
OUTLIERS = 0.1  # of the touches


@dataclass(frozen=True)
class Check:
    """One question put to the result: its level, what was found, and what to do when it is not good.

    `open` marks a check that judges nothing: none was asked for, or another one takes away what it relies on.
    """

    name: str
    level: Level
    value: str
    text: str
    todo: str = ""
    trust: bool = True  # whether it says something of the numbers; the limit says something of the machine
    open: bool = False
    said: str = ""  # key of the text at the top of the page, where it is another than that of its level
    tone: Level | None = None  # as which it is drawn, where it says something of the machine that is worse than its level
    label: str = ""  # the word beside it, where it is another than that of its level
    undermines: bool = False  # what was found takes away what the others rely on: none of them stays good


@dataclass(frozen=True)
class Verdict:
    """The worst level of all checks, and the checks as they are shown."""

    level: Level
    worst: Check | None  # None when all is good
    checks: tuple[Check, ...]


def worst_of(checks: Sequence[Check]) -> Verdict:
    """checks → verdict. Of several equally bad ones the first decides; with a stop, or one that undermines, none stays good."""
    level: Level = ORDER[max((ORDER.index(c.level) for c in checks), default=0)]
    worst = next((c for c in checks if c.level == level), None) if level != "good" else None
    nothing_good = level == "stop" or any(c.undermines for c in checks)
    shown = tuple(replace(c, open=True) if nothing_good and c.level == "good" else c for c in checks)
    return Verdict(level, worst, shown)


def graded(value: float, limits: tuple[float, float]) -> Level:
    """number, limits of look and stop → level; what is not a number is a stop."""
    return "good" if value < limits[0] else "look" if value < limits[1] else "stop"
