"""Text of an NC program → blocks with their motion; what cannot be followed is refused by its name.

A language is a module in `languages/` with `SAYS` (one line), `READS` (languages of posts that it understands), `LENGTH` (whether
a tool's length acts without being asked for), `COUNTED` (whether each line begins with its number), `UNITS` (what states
millimeters, and what absolute coordinates; once where one word states both), `HEAD` (which lines may stand before the mark),
`mark(text)` → a comment line, `read(line, number, modal)` → block, and `write(block, moves, decimals)` → lines.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Literal, NamedTuple

from ..files.checked import SHOWN, printable, suggestion
from ..records import InputError

MARK = "TANGO COMPENSATED"
SPIRAL = 0.005  # mm by which end and beginning of an arc may be at other distances from its center: rounding, and no spiral
HEAD = 40  # lines in which a mark is looked for


class Arc(NamedTuple):
    """A circle in the plane of two axes: centre in their coordinates, turning from the first to the second or back."""

    axes: tuple[str, str]
    centre: tuple[float, float]
    clockwise: bool
    turns: int = 0  # whole turns besides


@dataclass(frozen=True, slots=True)
class Word:
    """A word of a block: what it says and where it stands in the text."""

    letter: str
    value: float
    begin: int
    end: int


@dataclass(slots=True)
class Block:
    """A line of a program. `target`: programmed coordinates of the axes that it names, mm and degrees; `arc` of a circle."""

    number: int
    text: str
    words: tuple[Word, ...] = ()
    kind: Literal["none", "rapid", "feed", "arc", "machine"] = "none"
    target: Mapping[str, float] = field(default_factory=dict)
    arc: Arc | None = None
    tool: int | None = None  # changed to
    length: bool | None = None  # tool length switched on, off
    forgets: str = ""  # axes that go where no word says
    unknown: tuple[str, ...] = ()  # M functions of which nobody here knows what they do
    label: str = ""  # N120: how features name it


@dataclass(slots=True)
class Modal:
    """What earlier blocks have switched on."""

    motion: str = ""  # rapid, feed, cw, ccw or nothing
    plane: tuple[str, str, str] = ("X", "Y", "Z")
    position: dict[str, float] = field(default_factory=dict)  # programmed, mm and degrees
    centre: tuple[float, float] | None = None
    offset: str = ""  # the work offset that was called
    tool: int | None = None
    absolute_centre: bool = False
    incremental: bool = False  # G91 on the way to a reference point
    metric: bool = False  # a block has stated it, as the next
    absolute: bool = False
    ended: str = ""  # the M function that has ended the program
    changed: bool = False  # M6 has been seen
    length: bool = False  # G43 has switched the length of a tool on
    stale: bool = False  # the tool was changed since, and nothing has said whose length acts now


def languages() -> tuple[str, ...]:
    """→ every language that is read."""
    from . import languages as folder

    return tuple(m.name for m in pkgutil.iter_modules(folder.__path__) if not m.name.startswith("_"))


def language(name: str) -> ModuleType:
    """name → language. Raises InputError for a name that none has."""
    if name not in languages():
        raise InputError(f"--language: found {name!r}; allowed: {', '.join(languages())}.{suggestion(name, languages())}")
    return importlib.import_module(f"{__package__}.languages.{name}")


def guessed(head: Sequence[str], written: str | None, suffix: str = "") -> str:
    """first lines, language of the cell's own programs, None without a cell's dialect, ending of the name (.mpf) → language.

    Macro B has no comment after a semicolon, Klartext and SINUMERIK have no other one, RS-274 has both.
    """
    text = "\n".join(head).upper()
    if "BEGIN PGM" in text:
        return "klartext"
    if suffix.lower() in (".mpf", ".spf"):
        return "siemens"
    if "%_N_" in text or "TRAORI" in text or "CYCLE8" in text or (" ;" in text and "SUPA" in text):
        return "siemens"
    if suffix.lower() == ".ngc":
        return "rs274"
    found = next((name for name in languages() if written in language(name).READS), "rs274" if written is None else "macro_b")
    return "siemens" if found == "macro_b" and re.search(r"(?m)^[^(\n]*;[ \t]*\w", text) else found


def marked(head: Sequence[str]) -> int | None:
    """first lines → the line from 1 that bears the mark of a compensated program; None: none does."""
    return next((i for i, line in enumerate(head[:HEAD], 1) if MARK in line.upper()), None)


def refused(number: int, what: str, why: str) -> InputError:
    """line from 1, what it says, why it cannot be followed → the error."""
    return InputError(f"line {number}: found {printable(what, SHOWN)}; {printable(why, 3 * SHOWN)}; nothing was written")


def arc_of(
    number: int, modal: Modal, target: Mapping[str, float], offsets: Mapping[str, float], radius: float | None, *, clockwise: bool
) -> Arc:
    """modal state before, target, I J K or radius → the circle. Raises InputError for one that cannot be."""
    a, b, _ = modal.plane
    if a not in modal.position or b not in modal.position:
        raise refused(number, "an arc", f"where it begins is not known: {a} or {b} has not been programmed before")
    start = modal.position[a], modal.position[b]
    end = target.get(a, start[0]), target.get(b, start[1])
    ijk = dict(zip("XYZ", "IJK", strict=True))
    if beside := sorted(n for n, v in offsets.items() if v and n not in (ijk[a], ijk[b])):
        word = f"{beside[0]}{offsets[beside[0]]:g}"
        raise refused(number, f"{word} in an arc in the plane {a}{b}", "what it does there is not known: a spiral is not followed")
    if radius is not None and offsets:
        raise refused(number, "an arc with a radius and a center", "which one is meant is not known")
    if radius is not None:
        dx, dy = end[0] - start[0], end[1] - start[1]
        chord = math.hypot(dx, dy)
        if chord < 1e-9 or abs(radius) < chord / 2 - 5e-3:
            raise refused(number, f"an arc of radius {radius:g}", "no such arc leads to its end")
        height = math.sqrt(max(0.0, radius * radius - chord * chord / 4))
        side = -1.0 if clockwise == (radius > 0) else 1.0
        return Arc(
            (a, b), (start[0] + dx / 2 - side * height * dy / chord, start[1] + dy / 2 + side * height * dx / chord), clockwise
        )
    if modal.absolute_centre:
        centre = offsets.get(ijk[a], start[0]), offsets.get(ijk[b], start[1])
    else:
        centre = start[0] + offsets.get(ijk[a], 0.0), start[1] + offsets.get(ijk[b], 0.0)
    one, two = math.dist(start, centre), math.dist(end, centre)
    if one < 1e-6 or abs(one - two) > SPIRAL:
        raise refused(number, "an arc", f"its end is {two:.4f} mm from its center, its beginning {one:.4f} mm")
    return Arc((a, b), centre, clockwise)
