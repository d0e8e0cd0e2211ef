"""Programs for Mach3: targets in variables, everything else in macros that travel with the program.

What a macro does is not readable here and is taken as its companion file says: M881 stops short of nothing but a contact, and then
for good; M882 tells contact, none and early; M883 goes 1.5 mm from target to stand-off; M884 turns an axis, asks if it has arrived.
Read is what they are told: every target has to be the next one of the plan and within the travels, every limit that of the profile.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ..records import InputError, Plan
from ._reading import read_through, stated_words
from ._rehearsal import MODAL, NUMBER, RESETS
from ._walk import CLOSE, MEASURES, PROTECTED, Walk

COMMENT = re.compile(r"\([A-Z0-9 .+-]*\)")
SET = re.compile(rf"#(\d+)=({NUMBER}|\d+)")
START = re.compile(r"M880 \(TANGO START ([0-9A-F]{12}) (\d+)\)")
END = re.compile(r"M886 \(TANGO END ([0-9A-F]{12}) (\d+)\)")
TURN = re.compile(r"M884 P([456])")
RECORD = re.compile(r"M885 P(\d+)")
MARK = re.compile(r"\(PROGRAM ([0-9A-F]{12}) ")
TARGET, FEED, ANGLE, STANDOFF, EARLY, TOLERANCE, MISSES, SPINDLE, MOVES = 101, 104, 105, 106, 109, 110, 111, 112, 141
OFF = 1.5  # mm that M883 goes
OWN = {*range(101, 114), 141, 142, 143}


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith("M880 (") or line in ("M881", "M882") for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any]) -> None:
    """program, plan, options of its profile → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options))


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any]) -> None:
        self._plan, self._options, self._walk = plan, options, Walk(plan, options)
        self._words = stated_words(options)
        self._orient, self._reset = options.get("orient", ""), options.get("reset", "")
        self._values: dict[int, float] = {}
        self._mark, self._modal = "", set[str]()
        self._records = 0
        self._stage = ""  # of a touch: measured, free
        self._finds = False  # whether the last measuring move was the first of two
        self._began = self._ended = self.over = False

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not self.over:
            raise InputError("the program ends without M30")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if self.over:
            raise InputError("a line behind the end of the program")
        if match := MARK.match(line):
            self._mark = match[1]
        elif COMMENT.fullmatch(line) or (self._began and line in self._words):
            self._walk.switch(line)
        elif line == self._reset and not self._began:
            self._modal |= set(line.split())
            if strange := [word for word in line.split() if not RESETS.fullmatch(word)]:
                raise InputError(f"found the word {strange[0]}; allowed here: modal words that switch something off or state units")
        elif line.startswith("#"):
            self._set(line)
        elif match := START.fullmatch(line):
            self._start(match[1], int(match[2]))
        elif match := END.fullmatch(line):
            self._end(match[1], int(match[2]))
        elif line == "M30" and self._ended:
            self.over = True
        elif not self._began or self._ended:
            raise InputError("something happens outside of start mark and end mark")
        else:
            self._call(line)

    def _set(self, line: str) -> None:
        for item in line.split():
            match = SET.fullmatch(item)
            if match is None or int(match[1]) not in OWN:
                raise InputError(f"found {item}; allowed: numbers for #101 … #113, #141 … #143")
            self._values[int(match[1])] = float(match[2])

    def _value(self, number: int) -> float:
        if number not in self._values:
            raise InputError(f"#{number} is needed before it has a value")
        return self._values[number]

    def _is(self, number: int, wanted: float, what: str, within: float = 1e-6) -> None:
        if abs(self._value(number) - wanted) > within:
            raise InputError(f"{what} is {self._value(number):g}; allowed: {wanted:g}")

    def _start(self, mark: str, count: int) -> None:
        if self._began or mark != self._mark or count != len(self._plan.touches):
            raise InputError(f"the start mark is {mark} {count}; this program is {self._mark} {len(self._plan.touches)}")
        if missing := sorted(MODAL - self._modal):
            raise InputError(f"begins before {' '.join(missing)} is stated")
        self._began = True

    def _end(self, mark: str, count: int) -> None:
        if mark != self._mark:
            raise InputError(f"the end mark is that of {mark}; this program is {self._mark}")
        if self._stage or self._ended or count != len(self._plan.touches) or count != self._records:
            raise InputError(f"the end mark says {count}; {self._records} of {len(self._plan.touches)} touches are on record")
        self._walk.ends()
        self._ended = True

    def _call(self, line: str) -> None:
        walk = self._walk
        if line == "M882" and not self._stage:
            self._measure()
        elif line == "M883" and self._stage == "measured":
            self._is(FEED, float(self._options.get("positioning_feed", 0.0)), "the feed")
            way = [self._value(STANDOFF + i) - self._value(TARGET + i) for i in range(3)]
            walk.off({name: OFF * value / (math.hypot(*way) or 1.0) for name, value in zip("XYZ", way, strict=True)})
            self._stage = "" if self._finds else "free"
        elif (match := RECORD.fullmatch(line)) and self._stage == "free":
            touch = self._plan.touches[self._records]
            if int(match[1]) != touch.number:
                raise InputError(f"the record is of touch {match[1]}; this is touch {touch.number}")
            turned = self._walk.place(touch.contact)["S"] - self._value(SPINDLE)
            if abs((turned + 180.0) % 360.0 - 180.0) > CLOSE:
                raise InputError(f"the record has S {self._value(SPINDLE):g}")
            self._records, self._stage = self._records + 1, ""
        elif self._stage:
            raise InputError("the touch before has no record")
        elif line == "M881":
            self._protected()
        elif match := TURN.fullmatch(line):
            walk.rotary("ABC"[int(match[1]) - 4], self._value(ANGLE))
        elif self._orient and (match := re.fullmatch(re.escape(self._orient) + f"({NUMBER})", line)):
            walk.rotary("S", float(match[1]))
        else:
            raise InputError("no line that a program of this kind may have here")

    def _protected(self) -> None:
        self._is(FEED, float(self._options.get("positioning_feed", 0.0)), "the feed")
        self._is(TOLERANCE, float(self._options.get("tolerance", 0.0)), "the tolerance")
        target = dict(self._walk.at)
        for i, name in enumerate("XYZ"):
            if self._value(MOVES + i) not in (0.0, 1.0):
                raise InputError(f"#{MOVES + i} is neither 0 nor 1")
            if self._value(MOVES + i):
                target[name] = self._value(TARGET + i)
        self._walk.linear({name: target[name] for name in "XYZ"}, PROTECTED)

    def _measure(self) -> None:
        walk, approach = self._walk, self._plan.strategy.approach
        self._finds = walk.next is not None and walk.next.kind == "find"
        self._is(FEED, approach.find.feed if self._finds and approach.find else approach.feed, "the feed")
        self._is(EARLY, max(approach.standoff - approach.search, 0.1 * approach.standoff), "the distance of early contacts", 1e-4)
        self._is(TOLERANCE, float(self._options.get("tolerance", 0.0)), "the tolerance")
        self._is(MISSES, float(self._options.get("misses", 0)) * (2 if approach.find else 1), "the number of misses")
        start = self._walk.place(self._walk.touch.standoff)
        for i, name in enumerate("XYZ"):
            self._is(STANDOFF + i, start[name], f"the stand-off in {name}", CLOSE)
        self._walk.linear({n: self._value(TARGET + i) for i, n in enumerate("XYZ")}, MEASURES)
        self._stage = "measured"
