"""What every family does alike: it reads a program line by line, and takes from the profile what the program may have in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from ..records import InputError, Plan
from .rehearsal import at_line, numbered

# The line that names a program, a comment in brackets or behind a semicolon, and nothing behind it that a control would carry out
_MARK = r"PROGRAM ([0-9A-F]{12}) PLAN [0-9A-F]{12}(?: PART \d+ OF \d+)?"
MARK_IN_BRACKETS = re.compile(rf"\({_MARK}\)")
MARK_BEHIND_SEMICOLON = re.compile(rf"; {_MARK}")

REST = re.compile(r"G4 [PFKX](\d{1,2})\.?")  # s
HARMLESS = (4, 15, 65)  # dwell, the frame that Okuma counts by, a call of a macro
OWN = 100  # G words from here on are the builder's own


class Reader(Protocol):
    """A program as far as it has been read."""

    over: bool  # its end has been read

    def line(self, line: str) -> None:
        """One line. Raises InputError when it must not reach a machine."""

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""


def read_through(lines: Callable[[], Iterator[str]], begin: Callable[[], Reader], tail: bool = False) -> None:
    """lines of a program, what begins to read it → nothing. Raises InputError naming the line that must not reach a machine.

    `tail`: behind the end stand macros or stops, which `begin` has read.
    """
    at = 0, ""
    try:
        program = begin()
        for at in numbered(lines()):
            if tail and program.over:
                break
            program.line(at[1])
        program.finish()
    except InputError as error:
        raise at_line(*at, error) from None


def stated_words(options: Mapping[str, Any]) -> set[str]:
    """options of a profile → the words that it wants in the program: the switches of the probe, clamps of rotary axes.

    Raises InputError for one that could change what the moves behind it mean: units, frame, increments, kind of motion.
    """
    switches = {text for key in ("probe_on", "probe_off") if (text := options.get(key))}
    found = switches | {word for key in ("clamp", "unclamp") for word in options.get(key, {}).values()}
    others = {word for key in ("orient", "wait", "machine_frame") if isinstance(word := options.get(key), str)}
    for text in sorted((found | others) - {"G53", "G103 P1"}):
        if any(int(number) < OWN and int(number) not in HARMLESS for number in re.findall(r"(?<![A-Z])G *(\d+)", text)):
            raise InputError(f"found {text!r} in the profile; allowed: words that switch something, and calls by G65")
    return found


def axes_by_number(plan: Plan, options: Mapping[str, Any]) -> dict[int, str]:
    """plan, options of its profile → {number in the system variables: axis letter}, in the order of the machine unless stated."""
    names = [axis.name for axis in plan.machine.axes if axis.kind != "spindle"]
    stated = options.get("axis_numbers") or {name: i for i, name in enumerate(names, 1)}
    return {int(number): name for name, number in stated.items() if name in names}
