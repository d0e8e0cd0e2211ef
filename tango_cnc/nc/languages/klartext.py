"""HEIDENHAIN Klartext: L, CC with C, CR; absolute, metric, R0, without cycles, planes and tool centre point control."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..blocks import Arc, Block, Modal, Word, arc_of, refused
from ._iso import AFTER, ENDS, LONGEST, MOST, NUMBER, REFUSED, number_in, over

SAYS = "HEIDENHAIN Klartext"
READS = ("klartext",)
LENGTH = True
COUNTED = True
UNITS = ("BEGIN PGM … MM",)
HEAD = re.compile(r"\s*(\d+\s*)?(BEGIN PGM .*|;.*)?\s*")
LINE = re.compile(r"\s*(?P<n>\d+)?\s*(?P<rest>.*?)\s*(?P<comment>;.*)?$", re.DOTALL)
WORD = re.compile(rf"(?P<letter>[XYZABC]|F(?=[\s\d.])|FMAX|FAUTO|R0|RL|RR|DR[-+]|R|M)\s*(?P<value>{NUMBER})?")
PASS = ("BEGIN PGM", "END PGM", "BLK FORM", "STOP", "LBL", "*")
CALLED = {
    89: "cycles are not expanded here: let the post-processor write their moves",
    94: "the position of rotary axes would be another number",
    97: "radius compensation changes the path after this program",
    98: "radius compensation changes the path after this program",
    99: "cycles are not expanded here: let the post-processor write their moves",
    112: "smoothing would take the correction away",
    114: REFUSED[43.4],
    118: "what the handwheel adds is not known",
    124: "points that are left out would take the correction away",
    126: "which way rotary axes turn is not known",
    128: REFUSED[43.4],
    130: "with M130 the words have another meaning",
    140: "where it retracts to is not known",
    144: REFUSED[43.4],
}
# Of the machine's builder up to 88; 90 to 92 and from 101 on: feeds, look-ahead, exact stops, limits, the laser.
LEAVES = {*range(89), 90, 91, 92, *range(101, 112), 116, 117, 120, 127, 134, 135, 136, 137, 148, 149, 150, *range(200, 205)}
WHY = {
    "LN": "surface normals are corrected by the control itself",
    "LP": "polar coordinates are not followed",
    "CP": "polar coordinates are not followed",
    "CT": "tangential arcs are not followed",
    "CTP": "tangential arcs are not followed",
    "RND": "roundings are not followed",
    "CHF": "chamfers are not followed",
    "CYCL": "cycles are not expanded here: let the post-processor write their moves",
    "CALL": "subprograms are not followed: write them out",
    "PLANE": "tilted planes are not followed",
    "FUNCTION": REFUSED[43.4],
    "TCH": "probing is not compensated",
    "FN": "parameters and jumps are not followed",
    "Q": "parameters are not followed",
    "APPR": "approaches are not followed",
    "DEP": "departures are not followed",
    "FL": "free contours are not followed",
    "FC": "free contours are not followed",
    "SEL": "subprograms are not followed: write them out",
    "PATTERN": "patterns are not followed",
    "TRANS": "shifts are not followed",
}


def mark(text: str) -> str:
    """text → a comment line."""
    return f"; {text}"


def read(line: str, number: int, modal: Modal, axes: str) -> Block:
    """line, its number, modal state, axes → block. Raises InputError by name."""
    if len(line) > LONGEST:
        raise refused(number, line, f"a block of {len(line.rstrip())} characters, which no control reads")
    block = Block(number, line)
    parts = LINE.match(line.rstrip("\r\n"))
    assert parts is not None
    rest, begin = parts["rest"], parts.start("rest")
    block.label = parts["n"] or ""
    if not rest:
        return block
    upper = rest.upper()
    if upper.startswith("BEGIN PGM") and (modal.position or modal.ended):
        raise refused(number, rest, "a second program begins here: make a file of each")
    if not upper.startswith("END PGM"):
        over(modal, number, rest)
    else:
        modal.ended = "END PGM"
    if upper.startswith("BEGIN PGM") and "INCH" in upper.split():
        raise refused(number, "INCH", REFUSED[20])
    if upper.startswith("BEGIN PGM") and upper.split()[-1] == "MM":
        modal.metric = modal.absolute = True
    if upper.startswith(PASS):
        return block
    head = upper.split()[0]
    if upper.startswith("TOOL CALL"):
        found = re.match(r"TOOL CALL\s+([0-9]+)(?![\d.])(?:\s+([XYZUVW])\b)?", upper)
        if found and found[2] not in (None, "Z"):
            raise refused(number, rest, "tools along another axis than Z are not followed")
        if not found and not re.match(r"TOOL CALL\s*(Z\b|S|F|$)", upper):
            raise refused(number, rest, "which tool that is, is not known: call it by its whole number")
        if re.search(r"\bD[LR]", upper):
            raise refused(number, rest, "oversizes of the tool are not followed")
        block.tool = int(found[1]) if found else None
        block.forgets = "XYZ" if found else ""
        for axis in block.forgets:
            modal.position.pop(axis, None)
        return block
    if upper.startswith("TOOL DEF"):
        if re.search(r"\b[LR]\s*[-+.\d]", upper):
            raise refused(number, rest, "a tool length that is written into the program is not followed")
        return block
    for word, why in WHY.items():
        if head == word or (word == "Q" and re.match(r"Q[LRS]?\d", head)):
            raise refused(number, rest, why)
    kind = {"L": "L", "CC": "CC", "C": "C", "CR": "CR"}.get(head)
    if kind is None:
        if not re.fullmatch(r"(M[0-9]+\s*)+", upper):
            raise refused(number, rest, "what this does to the path is not known")
        for code in re.findall(r"\d+", upper):
            _function(number, float(code), modal)
        return block
    return _motion(block, kind, rest[len(head) :], begin + len(head), modal, axes)


def _function(number: int, code: float, modal: Modal) -> None:
    """Raises InputError for an M function that is not known to leave the path alone; notes one that ends the program."""
    if code not in LEAVES:
        raise refused(number, f"M{code:g}", CALLED.get(int(code), "what this does to the path is not known"))
    if code in ENDS:
        modal.ended = f"M{code:g}"


@dataclass(slots=True)
class _Said:
    """Words of a motion: its target by axis, radius, sense of an arc, whether it goes to a place of the machine."""

    words: list[Word] = field(default_factory=list)
    target: dict[str, float] = field(default_factory=dict)
    radius: float | None = None
    clockwise: bool | None = None
    machine: bool = False


def _motion(block: Block, kind: str, text: str, shift: int, modal: Modal, axes: str) -> Block:
    """block, L, C, CR or CC, its text, where that begins, modal state, axes → the block with what it says."""
    said = _words(block.number, text, shift, modal, axes)
    block.words = tuple(said.words)
    if kind == "CC":
        return _pole(block, said, modal)
    if said.machine:
        block.kind, block.forgets = "machine", "".join(said.target)
        for axis in said.target:
            modal.position.pop(axis, None)
        return block
    if kind in ("C", "CR"):
        block.arc, block.kind = _arc(block, kind, said, modal), "arc"
    elif said.radius is not None or said.clockwise is not None:
        raise refused(block.number, block.text.strip(), "R and DR belong to an arc, and L is a line")
    elif said.target:
        block.kind = "rapid" if any(w.letter == "FMAX" for w in said.words) else "feed"
    block.target = said.target
    modal.position.update(said.target)
    return block


def _words(number: int, text: str, shift: int, modal: Modal, axes: str) -> _Said:
    """block number, text, where it begins, modal state, axes → its words. Raises InputError for what is not followed."""
    said, at = _Said(), 0
    for match in WORD.finditer(text):
        if gap := text[at : match.start()].strip():
            why = "incremental coordinates would add up their rounding" if gap.startswith("I") else "it is not followed"
            raise refused(number, gap, why)
        at = match.end()
        letter, value = match["letter"], match["value"]
        number_of = number_in(number, match[0], value) if value is not None else 0.0
        said.words.append(Word(letter, number_of, shift + match.start(), shift + match.end()))
        if letter in ("RL", "RR"):
            raise refused(number, letter, REFUSED[41])
        if letter in "XYZABC":
            _aimed(number, match[0], letter, None if value is None else number_of, said.target, axes)
        elif letter == "R" and value is not None:
            said.radius = number_of
        elif letter.startswith("DR"):
            said.clockwise = letter == "DR-"
        elif letter == "M":
            if value is None:
                raise refused(number, "M", "no number follows: parameters are not followed")
            _function(number, number_of, modal)
            said.machine = said.machine or number_of in (91, 92)
    if gap := text[at:].strip():
        why = "radius compensation changes the path after this program" if gap in ("RL", "RR") else "it is not followed"
        raise refused(number, gap, why)
    return said


def _aimed(number: int, word: str, letter: str, value: float | None, target: dict[str, float], axes: str) -> None:
    """Block number, word, its axis and value, None without a number → into `target`. Raises InputError for what no axis can do."""
    if letter not in axes:
        raise refused(number, word, f"this machine has no axis {letter}")
    if value is None:
        raise refused(number, word.strip(), "no number follows: parameters are not followed")
    if letter in target:
        raise refused(number, f"{letter} twice", "which one is meant is not known")
    if abs(value) > MOST:
        raise refused(number, f"{letter}{value:.3g}", "no machine goes there")
    target[letter] = value


def _pole(block: Block, said: _Said, modal: Modal) -> Block:
    """block of a CC → the same; the modal state has the center."""
    if len(said.target.keys() & {"X", "Y"}) == 1:
        raise refused(block.number, block.text.strip(), "which other coordinate the control takes is not known: write both")
    pole = {**modal.position, **said.target}
    if not {"X", "Y"} <= pole.keys():
        raise refused(block.number, "CC", "where it is, is not known: X or Y has not been programmed before")
    modal.centre = pole["X"], pole["Y"]
    if set(said.target) - {"X", "Y"}:
        raise refused(block.number, "CC", "circles outside of the plane XY are not followed")
    block.kind, block.label = "none", "CC"
    return block


def _arc(block: Block, kind: str, said: _Said, modal: Modal) -> Arc:
    """block, C or CR, its words → the arc in XY, mm."""
    number = block.number
    if any(axis in "ABC" for axis in said.target):
        raise refused(number, "an arc with a rotary axis", "its path is not known")
    if kind == "C" and said.radius is not None:
        raise refused(number, block.text.strip(), "C turns about its CC and has no radius: write CR")
    if said.clockwise is None:
        raise refused(number, block.text.strip(), "no DR+ or DR- says which way it turns")
    if kind == "CR":
        arc = arc_of(number, modal, said.target, {}, said.radius, clockwise=said.clockwise)
    else:
        if modal.centre is None:
            raise refused(number, "C", "no CC says where its center is")
        if not {"X", "Y"} <= modal.position.keys():
            raise refused(number, "C", "where it begins is not known: X or Y has not been programmed before")
        away = {"I": modal.centre[0] - modal.position["X"], "J": modal.centre[1] - modal.position["Y"]}
        arc = arc_of(number, modal, said.target, away, None, clockwise=said.clockwise)
    return Arc(("X", "Y"), arc.centre, said.clockwise)


def write(block: Block, moves: Sequence[Mapping[str, float]], decimals: int) -> list[str]:
    """block, corrected parts → lines; block numbers stay with the first part, which other parts repeat."""
    parts = LINE.match(block.text.rstrip("\r\n"))
    assert parts is not None
    number = f"{parts['n']} " if parts["n"] else ""
    kept = [w for w in block.words if w.letter not in "XYZABC" and not w.letter.startswith("DR") and w.letter != "R"]
    lines = []
    for i, move in enumerate(moves):
        axes = " ".join(f"{a}{v + 0.0:+.{decimals}f}" for a, v in move.items())
        more = [
            block.text[w.begin : w.end].strip()
            for w in kept
            if (w.letter != "M" and (i == 0 or w.letter in ("FMAX",))) or (w.letter == "M" and _here(w, i, len(moves)))
        ]
        comment = f" {parts['comment']}" if i == 0 and parts["comment"] else ""
        lines.append(f"{number}L {axes}{' ' if more else ''}{' '.join(more)}{comment}")
    return lines


def _here(word: Word, i: int, count: int) -> bool:
    return i == (count - 1 if int(word.value) in AFTER else 0)
