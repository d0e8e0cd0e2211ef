"""Programs for Mach4: the Macro-B family, with M codes in place of DPRNT.

Facts: #5021 #5041 #5061 count the axes X Y Z A B C whatever the machine has; an M code is carried out when the axes stand, and so
is what follows it. What the scripts behind the M codes do is not readable here: M881 is taken to print the variables that it is
given, which its companion file says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ..records import InputError, Plan
from ._reading import read_through
from .macro_b import _Program

START = re.compile(r"M880\(TANGO START ([0-9A-F]{12}) (\d+)\)")
END = re.compile(r"M882\(TANGO END ([0-9A-F]{12}) (\d+)\)")
RECORD, WAIT = "M881(RECORD)", "M883"
FLAG, SUM, SPINDLE, TOUCH = 110, 118, 119, 120
LETTERS = "XYZABC"


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith("M880(") or line == WAIT for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any]) -> None:
    """program, plan, options of its profile → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Mach4(plan, options), tail=True)


class _Mach4(_Program):
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any]) -> None:
        numbers = {name: i for i, name in enumerate(LETTERS, 1) if name in plan.machine.names}
        super().__init__(plan, {**options, "axis_numbers": numbers}, {})
        self._places = {name: f"#{FLAG + i}" for name, i in numbers.items()} | {"S": f"#{SPINDLE}", "K": f"#{SUM}"}

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if line == WAIT:
            self._moving = False
        elif line == RECORD and self._opened and not self._closed:
            self._machine.record(f"#{TOUCH}", f"#{FLAG}", self._places)
        elif match := START.fullmatch(line):
            self._opened = True
            self._machine.start(match[1], float(match[2]), self._mark)
        elif (match := END.fullmatch(line)) and self._opened:
            self._machine.end(match[1], float(match[2]))
            self._closed = True
        elif line.startswith(("POPEN", "PCLOS", "DPRNT", "G65")) or line == "G53":
            raise InputError("no line that a program of this kind may have here")
        else:
            super().line(line)
