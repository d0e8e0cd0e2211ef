"""Words of a letter and a number: what RS-274, Macro B and Siemens have in common."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..blocks import Block, Modal, Word, arc_of, refused

NUMBER = r"[-+]?\s*(?:[0-9]+\.?[0-9]*|\.[0-9]+)"  # no other digits that Unicode has: no control reads them
AXES = "XYZABC"
PLANES = {17: ("X", "Y", "Z"), 18: ("Z", "X", "Y"), 19: ("Y", "Z", "X")}
INSIDE = re.compile(r"\([^)]*\)|<[^>]*>")  # a comment within a word: X(half)10
AFTER = {0, 1, 2, 5, 9, 30, 60}  # M functions that act when the motion of their block is done
ENDS = frozenset({2, 30})  # M functions that end the program
# M functions that leave the path alone on every control: stops, spindle, tool, coolant, orientation, gears, overrides.
PLAIN = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 19, 30, *range(40, 46), 48, 49, 60}
FORGET = {28, 30, 30.1, 28.1}
MOST = 1e6  # mm, deg: no machine goes there
UNKNOWN = "what this does to the path is not known"
KINEMATICS = dict.fromkeys(
    (128, 428, 429, 430), "with tool center point control on the control itself moves the axes: compensate the control instead"
)
MOTION = {0: "rapid", 1: "feed", 2: "cw", 3: "ccw"}
REFUSED = {
    5: "splines are not followed",
    5.1: "splines are not followed",
    7: "diameters are not followed",
    10: "it writes offsets that this program cannot know",
    12.1: "polar and cylindrical interpolation is not followed",
    15: "polar coordinates are not followed",
    16: "polar coordinates are not followed",
    20: "inches are not compensated: let the post-processor write millimeters",
    33: "threads are not compensated",
    38.2: "probing moves are not compensated: what is measured would be wrong by the correction",
    38.3: "probing moves are not compensated",
    38.4: "probing moves are not compensated",
    38.5: "probing moves are not compensated",
    31: "probing moves are not compensated",
    41: "radius compensation changes the path after this program: let the CAM compute the path of the tool's center",
    42: "radius compensation changes the path after this program: let the CAM compute the path of the tool's center",
    41.1: "radius compensation changes the path after this program",
    42.1: "radius compensation changes the path after this program",
    43.1: "a tool length that is written into the program is not followed",
    43.2: "further tool lengths are not followed",
    44: "a tool length that is taken off is not followed",
    43.4: "with tool center point control on the control itself moves the axes: compensate the control instead",
    43.5: "with tool center point control on the control itself moves the axes: compensate the control instead",
    51: "scaling is not followed",
    50.1: "mirroring is not followed",
    51.1: "mirroring is not followed",
    52: "local coordinate systems are not followed",
    54.1: "additional work offsets are not followed",
    54.2: "fixture offsets that follow the table are not followed: compensate the control instead",
    54.4: "workpiece error compensation is not followed",
    65: "macros are not followed: expand them in the post-processor",
    66: "macros are not followed: expand them in the post-processor",
    68: "rotated coordinates are not followed",
    68.2: "tilted planes are not followed",
    68.3: "tilted planes are not followed",
    91: "incremental coordinates would add up their rounding: let the post-processor write absolute ones",
    92: "shifted coordinates are not followed",
    93: "inverse time would change with every part of a block",
    96: "constant cutting speed is for lathes",
}
GROUPS = (set(PLANES), {90, 91}, {90.1, 91.1})  # of which a block has one
CYCLES = {73, 74, 76, *range(81, 90)}


@dataclass(frozen=True)
class Style:
    """How a dialect writes: its words, comments, and what it refuses beyond `REFUSED`."""

    word: re.Pattern[str]
    comment: re.Pattern[str]
    refused: Mapping[float, str]
    harmless: frozenset[str] = frozenset()  # names that may stand in a block
    inch: tuple[float, ...] = (20,)
    metric: tuple[float, ...] = (21,)
    cycles: bool = True
    subprograms: tuple[int, ...] = (96, 97, 98, 99, 198)
    ends: frozenset[int] = ENDS
    machine: tuple[float, ...] = (53,)
    radius: str = "R"
    passed: frozenset[float] = frozenset()  # G functions that change nothing that is followed here, also beside a move
    alone: frozenset[float] = frozenset()  # those that do so only where no axis is named: beside one they may take its word
    numbered: frozenset[float] = frozenset()  # those of both that have P, Q, L or E
    offsets: frozenset[float] = frozenset(range(54, 60))  # work offsets
    dwell: str = ""  # axis words that may be the time of G4
    forgets: frozenset[float] = frozenset(FORGET)  # ways to reference and fixed points
    height: float | None = 43  # switches the tool's length on
    begins: re.Pattern[str] = re.compile(r"\s*[oO:]\d+\s*(?:$|[(<;])")  # the head of a program

    def known(self, code: float) -> bool:
        """number of a G function → whether it is known what it does to the path."""
        own = {*MOTION, *PLANES, 4, 90, *self.machine, *self.forgets, *self.metric, *self.passed, *self.alone, *self.offsets}
        return code in own or (self.height is not None and code in (self.height, 49))


OTHERS = "GFSDH"  # words that leave the path alone, or whose meaning is looked at elsewhere
LONGEST = 2000  # characters of a block


def read(style: Style, line: str, number: int, modal: Modal, axes: str) -> Block:
    """dialect, line, its number from 1, modal state (changed), axes of the machine → block. Raises InputError by name."""
    if len(line) > LONGEST:
        raise refused(number, line, f"a block of {len(line.rstrip())} characters, which no control reads")
    if modal.motion and style.begins.match(line):
        raise refused(number, line.strip(), "a second program begins here: make a file of each")
    bare = style.comment.sub(lambda m: " " * len(m[0]), line)
    block = Block(number, line)
    stripped = bare.strip()
    if stripped == "%" and modal.motion:
        modal.ended = modal.ended or "%"
    if not stripped or stripped == "%":
        return block
    over(modal, number, stripped)
    if stripped.startswith("/"):
        raise refused(number, "a block that may be skipped (/)", "where the machine goes then is not known: make two programs")
    words: list[Word] = []
    at = 0
    for match in style.word.finditer(bare):
        gap = bare[at : match.start()].strip()
        if gap:
            _strange(style, gap, number)
        letter, text = match["letter"].upper(), match["value"]
        value = number_in(number, match[0], text)
        if letter in AXES + "IJKR" and abs(value) > MOST:
            raise refused(number, f"{letter}{value:.3g}", "no machine goes there")
        words.append(Word(letter, value, match.start(), match.end()))
        at = match.end()
    if gap := bare[at:].strip():
        _strange(style, gap, number)
    if ";" in style.harmless and re.search(r";\s*[^\s;]", bare):
        raise refused(number, stripped, "a semicolon ends a block here: write each block on a line of its own")
    block.words = tuple(words)
    return _meaning(style, block, modal, axes)


def over(modal: Modal, number: int, found: str) -> None:
    """modal state, number of a block, what it says → nothing. Raises InputError where the program has ended before."""
    if modal.ended:
        raise refused(number, found, f"the program has ended with {modal.ended}: no control goes on after it; take it out")


def number_in(number: int, word: str, text: str) -> float:
    """number of a block, one of its words, digits of it → the number. Raises InputError for none, and for an infinite one."""
    try:
        value = float(text.replace(" ", ""))
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        place = word.strip()[:1].upper() in AXES + "IJKR"
        raise refused(number, word.strip(), "no machine goes there" if place else "no number that a control takes")
    return value


def _strange(style: Style, text: str, number: int) -> None:
    for item in text.split():
        if item.upper() in style.harmless:
            continue
        if re.match(r"(?i)[A-Z]{2,}\w*=", item):
            raise refused(number, item, UNKNOWN)
        if "#" in item or "[" in item or "=" in item or re.match(r"R\d", item):
            raise refused(number, text, "variables and expressions are not followed: let the post-processor write numbers")
        if re.match(r"(?i)IF|WHILE|GOTO?|DO\d*$|END\d*$|THEN", item):
            raise refused(number, item, "jumps and loops are not followed: let the post-processor write the path out")
        raise refused(number, text, UNKNOWN)


@dataclass(slots=True)
class _Said:
    """What the words of a block say: axes, centre or radius of an arc, and whether a tool is changed."""

    target: dict[str, float] = field(default_factory=dict)
    offsets: dict[str, float] = field(default_factory=dict)
    radius: float | None = None
    change: bool = False


def _meaning(style: Style, block: Block, modal: Modal, axes: str) -> Block:
    codes = [w.value for w in block.words if w.letter == "G"]
    home = set(codes) & style.forgets
    _allowed(style, block, modal, codes, bool(home))
    modal.incremental = modal.incremental and 90 not in codes
    modal.absolute = modal.absolute or 90 in codes
    modal.metric = modal.metric or any(code in style.metric for code in codes)
    found = _said(style, block, modal, axes, codes)
    if found.change:
        block.tool = modal.tool
        block.forgets = "XYZ"
        modal.stale = modal.length
    _switch(style, block, modal, codes)
    if home:
        block.forgets = "".join(found.target) or axes
        _forget(modal, block.forgets)
        return block
    if any(c in style.machine for c in codes):
        block.kind, block.forgets = "machine", "".join(found.target)
        _forget(modal, block.forgets)
        return block
    if block.forgets:
        _forget(modal, block.forgets)
    if 4 not in codes:
        _moves(style, block, modal, found)
    return block


def _allowed(style: Style, block: Block, modal: Modal, codes: Sequence[float], home: bool) -> None:
    """G functions of a block, whether it goes to a reference point. Raises InputError for one that is not followed, by its name."""
    number = block.number
    if len(set(codes) & MOTION.keys()) > 1:
        raise refused(number, " and ".join(f"G{c:g}" for c in codes if c in MOTION), "which one is meant is not known")
    for code in codes:
        if code == 91 and home:
            _step_to_reference(block)
            modal.incremental = True
            continue
        if code in style.refused:
            raise refused(number, f"G{code:g}", style.refused[code])
        if code in style.inch:
            raise refused(number, f"G{code:g}", REFUSED[20])
        if style.cycles and code in CYCLES:
            raise refused(number, f"G{code:g}", "canned cycles are not expanded here: let the post-processor write their moves")
        if not style.known(code):
            raise refused(number, f"G{code:g}", UNKNOWN)
    _stand_together(style, block, codes)


def _said(style: Style, block: Block, modal: Modal, axes: str, codes: Sequence[float]) -> _Said:
    """block, axes of the machine, G functions → what its words say. Raises InputError for one that is not followed, by its name."""
    number, found = block.number, _Said()
    for w in block.words:
        if w.letter in AXES:
            if w.letter not in axes:
                raise refused(number, f"{w.letter}{w.value:g}", f"this machine has no axis {w.letter}")
            if w.letter in found.target:
                raise refused(number, f"{w.letter} twice", "which one is meant is not known")
            found.target[w.letter] = w.value
        elif w.letter in "IJK":
            found.offsets[w.letter] = w.value
        elif w.letter == style.radius:
            found.radius = w.value
        elif w.letter == "T":
            modal.tool = int(w.value)
        elif w.letter == "M":
            if w.value == 6:
                found.change = True
            elif int(w.value) in style.subprograms:
                raise refused(number, f"M{w.value:g}", "subprograms are not followed: write them out")
            elif w.value in KINEMATICS:
                raise refused(number, f"M{w.value:g}", KINEMATICS[int(w.value)])
            elif w.value in (72, 73):
                raise refused(number, f"M{w.value:g}", "what it switches back is not followed")
            elif w.value not in PLAIN | style.ends:
                block.unknown = (*block.unknown, f"M{w.value:g}")
            if w.value in style.ends:
                modal.ended = f"M{w.value:g}"
        elif w.letter in "UVW":
            raise refused(number, f"{w.letter}{w.value:g}", "incremental or further linear axes are not followed")
        elif w.letter == "H" and style.height is not None and 49 not in codes:
            _height(block, w.value, modal)
        elif w.letter == "N":
            block.label = f"N{w.value:g}"
        elif w.letter not in OTHERS and not (w.letter in "PLQE" and set(codes) & {4, *style.numbered}):
            raise refused(number, f"{w.letter}{w.value:g}", UNKNOWN)
    return found


def _switch(style: Style, block: Block, modal: Modal, codes: Sequence[float]) -> None:
    """G functions → what they switch, for this block and for those after it."""
    number = block.number
    for code in codes:
        if code in PLANES:
            modal.plane = PLANES[int(code)]
        elif code in MOTION:
            modal.motion = MOTION[int(code)]
        elif style.height is not None and code in (style.height, 49):
            block.length = modal.length = code == style.height
            modal.stale = False
        elif code in style.offsets:
            name = f"G{code:g}"
            if modal.offset not in ("", name):
                raise refused(
                    number, f"{name} after {modal.offset}", "one work offset (--zero) is followed: make a program of each"
                )
            modal.offset = name
        elif code == 90.1:
            modal.absolute_centre = True
        elif code == 91.1:
            modal.absolute_centre = False
        elif code == 80:
            modal.motion = ""


def _moves(style: Style, block: Block, modal: Modal, found: _Said) -> None:
    """what the words say → the motion of the block. Raises InputError where nobody knows how it goes there."""
    number, target, offsets, radius = block.number, found.target, found.offsets, found.radius
    if not (target or (offsets and modal.motion in ("cw", "ccw"))):
        if offsets or radius is not None:
            _no_line(style, block)
        return
    if modal.incremental:
        raise refused(number, " ".join(f"{a}{v:g}" for a, v in target.items()), "G91 is still on: write G90 before it")
    if not modal.motion:
        raise refused(number, " ".join(f"{a}{v:g}" for a, v in target.items()), "no G0, G1, G2 or G3 says how to go there")
    if modal.stale and "Z" in target:
        why = (
            f"a tool was changed and the length of the one before may still act: write G{style.height:g} with its H before Z moves"
        )
        raise refused(number, f"Z{target['Z']:g} after M6", why)
    if modal.motion in ("cw", "ccw"):
        if any(a in "ABC" for a in target):
            raise refused(number, "an arc with a rotary axis", "its path is not known")
        block.arc = arc_of(number, modal, target, offsets, radius, clockwise=modal.motion == "cw")
        block.kind = "arc"
    elif offsets or radius is not None:
        _no_line(style, block)
    else:
        block.kind = "rapid" if modal.motion == "rapid" else "feed"
    block.target = target
    modal.position.update(target)


def _stand_together(style: Style, block: Block, codes: Sequence[float]) -> None:
    """Raises InputError where a G function takes words of axes, or of circles, for something else than a way to go."""
    named = [w for w in block.words if w.letter in AXES or w.letter in "IJK" or w.letter == style.radius]
    said = " ".join(f"{w.letter}{w.value:g}" for w in named)
    for group in (*GROUPS, {style.height, 49}):
        if len(several := dict.fromkeys(f"G{c:g}" for c in codes if c in group)) > 1:
            raise refused(block.number, " and ".join(several), "which one is meant is not known")
    for letter in (*"IJKHTD", style.radius):
        if len([w for w in block.words if w.letter == letter]) > 1:
            raise refused(block.number, f"{letter} twice", "which one is meant is not known")
    for code in codes:
        if code in style.alone and named:
            why = "it may take these words for itself, and then they are no move: give it a block of its own"
            raise refused(block.number, f"G{code:g} with {said}", why)
        if code == 4 and any(w.letter not in style.dwell for w in named):
            raise refused(
                block.number, f"G4 with {said}", "whether that is a time or a move is not known: give G4 a block of its own"
            )
    if 80 in codes and named and not MOTION.keys() & set(codes):
        raise refused(block.number, f"G80 with {said}", "no G0, G1, G2 or G3 says how to go there")
    stays = {4, *style.forgets, *style.machine}.intersection(codes)
    if named and len(stays) > 1:
        raise refused(block.number, " and ".join(f"G{c:g}" for c in sorted(stays)), "which one is meant is not known")


def _step_to_reference(block: Block) -> None:
    """G91 G28 Z0: nothing is incremental but the way to the reference point, and that begins where the axis is."""
    for w in block.words:
        if w.letter in AXES and w.value:
            raise refused(block.number, f"G91 with {w.letter}{w.value:g}", REFUSED[91])


def _height(block: Block, value: float, modal: Modal) -> None:
    """Tool length of a number: that of the tool, or where no T has named one, that of the number itself."""
    if value == 0:
        raise refused(block.number, "H0", "controls differ in whether it switches the tool's length off: write G49")
    if modal.tool is not None and value != modal.tool:
        raise refused(block.number, f"H{value:g} with tool {modal.tool}", "which length acts is not known: give them one number")
    if modal.tool is None:
        block.tool = int(value)


def _no_line(style: Style, block: Block) -> None:
    word = next(w for w in block.words if w.letter in ("I", "J", "K", style.radius))
    raise refused(block.number, f"{word.letter}{word.value:g} in a line", "some controls round or break a corner by it")


def _forget(modal: Modal, axes: str) -> None:
    for axis in axes:
        modal.position.pop(axis, None)


def write(block: Block, moves: Sequence[Mapping[str, float]], decimals: int, equals: str = "", first: str = "") -> list[str]:
    """block, corrected coordinates of its parts, decimals → lines. Comments and other words stay with the first part."""
    spans = [(w.begin, w.end, w) for w in block.words]
    arc = block.kind == "arc"
    drop = {"I", "J", "K", "R", "CR"} if arc else set()
    several = len(moves) > 1
    lines = []
    late = [w for w in block.words if several and w.letter == "M" and int(w.value) in AFTER]
    for i, move in enumerate(moves):
        if i == 0:
            text, at, done = "", 0, set()
            for begin, end, w in spans:
                text += block.text[at:begin]
                at = end
                within = "".join(INSIDE.findall(block.text[begin:end]))
                if w.letter in move:
                    text += _axis(w.letter, move[w.letter], decimals, equals) + within
                    done.add(w.letter)
                elif w.letter in drop or w in late:
                    text = text.rstrip(" ") if text.endswith(" ") and block.text[at : at + 1] in (" ", "") else text
                    text += within
                elif arc and w.letter == "G" and w.value in (2, 3):
                    text += "G1" + within
                else:
                    text += block.text[begin:end]
            more = [_axis(a, v, decimals, equals) for a, v in move.items() if a not in done]
            if arc and not any(w.letter == "G" and w.value in (2, 3) for w in block.words):
                more.insert(0, "G1")
            rest = block.text[at:]
            tail = rest.rstrip("\r\n")
            text = text.rstrip() + (" " if more else "") + " ".join(more) + tail
            lines.append(text)
        else:
            lines.append(" ".join(_axis(a, v, decimals, equals) for a, v in move.items()))
    if late:
        lines[-1] += "".join(f" M{int(w.value)}" for w in late)
    return lines


def _axis(letter: str, value: float, decimals: int, equals: str) -> str:
    return f"{letter}{equals}{value + 0.0:.{decimals}f}" if round(value, decimals) else f"{letter}{equals}0."
