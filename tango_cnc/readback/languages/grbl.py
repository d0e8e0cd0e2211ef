"""Lines for grbl: no logic of their own, so every line has to be safe by itself.

Facts (sources of grbl and grblHAL): G38.3 stops at a contact, does not complain when there is none, and locks the control when it
begins in contact; G91 G1 is not stopped by anything; a target is the last word of its letter. What is recorded, and that three
touches without contact end the run, is decided by the driver and not readable here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ...records import InputError, Plan
from ..language import Companions, Language
from ..reading import MARK_IN_BRACKETS, REST, read_through, stated_words
from ..rehearsal import NUMBER
from ..walk import MEASURES, PROTECTED, Walk

COMMENT = re.compile(r"\([A-Z0-9 .+-]*\)")
SEARCH = re.compile(rf"G38\.3((?: [XYZ]{NUMBER})+) F({NUMBER})")
OFF = re.compile(rf"G1((?: [XYZ]{NUMBER})+) F({NUMBER})")
TURN = re.compile(rf"G0((?: [ABC]{NUMBER})+)")
START = re.compile(r"\(TANGO START ([0-9A-F]{12}) (\d+)\)")
SWITCHED = re.compile(r"\((CLAMP|UNCLAMP) ([ABC]) (M\d{1,3})\)")  # the driver has the words from here
END = re.compile(r"\(TANGO END ([0-9A-F]{12}) (\d+)\)")
ALIKE = 0.02  # mm by which moves off the facets of one program may differ: their words have two places
MODAL = {"G17", "G21", "G40", "G49", "G80", "G90", "G94", "M5"}


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(SEARCH.fullmatch(line) for line in head) and not any(line.startswith(("O<", "(LOGOPEN")) for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options))


LANGUAGE = Language(reads, rehearse)


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any]) -> None:
        self._plan, self._options, self._walk = plan, options, Walk(plan, options)
        self._words = stated_words(options)
        self._orient = options.get("orient", "")
        self._mark = ""
        self._told: set[tuple[str, str, str]] = set()  # words of clamps in the head
        self._modal: set[str] = set()
        self._began = self.over = False
        self._pressed = self._relative = self._proof = False
        self._length: float | None = None  # mm of the moves off the facets

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not self.over:
            raise InputError("the program ends without its end mark")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if self.over:
            raise InputError("a line after the end mark")
        if match := MARK_IN_BRACKETS.fullmatch(line):
            self._mark = match[1]
        elif match := START.fullmatch(line):
            self._start(match[1], int(match[2]))
        elif not self._began and (match := SWITCHED.fullmatch(line)):
            self._told.add((match[1].lower(), match[2], match[3]))
        elif match := END.fullmatch(line):
            self._end(match[1], int(match[2]))
        elif COMMENT.fullmatch(line) or (self._began and not self._relative and line in self._words):
            self._walk.switch(line)
        elif not self._began and set(line.split()) <= MODAL:
            self._modal |= set(line.split())
        elif self._relative:
            self._off(line)
        else:
            self._move(line)

    def _start(self, mark: str, count: int) -> None:
        if self._began or mark != self._mark or count != len(self._plan.touches):
            raise InputError(f"the start mark is {mark} {count}; this program is {self._mark} {len(self._plan.touches)}")
        stated = {(key, *pair) for key in ("clamp", "unclamp") for pair in (self._options.get(key) or {}).items()}
        if self._told != stated:
            found, wanted = (", ".join(" ".join(words) for words in sorted(some)) or "none" for some in (self._told, stated))
            raise InputError(f"the driver is given the words {found}; the profile states {wanted}")
        self._began = True

    def _end(self, mark: str, count: int) -> None:
        if mark != self._mark:
            raise InputError(f"the end mark is that of {mark}; this program is {self._mark}")
        if self._relative or self._pressed or count != len(self._plan.touches):
            raise InputError(f"the end mark says {count}, or comes while the probe is at a facet")
        self._walk.ends()
        self.over = True

    def _move(self, line: str) -> None:
        if not self._began:
            raise InputError("something happens before the start mark")
        if missing := sorted(MODAL - self._modal):
            raise InputError(f"something moves before {' '.join(missing)} is stated")
        if self._proof and (match := REST.fullmatch(line)):
            self._pressed = self._proof = False
        elif line == "G21 G91" and self._pressed and not self._proof:
            self._relative = True
        elif self._pressed:
            raise InputError("the probe is at a facet, and this does not take it off first")
        elif match := SEARCH.fullmatch(line):
            self._search(_values(match[1]), float(match[2]))
        elif match := TURN.fullmatch(line):
            for name, value in _values(match[1]).items():
                self._walk.rotary(name, value)
        elif self._orient and (match := re.fullmatch(re.escape(self._orient) + f"({NUMBER})", line)):
            self._walk.rotary("S", float(match[1]))
        else:
            raise InputError("no line that a program of this kind may have here")

    def _search(self, words: Mapping[str, float], feed: float) -> None:
        target = {name: words.get(name, self._walk.at[name]) for name in "XYZ"}
        if self._walk.proving:
            self._pressed, self._proof = True, not self._walk.on_facet
            self._walk.proof(target, feed)
            return
        measures = self._walk.measures
        approach, due = self._plan.strategy.approach, self._walk.next
        wanted = approach.feed if measures else float(self._options.get("positioning_feed", feed))
        if due is not None and due.kind == "find" and approach.find:
            wanted = approach.find.feed
        if abs(feed - wanted) > 1e-6:
            raise InputError(f"the feed is {feed:g}; allowed: {wanted:g} mm/min")
        self._walk.linear(target, MEASURES if measures else PROTECTED)
        self._pressed = measures

    def _off(self, line: str) -> None:
        """The move off a facet, and G90 behind it."""
        if line == "G90" and not self._pressed:
            self._relative = False
        elif (match := OFF.fullmatch(line)) and self._pressed:
            if abs(float(match[2]) - float(self._options.get("positioning_feed", match[2]))) > 1e-6:
                raise InputError(f"the feed is {match[2]}; allowed: {self._options['positioning_feed']:g} mm/min")
            length = self._walk.off({name: _values(match[1]).get(name, 0.0) for name in "XYZ"})
            self._length = length if self._length is None else self._length
            if abs(length - self._length) > ALIKE:
                raise InputError(
                    f"found a move of {length:.3f} mm off the facet; allowed: {self._length:.3f} mm, as off the others"
                )
            self._pressed = False
        else:
            raise InputError("no line that may appear between G91 and G90")


def _values(words: str) -> dict[str, float]:
    """' X1. Y2.' → {letter: number}. Raises InputError for a letter that appears twice."""
    pairs = [(word[0], float(word[1:])) for word in words.split()]
    if len(dict(pairs)) != len(pairs):
        raise InputError(f"found {words.strip()}; allowed: each letter once")
    return dict(pairs)
