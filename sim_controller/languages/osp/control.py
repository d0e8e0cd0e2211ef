"""An Okuma-like control of a mill, with its habits: IF knows only jumps, a skip move that meets nothing goes on without a word,
variables of positions are as old as the last wait, G15 H0 leaves the tool length in, whole numbers may be thousandths, PUT loses
digits that have no place, an alarm by VDOUT shows sixteen characters, a second run appends to the file of the first.

Known of real ones: FWRITC, PUT, WRITE C, CLOSE C, VUACM, VDOUT, VRSTT, CALL with its arguments, RTS, local and common variables
(programs of users); G15, G16, G53, VZOF, VAPA, VSAP, VACOD by name (lists of variables). What a mill's skip move does is not known:
`Profile` has it both ways.
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
from .._shared.bracket_expressions import ARITHMETIC, FUNCTIONS, Grammar, Mistake, Reader, Value, held
from .._shared.known import ORIENT, Controls
from .._shared.memory import stored
from .._shared.scales import as_alarm, endless
from .alarms import alarm
from .program import LOCAL, Program, split

DEEPEST = 8  # levels of subprograms
COMMON = 200  # variables VC1 …
SHOWN = 16  # characters of a user's alarm
LONGEST = 160  # characters of a block
IDLE = 2_000  # blocks without a motion after which the operator takes a program for one that turns in a circle
G_CODES = {0, 1, 4, 10, 11, 15, 16, 17, 18, 19, 20, 21, 31, 40, 53, 56, 69, 80, 90, 91, 94, 170}
WAITS = (0, 1, 331)  # M codes after which nothing is read ahead
COMPARE: Mapping[str, Callable[[float, float], float]] = {
    "EQ": lambda a, b: float(a == b),
    "NE": lambda a, b: float(a != b),
    "GT": lambda a, b: float(a > b),
    "GE": lambda a, b: float(a >= b),
    "LT": lambda a, b: float(a < b),
    "LE": lambda a, b: float(a <= b),
}
LOGIC: tuple[Mapping[str, Callable[[float, float], float]], ...] = (
    {"OR": lambda a, b: float(bool(a) or bool(b)), "EOR": lambda a, b: float(bool(a) != bool(b))},
    {"AND": lambda a, b: float(bool(a) and bool(b))},
)
GRAMMAR = Grammar(
    re.compile(r"\s*(?:(?P<number>\d+\.?\d*|\.\d+)|(?P<name>[A-Z][A-Z0-9]*)|(?P<sign>[-+*/\[\]]))"),
    FUNCTIONS,
    (*LOGIC, COMPARE, *ARITHMETIC),
    {"EQ": COMPARE["EQ"], "NE": COMPARE["NE"]},
)
COMPUTED = re.compile(r"(?<![A-Z])([XYZABC])\s*=\s*([^ ]+)")  # an expression stands behind =
WORD = re.compile(r"\s*(?P<letters>RS|[A-Z])(?P<equals>\s*=)?\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+))?(?![\d.])")

PROBE = 11  # input variable of the probe: one of the EC inputs, which is the builder's choice
TIMERS = range(1000, 1005)  # input variables that count from switching on, in ms, s, min, h, days (OSP-P200L 5238-E p. 297)
RUNNING = 3.0  # that they show here


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control; every default is a guess that a real machine may refute."""

    axes: tuple[str, ...]
    increment: Decimal = Decimal("0.001")  # mm and deg, the least input
    whole: Literal["mm", "um"] = "um"  # what a number without decimal point counts
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg, work offset active from the start (H1)
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # H → mm; 1 is active from the start
    rollover: tuple[str, ...] = ()
    signed_direction: bool = False  # the sign of a roll-over axis' angle is its direction
    miss: Literal["keep", "end", "alarm"] = "keep"  # what VSAP holds after a skip move that met nothing
    deflected: Literal["ends", "ignore", "alarm"] = "ends"  # a skip move whose probe is deflected before it starts
    contact_frame: Literal["machine", "work"] = "machine"  # of VSAP
    indexed: bool = True  # VSAP has an index, VAPA has none (lists of variables write VSAP*[ ] and VAPA*)
    wait: bool = True  # M331 waits; else it does not
    skip_word: str = "G31"  # of the move that the probe ends; behind another one it goes its whole way
    decimals: Decimal = Decimal(4)  # that PUT prints
    orient: str = "RS"  # letter of the angle behind M19; behind another one the spindle stays as it is
    scaled: Mapping[str, float] = field(default_factory=dict)  # of what is programmed, in H0 too; -1 is a mirror image
    memory: int = 512  # kB free for a program; 0: it runs from a disk
    restart: bool = False  # sequence restart: VRSTT is 128


CONTROLS = Controls(shown_by={"orient": ORIENT})


def default_profile(machine: Machine) -> Profile:
    """machine → profile with its axes; those that turn more than two turns roll over."""
    return Profile((*machine.linear, *machine.rotary), rollover=endless(machine))


class Control:
    """The control's memory from switching on to switching off; `files` is what WRITE left in it."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._axes = Axes(motion, profile.axes, profile.increment, profile.g54, profile.rollover, profile.signed_direction)
        self._axes.length = profile.tool_lengths.get(1, 0.0)
        self._stored = split(library)
        self._common: dict[str, Value] = {}
        self._contact = {name: 0.0 for name in profile.axes}
        self.files: dict[str, str] = {}
        self._file, self._line, self._message, self._remark = "", "", "", ""
        self._motion_code, self._feed = 0, 0.0
        self._idle, self._moved = 0, 0.0

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of one file, which is stored before it is executed. Raises Alarm and Silence."""
        programs = split(stored(lines, self._profile.memory, lambda where: alarm("memory", where)))
        if not programs:
            raise alarm("name", "the file has no program name")
        self._programs = self._stored | programs
        self._motion_code, self._file, self._line, self._idle = 0, "", "", 0
        self._axes.settle()
        try:
            self._execute(next(iter(programs.values())), {}, 0)
        except Alarm:
            self._leaves()
            raise
        except MotionStop as stop:
            self._leaves()
            raise as_alarm(stop, alarm) from None
        except Mistake as mistake:
            self._leaves()
            raise alarm(mistake.kind, str(mistake)) from None

    def _leaves(self) -> None:
        """An alarm closes nothing: the file stays open until RESET."""
        if self._file:
            self._note("left open", what=self._file)

    def _execute(self, program: Program, local: dict[str, Value], depth: int) -> bool:
        """→ whether M02 or M30 ended everything."""
        index = 0
        while index < len(program.blocks):
            self._idle = 0 if self._motion.time > self._moved else self._idle + 1
            self._moved = self._motion.time
            if self._idle > IDLE:
                raise alarm("end", f"{program.name} turns in a circle")
            text = program.blocks[index]
            self._note("block", program=program.name, line=program.lines[index], text=text)
            self._remark = program.remarks[index]
            self._motion.reads(self._remark)
            if len(text) > LONGEST:
                raise alarm("text", text[:40])
            index += 1
            if match := re.fullmatch(r"IF\s*(\[.*\])\s*(?:GOTO\s*)?(N[A-Z0-9]+)", text):
                if self._value(match[1], local):
                    index = program.sequence(match[2])
            elif match := re.fullmatch(r"GOTO\s*(N[A-Z0-9]+)", text):
                index = program.sequence(match[1])
            elif text == "RTS":
                if not depth:
                    raise alarm("end", "RTS in the main program")
                return False
            elif match := re.fullmatch(r"CALL\s+(O[A-Z0-9]{1,4})((?:\s+[A-Z][A-Z0-9]{0,3}\s*=\s*[^ ]+)*)", text):
                if self._call(match[1], match[2], local, depth):
                    return True
            elif text and self._statement(text, local):
                return True
        raise alarm("end", program.name)

    def _call(self, name: str, arguments: str, local: dict[str, Value], depth: int) -> bool:
        if name not in self._programs:
            raise alarm("name", name)
        if depth >= DEEPEST:
            raise alarm("nesting", name)
        given = {key: self._value(value, local) for key, value in re.findall(r"([A-Z][A-Z0-9]*)\s*=\s*([^ ]+)", arguments)}
        for key in given:
            if not LOCAL.fullmatch(key):
                raise alarm("variable", key)
        return self._execute(self._programs[name], given, depth + 1)

    def _value(self, text: str, local: Mapping[str, Value]) -> Value:
        return Reader(text, GRAMMAR, lambda name, index: self._get(name, index, local)).whole()

    def _get(self, name: str, index: float | None, local: Mapping[str, Value]) -> Value:
        if index is None:
            if name == "EMPTY":
                return None
            if match := re.fullmatch(r"VC(\d{1,3})", name):
                return self._common.get(self._common_name(match[1]))
            if name in ("VRSTT", "VACOD", "VMLOK"):
                state = {"VRSTT": 128.0 * self._profile.restart, "VACOD": 0.0 if self._axes.machine else 1.0}
                return state.get(name, 0.0)
            if (axis := name[4:]) in self._profile.axes and name[:4] in ("VAPA", *(() if self._profile.indexed else ("VSAP",))):
                return self._axes.known(axis) if name.startswith("VAPA") else self._contact[axis]
            if LOCAL.fullmatch(name):
                return local.get(name)
        elif (axis := name[4:]) in self._profile.axes and name[:4] == "VSAP" and index == 1 and self._profile.indexed:
            return self._contact[axis]
        elif name == "VDIN" and index == PROBE:
            return float(self._motion.deflected)
        elif name == "VDIN" and index in TIMERS:
            return RUNNING
        elif (axis := name[4:]) in self._profile.axes and name[:4] == "VZOF" and index == 1:
            return self._profile.g54.get(axis, 0.0)
        raise alarm("variable", name if index is None else f"{name}[{index:g}]")

    def _common_name(self, number: str) -> str:
        if not 1 <= int(number) <= COMMON:
            raise alarm("variable", f"VC{number}")
        return f"VC{int(number)}"

    def _statement(self, text: str, local: dict[str, Value]) -> bool:
        """→ whether the program is over."""
        if match := re.fullmatch(r"VUACM\[\d+\]\s*=\s*'(.*)'", text):
            if len(match[1]) > SHOWN:
                raise alarm("text", match[1])
            self._message = match[1]
        elif match := re.fullmatch(r"VDOUT\[(\d+)\]\s*=\s*(.+)", text):
            value = held(self._value(match[2], local), text)
            if 990 <= int(match[1]) <= 993 and value:
                raise Alarm(f"VDOUT {match[1]} {value:g}", self._message)
        elif match := re.fullmatch(r"([A-Z][A-Z0-9]*)\s*=(?!=)(.+)", text):
            self._assign(match[1], self._value(match[2], local), local)
        elif re.match(r"(FWRITC|PUT|WRITE|CLOSE)\b", text):
            self._print(text, local)
        else:
            return self._nc(COMPUTED.sub(lambda word: f"{word[1]}{held(self._value(word[2], local), text):.6f}", text))
        return False

    def _assign(self, name: str, value: Value, local: dict[str, Value]) -> None:
        if match := re.fullmatch(r"VC(\d{1,3})", name):
            self._common[self._common_name(match[1])] = value
        elif LOCAL.fullmatch(name):
            local[name] = value
        else:
            raise alarm("variable", name)

    def _print(self, text: str, local: Mapping[str, Value]) -> None:
        if match := re.fullmatch(r"FWRITC\s+([A-Z]{2}\d:[A-Z0-9.-]{1,20});A", text):
            self._file, self._line = match[1], ""
            self.files.setdefault(self._file, "")
            return
        if not self._file:
            raise alarm("file", f"{text} before FWRITC")
        if text == "CLOSE C":
            self._file = ""
        elif text == "WRITE C":
            self._note("output", text=self._line)
            self.files[self._file] += self._line + "\r\n"
            self._punch(self._line.encode("ascii") + b"\r\n")
            self._line = ""
        elif match := re.fullmatch(r"PUT\s*'([^']*)'", text):
            self._line += match[1]
        elif match := re.fullmatch(r"PUT\s*,(\d+)", text):
            self._line += " " * int(match[1])
        elif match := re.fullmatch(r"PUT\s*([^,']+)(?:,(\d+))?", text):
            self._line += self._printed(held(self._value(match[1], local), text), int(match[2] or 8))
        else:
            raise alarm("syntax", text)

    def _printed(self, value: float, places: int) -> str:
        """As many decimals as there is room for; what is still too long loses its first digits without a word."""
        room = places - len(f"{value:.0f}") - 1
        digits = f"{value:.{min(int(self._profile.decimals), room)}f}" if room > 0 else f"{value:.0f}"
        return digits.rjust(places)[-places:]

    def _nc(self, text: str) -> bool:
        words, at = [], 0
        while text[at:].strip():
            match = WORD.match(text, at)
            if match is None or match["number"] is None:
                raise alarm("syntax", text)
            words.append((match["letters"], match["number"]))
            at = match.end()
        g_codes = [self._g_code(value, text) for letter, value in words if letter == "G"]
        m_codes = [int(value) for letter, value in words if letter == "M"]
        rest = {letter: value for letter, value in words if letter not in "GM"}
        if 4 in g_codes:
            self._motion.dwell(float(rest.get("F", rest.get("P", "0"))))
            self._axes.settle()
            return False
        before = self._axes.machine
        self._frames(g_codes, rest, text)
        if 19 in m_codes:
            if (angle := rest.pop(self._profile.orient, None)) is not None:
                self._motion.rapid({"S": radians(float(angle) % 360)})
            rest.pop("RS", None)
        if "F" in rest:
            self._feed = float(rest.pop("F"))
        self._move(g_codes, {letter: self._number(value) for letter, value in rest.items()}, text)
        self._axes.machine = before if 16 in g_codes else self._axes.machine
        for code in m_codes:
            self._note("m", code=code)
        if any(code in WAITS for code in m_codes) and self._profile.wait:
            self._axes.settle()
        if 0 in m_codes or 1 in m_codes:
            self._note("stop", why="M00", message=self._remark)
        return 2 in m_codes or 30 in m_codes

    def _g_code(self, value: str, text: str) -> int:
        if not value.isdigit() or int(value) not in {*G_CODES, int(self._profile.skip_word[1:])}:
            raise alarm("g-code", text)
        return int(value)

    def _frames(self, g_codes: list[int], rest: dict[str, str], text: str) -> None:
        """G15 H modal, G16 H for one block; G56 H length, G53 none; G20 and G21 only look at the unit that is set."""
        if 20 in g_codes:
            raise alarm("unit", text)
        if 15 in g_codes or 16 in g_codes or 56 in g_codes:
            number = int(float(rest.pop("H", "-1")))
            if 56 in g_codes:
                if number not in self._profile.tool_lengths:
                    raise alarm("offset", text)
                self._axes.length = self._profile.tool_lengths[number]
            elif number in (0, 1):
                self._axes.machine = number == 0
            else:
                raise alarm("offset", text)
        if 53 in g_codes:
            self._axes.length = 0.0
        for code in g_codes:
            if code in (90, 91):
                self._axes.incremental = code == 91
            elif code in (0, 1):
                self._motion_code = code

    def _number(self, text: str) -> float:
        return float(text) / (1000.0 if "." not in text and self._profile.whole == "um" else 1.0)

    def _move(self, g_codes: list[int], targets: dict[str, float], text: str) -> None:
        for letter in targets:
            if letter not in self._profile.axes:
                raise alarm("word", f"{letter} in {text}")
        if not targets:
            return
        targets = {letter: value * self._profile.scaled.get(letter, 1.0) for letter, value in targets.items()}
        if (31 in g_codes or int(self._profile.skip_word[1:]) in g_codes or self._motion_code == 1) and self._feed <= 0:
            raise alarm("feed", text)
        if int(self._profile.skip_word[1:]) in g_codes:
            self._skip(targets)
        elif 31 in g_codes:
            self._axes.move(targets, self._feed)
        else:
            self._axes.move(targets, self._feed if self._motion_code == 1 else None)

    def _skip(self, targets: dict[str, float]) -> None:
        """G31: VSAP is where the contact was; without one nothing tells."""
        if self._motion.deflected and self._profile.deflected != "ends":
            if self._profile.deflected == "alarm":
                raise alarm("probe")
            self._axes.move(targets, self._feed)
            return
        skip = self._axes.skip(targets, self._feed)
        if not skip.hit:
            if self._profile.miss == "alarm":
                raise alarm("probe", "no contact")
            if self._profile.miss == "keep":
                return
        places = self._axes.skipped
        if not skip.hit:
            self._axes.settle()
            places = {name: self._axes.known(name) for name in self._profile.axes}
        work = self._profile.contact_frame == "work"
        self._contact = {name: value - (self._axes.shift(name, False) if work else 0.0) for name, value in places.items()}
