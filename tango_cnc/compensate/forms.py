"""A file that differs from what was written: which machine does it speak of? Tables, points, axes, entries and pivots of both.

The files of every target are read by their look alone: rows of numbers below a name are a table, with the place first; any other
line with a number is an entry. What differs in that is no slip of a digit, but another machine's, or of another compensation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from .hidden import ZERO
from .whose import TABLE, letters

NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
NUMBERS = re.compile(rf"{NUMBER}(?:\s+{NUMBER})+")
LAST = re.compile(rf"^(?P<label>.*?[\s=R:])(?P<number>{NUMBER})(?P<rest>\D*)$")
NAMED = re.compile(r"^(?:\[(?P<name>[^\]]+)\]|BEGIN (?P<file>[A-Z]\.COM))$")
SPREAD = re.compile(rf"^(?P<axis>[A-Z]) (?P<low>{NUMBER}) (?P<high>{NUMBER}) {NUMBER} [A-Z]+$")  # a table whose head has its ends
INDEXED = re.compile(r"^\$A[NA]_(?:CEC|ENC_COMP)(?:_(?P<what>STEP|MIN|MAX|[A-Z_]+))?\[(?P<index>[^\]]+)\]=(?P<value>.+)$")
OWNER = re.compile(r"machine\s*[:=]\s*([^,;)\n]+)", re.IGNORECASE)
LISTED = 3
UNNAMED = "its table"


@dataclass(frozen=True)
class Form:
    """What a file of a control consists of."""

    tables: dict[str, list[float]] = field(default_factory=dict)  # by name: places of its rows, mm or degrees
    axis: dict[str, str] = field(default_factory=dict)  # by name: the axis that it is read with, where the file says so
    entries: dict[str, float] = field(default_factory=dict)  # by what stands before the number
    named: set[str] = field(default_factory=set)  # letters of axes in lines without a number
    machine: str = ""  # that the file names

    def enter(self, label: str, number: float) -> None:
        """label, number → the form with this entry; of a label that is there already with the second, the third …"""
        count, name = 1, label
        while name in self.entries:
            count += 1
            name = f"{label} ({count})"
        self.entries[name] = number

    @property
    def axes(self) -> set[str]:
        """→ letters of all axes that it names."""
        return {letter for name in (*self.tables, *self.entries) for letter in letters(name)} | self.named | {*self.axis.values()}


def form(text: str) -> Form:
    """text of a file for a control → what it consists of."""
    found = Form(machine=owner[1].strip() if (owner := OWNER.search(text)) is not None else "")
    name, column, head, spread = UNNAMED, 0, [""], None
    for raw in re.split("\r\n|\n|\r", text):
        line = raw.strip()
        words = line.split()
        if line.startswith((";", "//")) or OWNER.search(line):
            continue
        if not re.search(r"\d", line):
            found.named.update(letters(line))
        if (named := NAMED.match(line)) is not None:
            name, column = named["name"] or named["file"], 0
            found.axis.update((name, letter) for letter in letters(name.removesuffix(".COM"))[:1])
        elif (ends := SPREAD.match(line)) is not None:
            name, spread = ends["axis"], (float(ends["low"]), float(ends["high"]))
            found.axis[name] = name
        elif NUMBERS.fullmatch(line):
            if len(head) == len(words) > 1 and "0" in head[0]:  # ISG: location errors below their names
                found.entries.update(zip(head, map(float, words), strict=True))
            else:
                if name == UNNAMED and len(words) == 2:  # a setting with its number
                    found.entries[words[0]] = float(words[1])
                else:
                    found.tables.setdefault(name, []).append(float(words[column]))
        elif words[:2] == ["NR", "AXISPOS"]:
            column = 1
        elif len(words) > 1 and all(re.fullmatch(r"[A-Z]|E[A-Z]{2}|[A-Z]0[A-Z]", word) for word in words):
            name, column, head = f"table of {words[0]}", 0, words
            if len(words[0]) == 1:
                found.axis[name] = words[0]
        elif (indexed := INDEXED.match(line)) is not None:
            _indexed(found, indexed)
        elif (last := LAST.match(line.partition(";")[0].strip())) is not None:
            label = f"{last['label']}{last['rest']} {line.partition(';')[2]}"
            if (row := TABLE.fullmatch(line.partition("=")[0].strip())) is not None:
                found.tables.setdefault(row["table"], []).append(float(row["at"]))
                found.axis[row["table"]] = row["axis"]
            else:
                found.enter(" ".join(label.split()).rstrip("=R: "), float(last["number"]))
    if spread is not None and name in found.tables:
        count = len(found.tables[name])
        found.tables[name] = [spread[0] + (spread[1] - spread[0]) * i / max(count - 1, 1) for i in range(count)]
    return found


def _indexed(found: Form, line: re.Match[str]) -> None:
    """form so far, a line of a SINUMERIK table → the form with it: its places count from MIN on."""
    index, what, value = line["index"], line["what"], line["value"]
    parts = index.split(",")
    encoder = line[0].startswith("$AA")
    name = f"ENC_COMP {parts[-1]}" if encoder else f"CEC table {parts[0]}"
    if what is None:
        found.tables.setdefault(name, []).append(float(len(found.tables.get(name, []))))
    elif what in ("INPUT_AXIS", "OUTPUT_AXIS"):
        found.entries[f"{name} {what} {value}"] = 0.0
    elif what in ("MIN", "STEP") and name in found.tables and re.fullmatch(NUMBER, value):
        found.entries[f"{name} {what}"] = float(value)
        low, step = (found.entries.get(f"{name} {key}") for key in ("MIN", "STEP"))
        if low is not None and step is not None:
            found.tables[name] = [low + step * i for i in range(len(found.tables[name]))]
            for key in ("MIN", "STEP"):
                del found.entries[f"{name} {key}"]


def of_another(written: str, there: str, travels: Mapping[str, tuple[float, float]]) -> str:
    """text as it was written, text as it is, {axis: its travel in mm or degrees} → what in it speaks of another machine; '' for
    nothing: a number differs, and no more."""
    reasons = list(_reasons(form(written), form(there), travels))
    more = f" and {len(reasons) - LISTED} more" if len(reasons) > LISTED else ""
    return "; ".join(reasons[:LISTED]) + more


def _reasons(own: Form, other: Form, travels: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    if other.machine and other.machine != own.machine:
        yield f"it says that it is of the machine {other.machine!r}"
    if strange := sorted(other.axes - own.axes):
        yield f"it has axis {' '.join(strange)}, of which nothing was written"
    for name, at in other.tables.items():
        if (wanted := own.tables.get(name)) is None:
            yield f"it has {name}, which was not written"
        elif len(at) != len(wanted) or abs(at[0] - wanted[0]) > 1e-3 or abs(at[-1] - wanted[-1]) > 1e-3:
            axis = other.axis.get(name, "")
            yield f"{name} has {_row(at)}, and {_row(wanted)} were written{_beyond(axis, at, travels)}"
    if missing := [name for name in own.tables if name not in other.tables]:
        yield f"it lacks {missing[0]}"
    for label, number in other.entries.items():
        if label not in own.entries:
            yield f"it has {label!r}, which was not written"
        elif abs(number - own.entries[label]) > ZERO:
            yield f"{label!r} is {number:g}, and {own.entries[label]:g} was written"
    if lacking := [label for label in own.entries if label not in other.entries]:
        yield f"it lacks {lacking[0]!r}"


def _row(at: list[float]) -> str:
    return f"{len(at)} points from {at[0]:g} to {at[-1]:g}" if len(at) > 1 else f"1 point at {at[0]:g}"


def _beyond(axis: str, at: list[float], travels: Mapping[str, tuple[float, float]]) -> str:
    if axis not in travels or (travels[axis][0] - 1e-3 <= min(at) and max(at) <= travels[axis][1] + 1e-3):
        return ""
    low, high = travels[axis]
    return f" (the travel of {axis} is {low:g} to {high:g})"
