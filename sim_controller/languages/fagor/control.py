"""A Fagor-like control (8060, 8065, 8070), with its habits: G100 that meets nothing goes on without a word, MEASOK tells, only the
axes of its block are measured, zero offset and tool offset stay until G53 and D0, RTCP until it is switched off, variables may be
read ahead of the axes, local parameters are few and empty at the start, #WRITE counts its identifiers.

Known of real ones: $IF $ENDIF, #MCS, #CS, #RTCP, #HSC, G53, G70, G71, D (a postprocessor for the 8065), V.A.PPOS (programs of
users), G100 to G103 (contents of the manual). The rest is from memory, and `Profile` has it several ways.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from math import radians
from typing import Literal

from tango_cnc.records import Machine

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Alarm
from .._shared.bracket_axes import Axes
from .._shared.bracket_expressions import ARITHMETIC, FUNCTIONS, Grammar, Mistake, Reader, Value
from .._shared.known import ORIENT, Controls
from .._shared.memory import stored
from .._shared.scales import as_alarm, endless
from .alarms import alarm

G_CODES = {0, 1, 4, 5, 7, 17, 18, 19, 40, 50, 53, 54, 60, 61, 70, 71, 73, 80, 90, 91, 94, 100, 103}
RTCP = 50.0  # mm or deg
SWITCHES = ("MCS", "CS", "ACS", "RTCP", "TLC", "HSC")
OPERATORS: Mapping[str, Callable[[float, float], float]] = {
    "==": lambda a, b: float(a == b),
    "!=": lambda a, b: float(a != b),
    ">=": lambda a, b: float(a >= b),
    "<=": lambda a, b: float(a <= b),
    ">": lambda a, b: float(a > b),
    "<": lambda a, b: float(a < b),
}
LOGIC: tuple[Mapping[str, Callable[[float, float], float]], ...] = (
    {"|": lambda a, b: float(bool(a) or bool(b)), "^": lambda a, b: float(bool(a) != bool(b))},
    {"&": lambda a, b: float(bool(a) and bool(b))},
)
NUMBER, NAME = r"\d+\.?\d*|\.\d+", r"V(?:\.[A-Z][A-Z0-9]*)+|P\d*|[A-Z]+"
GRAMMAR = Grammar(
    re.compile(rf"\s*(?:(?P<number>{NUMBER})|(?P<name>{NAME})|(?P<sign>[=!<>]=|[-+*/<>&|^\[\]]))"),
    FUNCTIONS,
    (*LOGIC, OPERATORS, *ARITHMETIC),
    {},
)
LETTER = re.compile(r"\s*([A-Z])")
LITERAL = re.compile(rf"\s*([+-]?(?:{NUMBER}))(?![\w.])")


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control; every default is a guess that a real machine may refute."""

    axes: tuple[str, ...]
    increment: Decimal = Decimal("0.001")  # mm and deg
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg, zero offset active from the start, until G53
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # D → mm; D1 is active from the start
    memory: int = 512  # kB free for a program; 0: it runs from a disk
    rollover: tuple[str, ...] = ()
    signed_direction: bool = False  # the sign of a roll-over axis' angle is its direction
    miss: Literal["silent", "alarm"] = "silent"  # G100 that meets nothing
    orient: str = "S"  # letter of the angle behind M19; behind another one the spindle stays as it is
    probe_input: int = 1  # that the probe is wired to, 1 or 2
    deflected: Literal["alarm", "ends", "ignore"] = "alarm"  # G100 with a probe that is deflected before it starts
    status: Literal["tells", "sticks", "never"] = "tells"  # MEASOK
    measured: Literal["all", "named"] = "all"  # axes that G100 measures
    base_offset: Mapping[str, float] = field(default_factory=dict)  # mm and deg, of the PLC: G53 leaves it in
    transformation: bool = False  # RTCP is active from the start: here a shift that nobody expects
    scaled: Mapping[str, float] = field(default_factory=dict)  # of work coordinates; -1 is a mirror image (G11 to G13, G72)
    inch_positions: bool = False  # an inch machine: variables of positions stay in inches, whatever G70 and G71 say
    rounded: Decimal = Decimal(0)  # mm that positions come in whole steps of, as on the display; 0: as they are
    waits: bool = True  # variables of positions wait for the axes; else they are as old as the last dwell
    identifiers: Decimal = Decimal(5)  # that #WRITE takes in one line
    decimals: Decimal = Decimal(4)  # of a number that #WRITE prints
    parameters: Decimal = Decimal(25)  # the last local one


CONTROLS = Controls({"probe_input": "probe_input"}, {"orient": ORIENT})


def default_profile(machine: Machine) -> Profile:
    """machine → profile with its axes; those that turn more than two turns roll over."""
    return Profile((*machine.linear, *machine.rotary), rollover=endless(machine))


class Control:
    """The control's memory from switching on to switching off; `files` is what #WRITE left in it."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._zero, self._rtcp = True, profile.transformation
        self._offsets: dict[str, float] = {}
        self._frame()
        self._axes = Axes(
            motion, profile.axes, profile.increment, self._offsets, profile.rollover, profile.signed_direction, profile.scaled
        )
        self._axes.length = profile.tool_lengths.get(1, 0.0)
        self._local: dict[int, Value] = {}
        self._measured: dict[str, tuple[float, float]] = dict.fromkeys(profile.axes, (0.0, 0.0))  # machine, programmed
        self._ok: set[str] = set()
        self.files: dict[str, str] = {}
        self._file, self._motion_code, self._feed, self._selected = "", 0, 0.0, 1

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of one program, which is stored before it is executed. Raises Alarm and Silence."""
        self._local, self._file, self._motion_code = {}, "", 0
        shown = list(stored(lines, self._profile.memory, lambda where: alarm("memory", where)))
        blocks = [_bare(line) for line in shown]
        if not blocks or not re.fullmatch(r"%[A-Z0-9_]{1,14}", blocks[0]):
            raise alarm("header")
        try:
            self._program(blocks, shown)
        except MotionStop as stop:
            raise as_alarm(stop, alarm) from None
        except Mistake as mistake:
            raise alarm(mistake.kind, str(mistake)) from None
        finally:
            self._file = ""

    def _program(self, blocks: list[str], shown: list[str]) -> None:
        partners, index = _structures(blocks), 1
        while index < len(blocks):
            text = blocks[index]
            self._note("block", program=blocks[0], line=index + 1, text=text)
            self._motion.reads(shown[index])
            if re.fullmatch(r"M(30|0?2)", text):
                return
            if text.startswith("$IF "):
                index = index if self._value(text[4:]) else partners[index]
            elif text == "$ELSE":
                index = partners[index]
            elif text and text != "$ENDIF":
                self._statement(text)
            index += 1
        raise alarm("end")

    def _value(self, text: str) -> Value:
        return Reader(text, GRAMMAR, self._get).whole()

    def _get(self, name: str, index: float | None) -> Value:
        if match := re.fullmatch(r"P(\d*)", name):
            return self._local.get(self._parameter(int(match[1]) if match[1] else int(index or -1)))
        if index is None and name in ("V.G.PRBST1", "V.G.PRBST2"):
            return float(self._motion.deflected and int(name[-1]) == self._profile.probe_input)
        kind, _, axis = name.rpartition(".")
        if index is None and kind.startswith("V.A.") and axis in self._profile.axes:
            return self._of_axis(kind[4:], axis)
        raise alarm("variable", name)

    def _of_axis(self, kind: str, axis: str) -> float:
        """Positions of the base are without tool length, those of the tip with it; real ones wait for the axes."""
        if kind == "MEASOK":
            return float(axis in self._ok or self._profile.status == "sticks") * (self._profile.status != "never")
        if self._profile.waits:
            self._axes.settle()
        now, frame = self._axes.known(axis), self._offsets[axis]
        length = self._axes.length if axis == "Z" else 0.0
        machine, programmed = self._measured[axis]
        table = {
            "POS": now,
            "APOS": now - frame,
            "ATIPPOS": now - frame - length,
            "PPOS": now - frame - length,
            "MEAS": machine,
            "ATIPMEAS": programmed,
        }
        if kind not in table:
            raise alarm("variable", f"V.A.{kind}.{axis}")
        step, inch = float(self._profile.rounded), self._profile.inch_positions and axis in "XYZ"
        return (round(table[kind] / step) * step if step else table[kind]) / (25.4 if inch else 1.0)

    def _parameter(self, number: int) -> int:
        if not 0 <= number <= int(self._profile.parameters):
            raise alarm("parameter", f"P{number}")
        return number

    def _statement(self, text: str) -> None:
        if match := re.fullmatch(r"P(\d+)\s*=(?!=)(.+)", text):
            self._local[self._parameter(int(match[1]))] = self._value(match[2])
        elif text.startswith("#") and not text.startswith("#MCS G"):
            self._high_level(text)
        elif text.startswith("$"):
            raise alarm("structure", text)
        else:
            self._nc(text.removeprefix("#MCS "), text.startswith("#MCS "))

    def _high_level(self, text: str) -> None:
        if match := re.fullmatch(r"#([A-Z]+) (ON|OFF)", text):
            self._switch(match[1], match[2] == "ON")
        elif match := re.fullmatch(r'#ERROR \["([^"]*)"\]', text):
            raise Alarm("#ERROR", match[1])
        elif match := re.fullmatch(r'#MSG \["([^"]*)"\]', text):
            self._note("message", text=match[1])
        elif re.fullmatch(r"#SELECT PROBE \[[12]\]", text):
            self._selected = int(text[-2])
            self._note("probe", input=text[-2])
        elif match := re.fullmatch(r'#OPEN \["([A-Z]:[^"]+)"(?:,"([AD])")?\]', text):
            self._file = match[1]
            self.files[self._file] = "" if match[2] == "D" else self.files.get(self._file, "")
        elif text == "#CLOSE":
            self._file = ""
        elif match := re.fullmatch(r'#WRITE \["([^"]*)"((?:,[^,]+)*)\]', text):
            self._write(match[1], [part for part in match[2].split(",") if part])
        else:
            raise alarm("statement", text)

    def _switch(self, word: str, on: bool) -> None:
        if word not in SWITCHES:
            raise alarm("statement", f"#{word}")
        if word == "MCS":
            self._axes.machine = on
        elif word == "RTCP":
            self._rtcp = on
            self._frame()

    def _frame(self) -> None:
        """Machine minus programmed position of each axis, without the tool."""
        for name in self._profile.axes:
            zero = self._profile.g54.get(name, 0.0) if self._zero else 0.0
            self._offsets[name] = zero + self._profile.base_offset.get(name, 0.0) + RTCP * self._rtcp

    def _write(self, text: str, given: list[str]) -> None:
        if not self._file:
            raise alarm("file", text)
        values = [Reader(part, GRAMMAR, self._get).number() for part in given]
        if len(values) != text.count("%D") or len(values) > int(self._profile.identifiers):
            raise alarm("format", text)
        decimals = int(self._profile.decimals)
        for value in values:
            text = text.replace("%D", f"{value:.{decimals}f}", 1)
        self._note("output", text=text)
        self.files[self._file] += text + "\r\n"
        self._punch(text.encode("ascii", "replace") + b"\r\n")

    def _nc(self, text: str, machine: bool) -> None:
        words = self._words(text)
        g_codes = [int(value) for letter, value in words if letter == "G"]
        m_codes = [int(value) for letter, value in words if letter == "M"]
        rest = {letter: value for letter, value in words if letter not in "GM"}
        if any(code not in G_CODES for code in g_codes):
            raise alarm("g-code", text)
        if 4 in g_codes:
            self._motion.dwell(rest.get("K", 0.0))
            self._axes.settle()
            return
        self._modal(g_codes)
        if "D" in rest:
            number = int(rest.pop("D"))
            if number and number not in self._profile.tool_lengths:
                raise alarm("offset", text)
            self._axes.length = self._profile.tool_lengths[number] if number else 0.0
        if 19 in m_codes:
            if (angle := rest.pop(self._profile.orient, None)) is not None:
                self._motion.rapid({"S": radians(angle % 360)})
            rest.pop("S", None)  # a speed
        self._feed = rest.pop("F", self._feed)
        for code in m_codes:
            self._note("stop" if code in (0, 1) else "m", why=f"M{code}")
        self._move(g_codes, rest, text, machine)

    def _words(self, text: str) -> list[tuple[str, float]]:
        """`X[-98.-P1]`, `Y3.5`, `ZP4` → letters and values."""
        words, at = [], 0
        while text[at:].strip():
            letter = LETTER.match(text, at)
            if letter is None:
                raise alarm("syntax", text)
            at = letter.end()
            if literal := LITERAL.match(text, at):
                words.append((letter[1], float(literal[1])))
                at = literal.end()
            elif text[at : at + 1] in ("[", "P"):
                reader = Reader(text, GRAMMAR, self._get, at)
                words.append((letter[1], self._bracket(reader)))
                at = reader.at
            else:
                raise alarm("syntax", text)
        return words

    def _bracket(self, reader: Reader) -> float:
        """`[…]` or a parameter, and nothing behind it that belongs to the next word."""
        if reader.take("[") is None:
            match = re.compile(r"P\d+").match(reader.text, reader.at)
            if match is None:
                raise alarm("syntax", reader.text)
            reader.at = match.end()
            return Reader(match[0], GRAMMAR, self._get).number()
        value = reader.number()
        if reader.take("]") is None:
            raise alarm("syntax", reader.text)
        return value

    def _modal(self, g_codes: list[int]) -> None:
        for code in g_codes:
            if code in (90, 91):
                self._axes.incremental = code == 91
            elif code in (0, 1):
                self._motion_code = code
            elif code in (53, 54):
                self._zero = code == 54
                self._frame()
            elif code == 70:
                raise alarm("g-code", "G70: this machine works in millimetres")

    def _move(self, g_codes: list[int], targets: dict[str, float], text: str, machine: bool) -> None:
        for letter in targets:
            if letter not in self._profile.axes:
                raise alarm("axis", f"{letter} in {text}")
        if not targets:
            return
        if (100 in g_codes or self._motion_code == 1) and self._feed <= 0:
            raise alarm("feed", text)
        if 100 in g_codes:
            self._probe(targets)
            return
        length, self._axes.length = self._axes.length, 0.0 if machine else self._axes.length
        self._axes.move(targets, self._feed if self._motion_code == 1 else None, machine or None)
        self._axes.length = length

    def _probe(self, targets: dict[str, float]) -> None:
        """G100: where the probe was met, by machine and by programmed coordinates; MEASOK says whether it was."""
        self._ok = set()
        self._motion.watches(self._selected == self._profile.probe_input)
        try:
            self._looking(targets)
        finally:
            self._motion.watches(True)

    def _looking(self, targets: dict[str, float]) -> None:
        if self._motion.deflected and self._profile.deflected != "ends":
            if self._profile.deflected == "alarm":
                raise alarm("probe", "deflected at the start of G100")
            self._axes.move(targets, self._feed)
            return
        skip = self._axes.skip(targets, self._feed)
        if not skip.hit:
            if self._profile.miss == "alarm":
                raise alarm("probe", "no contact")
            return
        named = self._profile.axes if self._profile.measured == "all" else tuple(targets)
        self._ok = set(named)
        found = self._axes.skipped
        self._measured |= {name: (found[name], found[name] - self._axes.shift(name, False)) for name in named}


def _bare(line: str) -> str:
    """line → without comment and block number; a ; in a text begins none."""
    match = re.match(r'(?:[^";]|"[^"]*"?)*', line)
    assert match is not None
    return re.sub(r"^N\d+\s*:?\s*", "", match[0].strip())


def _structures(blocks: list[str]) -> dict[int, int]:
    """→ index of $IF → its $ELSE or $ENDIF, of $ELSE → its $ENDIF. Raises Alarm for what is not closed."""
    pairs: dict[int, int] = {}
    begun: list[int] = []
    for index, text in enumerate(blocks):
        if text.startswith("$IF "):
            begun.append(index)
        elif text in ("$ELSE", "$ENDIF"):
            if not begun:
                raise alarm("structure", text)
            pairs[begun.pop()] = index
            if text == "$ELSE":
                begun.append(index)
    if begun:
        raise alarm("structure", blocks[begun[-1]])
    return pairs
