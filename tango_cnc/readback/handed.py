"""Records that a Sinumerik gives through variables instead of printing them: the lines that have to stand there, in their order.

Facts: docs/link.md (`opcua`): the control writes `record` last of all and waits until `taken` is the same.
"""

from __future__ import annotations

import re

from ..records import InputError

CELLS = {"record": 0, "taken": 1, "point": 2, "flag": 3, "count": 4, "mark0": 5, "mark1": 6, "mark2": 7, "sum": 8}
CELLS |= {letter: 10 + i for i, letter in enumerate("XYZABCS")}


class Handed:
    """The lines in which a record is given through variables: what was assigned, and that the program waits until it is taken."""

    def __init__(self, name: str) -> None:
        """value of the option `handshake` → nothing given yet."""
        match = re.fullmatch(r"R(\d{1,3})", name)
        cells = {what: f"R{int(match[1]) + at}" if match else f"{name}[{at}]" for what, at in CELLS.items()}
        self._whats = {cell: what for what, cell in cells.items()}
        record, taken = cells["record"], cells["taken"]
        self._way = [
            *("STOPRE", f"{record}={record}+1", f"IF {record}>65535", f"{record}=0", "ENDIF"),
            *(f"WHILE {taken}<>{record}", "G4 F0.1", "STOPRE", "ENDWHILE"),
        ]
        r, t = re.escape(record), re.escape(taken)
        self._ahead = re.compile(rf"IF \({t}-{r}==1\) OR \({r}-{t}==65535\) GOTOF (TG_STOP_\d)")
        self._given: dict[str, str] = {}  # since the last record
        self._lasting: dict[str, str] = {}  # what stands there all the time
        self._guarded = False
        self.guard = ""  # where the program stops when `taken` is ahead of `record`
        self._at: int | None = None  # of the next line of the way
        self.assigned: tuple[str, str] | None = None
        self.complete: dict[str, str] | None = None
        self.waits = False
        self.lasting: dict[str, str] = {}

    def takes(self, line: str) -> bool:
        """line → whether it is one of the handshake. Raises InputError for one that stands where another belongs."""
        self.assigned, self.waits, self.guard = None, False, ""
        if self._at is None and (match := self._ahead.fullmatch(line)):
            self.guard, self._guarded = match[1], True
            return True
        cell, equals, text = line.partition("=")
        if self._at is None and equals and cell in self._whats and self._whats[cell] not in ("record", "taken"):
            what = self._whats[cell]
            if what == "count" or what.startswith("mark"):
                self._lasting[what] = text
            else:
                self.assigned, self._given[what] = (what, text), text
            if what == "point":
                self._at = 0
            return True
        if self._at is None:
            if any(re.search(rf"(?<![A-Z0-9_]){re.escape(cell)}(?![0-9])", line) for cell in self._whats):
                raise InputError("a variable of the handshake where none belongs")
            return False
        if line != self._way[self._at]:
            raise InputError(f"found {line}; allowed: {self._way[self._at]}, as a record is given and waited for")
        self._at += 1
        self.waits = line == "STOPRE"
        if self._at == len(self._way):
            if not self._guarded:
                raise InputError("a record is given before the program has looked whether it counts as taken already")
            self._at, self.complete, self._given = None, self._given, {}
            self.lasting = dict(self._lasting)
        return True
