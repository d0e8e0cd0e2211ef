"""Programs for Mach4: the Macro-B family, with M codes in place of DPRNT.

Facts: #5021 #5041 #5061 count the axes X Y Z A B C whatever the machine has; an M code is carried out when the axes stand, and so
is what follows it. The scripts behind the M codes are read too: which variables M881 prints stands in its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ....records import InputError, Plan
from ...language import Companions, Language
from ...reading import read_through
from ..macro_b import _Program
from . import lua

START = re.compile(r"M880\(TANGO START ([0-9A-F]{12}) (\d+)\)")
END = re.compile(r"M882\(TANGO END ([0-9A-F]{12}) (\d+)\)")
RECORD, WAIT, LOOK = "M881(RECORD)", "M883", "M884"
COMPANIONS = re.compile(r"m88[0-4]\.mcs")
SET = 117  # variable with the number of the set of scripts
LETTERS = "XYZABC"


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith("M880(") or line == RECORD for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Mach4(plan, options, lines(), companions), tail=True)


LANGUAGE = Language(reads, rehearse, COMPANIONS)


class _Mach4(_Program):
    """Line by line."""

    closes = ()  # the scripts close their file behind each line

    def __init__(self, plan: Plan, options: Mapping[str, Any], lines: Iterable[str], companions: Companions) -> None:
        numbers = {name: i for i, name in enumerate(LETTERS, 1) if name in plan.machine.names}
        super().__init__(plan, {**options, "axis_numbers": numbers, "wait": WAIT}, lines)
        self._scripts, self._file = companions, str(options.get("readings", ""))
        self._off = str(options.get("probe_off") or "")
        self._record: tuple[str, str, dict[str, str]] = "", "", {}

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if line == WAIT:
            self._moving = False
        elif line == LOOK:
            self._free, self._moving = True, False
        elif line == RECORD and self._opened and not self._closed:
            self._machine.record(*self._record)
        elif match := START.fullmatch(line):
            self._opened = True
            self._record = lua.record(self._scripts, self._file, SET, int(self._machine.same(f"#{SET}")), self._off)
            self._machine.start(match[1], float(match[2]), self._mark)
        elif (match := END.fullmatch(line)) and self._opened:
            self._machine.end(match[1], float(match[2]))
            self._closed = True
        elif (line.startswith(("POPEN", "PCLOS", "DPRNT", "G65")) and line not in self._words) or line == "G53":
            raise InputError("no line that a program of this kind may have here")
        else:
            super().line(line)
