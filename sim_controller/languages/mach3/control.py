"""Mach3: RS-274/NGC of NIST without conditions, M codes of one's own in Basic, run here.

Facts: Using Mach3Mill (G31, #2000 to #2005 in work coordinates), public macros (GetVar(2002), GetOEMDRO(83 … 88) machine and (800 …
805) work positions, GetOEMLED(825) probe, IsMoving). Its habits: G31 that meets nothing stores where it ended and says nothing; an
M code without a macro is skipped in silence; Code only queues, so that whoever does not wait for IsMoving reads what was before;
after a stop some lines that were read ahead are still carried out. `library` is the macros folder: file name, then its text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from tango_cnc.records import Machine

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Alarm, Silence
from .._shared.known import ORIENT, Controls
from ..rs274.axes import INCH, Frames
from ..rs274.expressions import NIST, Key, Reader
from ..rs274.program import line as read_line
from .basic import LIBRARY, Host, Script

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]

G_CODES = (0, 1, 4, 15, 17, 20, 21, 31, 40, 43, 49, 50, 53, 54, 61, 64, 69, 80, 90, 91, 94)
BUILT_IN = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30, 47, 48, 49)
LETTERS = "XYZABC"
STOP = 1003  # OEM button
PROBE = 825  # OEM LED


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control."""

    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # H → mm
    scaled: Mapping[str, float] = field(default_factory=dict)  # of work coordinates; -1 is a mirror image (G51, a scale DRO)
    inches: bool = False  # native units, in which machine positions are shown
    ahead: Mapping[str, float] = field(default_factory=lambda: {"N": 3.0})  # lines carried out after a stop
    shortest: float = 0.254  # mm, of a G31: RS274/NGC's hundredth of an inch, which Mach3 is remembered to have inherited
    orient: str = "R"  # letter of the angle behind M19; behind another one the spindle stays as it is
    rounded: float = 0.0  # mm that the DROs come in whole steps of; 0: as they are
    comma: bool = False  # a Windows whose region has a decimal comma: Format writes it
    one_axis: bool = False  # a motion board whose G31 moves the first axis only


CONTROLS = Controls(shown_by={"orient": ORIENT}, beside=re.compile(r"m\d+\.m1s"))


def default_profile(machine: Machine) -> Profile:
    """machine → profile without offsets."""
    return Profile()


class Control:
    """The control from switching on to switching off; what macros write into a file goes to `punch`."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._frames = Frames(motion, profile.g54, 0.0, profile.tool_lengths)
        self._frames.scaled = profile.scaled
        self._macros = _files(library)
        self._numbers: dict[int, float] = {}
        self._hit = dict.fromkeys(LETTERS, 0.0)
        self._queue: list[str] = []
        self._shown = self._places()
        self._params = (0.0, 0.0, 0.0)
        self._feed, self._motion_code = 0.0, 0.0
        self._files: dict[int, tuple[str, list[str]]] = {}
        self._program: list[str] = []
        self._halt: int | None = None
        self._message = ""

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of a file → executed to M2, M30 or the last. Raises Alarm where it stops, Silence when its power fails."""
        self._program = [text for text in (raw.rstrip() for raw in lines) if text.strip() != "%"]
        self._halt, self._message = None, ""
        try:
            for number, raw in enumerate(self._program, 1):
                self._note("block", program="", line=number, text=raw)
                self._motion.reads(raw)
                if self._line(raw):
                    break
                if self._halt is not None:
                    self._halt -= 1
                    if self._halt < 0:
                        break
        except MotionStop as stop:
            raise _as_alarm(stop) from None
        if self._halt is not None:
            raise Alarm("STOP", self._message)

    def _line(self, raw: str) -> bool:
        """A line of the program, or of Code; → whether it ended the program."""
        item = read_line(raw)
        if item.word:
            raise Alarm("MACH3", "Unknown word starting with O", raw)
        reader = Reader(item.text, self._get, NIST)
        words: list[tuple[str, float]] = []
        settings: list[tuple[Key, float]] = []
        while not reader.done:
            if item.text.startswith("#", reader.at):
                key = reader.key()
                if not reader.take("="):
                    raise reader.wrong("=")
                settings.append((key, reader.value()))
            else:
                letter = item.text[reader.at]
                if not letter.isalpha():
                    raise Alarm("MACH3", f"Bad character {letter}", raw)
                reader.at += 1
                words.append((letter.upper(), reader.value()))
        for number, value in settings:
            if not isinstance(number, int) or not 1 <= number <= 4999:
                raise Alarm("MACH3", "Parameter number out of range", raw)
            self._numbers[number] = value
        return self._words(words, raw)

    def _words(self, words: list[tuple[str, float]], raw: str) -> bool:
        codes = [round(value, 1) for letter, value in words if letter == "G"]
        m_codes = [int(value) for letter, value in words if letter == "M"]
        values = {letter: value for letter, value in words if letter not in "GM"}
        if any(code not in G_CODES for code in codes):
            raise Alarm("MACH3", "Unknown G code used", raw)
        frames = self._frames
        frames.inch = (frames.inch or 20 in codes) and 21 not in codes
        frames.relative = (frames.relative or 91 in codes) and 90 not in codes
        self._feed = values.get("F", self._feed)
        if 43 in codes or 49 in codes:
            frames.select_length(int(values.get("H", 0)) if 43 in codes else 0)
        self._motion_code = next((code for code in codes if code in (0, 1)), self._motion_code)
        self._move(codes, values, raw)
        for code in m_codes:
            self._m(code, values)
        return any(code in (2, 30) for code in m_codes)

    def _move(self, codes: list[float], values: Mapping[str, float], raw: str) -> None:
        axes = {name: value for name, value in values.items() if name in LETTERS}
        if any(name not in self._frames.axes for name in axes):
            raise Alarm("MACH3", "axis is not enabled", raw)
        if 4 in codes:
            self._motion.dwell(values.get("P", 0.0))
        if 4 in codes or not axes:
            return
        feed = self._feed * self._frames.unit("X")
        if 31 in codes:
            if feed <= 0:
                raise Alarm("MACH3", "Cannot probe with zero feed rate", raw)
            first = dict([next(iter(axes.items()))]) if self._profile.one_axis else axes
            goal, here = self._frames.target(axes), self._frames.machine()
            if math.dist([goal[n] for n in axes if n in "XYZ"], [here[n] for n in axes if n in "XYZ"]) < self._profile.shortest:
                raise Alarm("MACH3", "Start point and end point of probe move are too close", raw)
            skip = self._motion.skip(self._frames.target(first), feed)
            self._hit |= self._frames.probed(skip)
        elif 53 in codes:
            self._motion.rapid(self._frames.target(axes, True))
        elif self._motion_code == 0:
            self._motion.rapid(self._frames.target(axes))
        elif feed <= 0:
            raise Alarm("MACH3", "Cannot do G1 with zero feed rate", raw)
        else:
            self._motion.feed(self._frames.target(axes), feed)

    def _m(self, code: int, values: Mapping[str, float]) -> None:
        self._note("m", code=code)
        if f"m{code}.m1s" in self._macros:
            self._params = (values.get("P", 0.0), values.get("Q", 0.0), values.get("S", 0.0))
            self._shown = self._places()
            Script(self._macros[f"m{code}.m1s"], self._host()).run()
            self._moving()
        elif code == 19:
            if self._profile.orient in values:
                self._motion.rapid({"S": math.radians(values[self._profile.orient] % 360)})
        elif code not in BUILT_IN:
            self._note("lost", text=f"M{code}", why="no macro of this name")

    def _host(self) -> Host:
        return {
            **({"format": lambda value, form: LIBRARY["format"](value, form).replace(".", ",")} if self._profile.comma else {}),
            "getvar": lambda number: self._get(int(number)),
            "setvar": lambda number, value: self._numbers.__setitem__(int(number), float(value)),
            "getoemdro": self._dro,
            "getoemled": lambda number: float(number == PROBE and self._motion.deflected),
            "dooembutton": self._button,
            "code": self._queue.append,
            "ismoving": self._moving,
            "sleep": lambda ms: self._motion.dwell(ms / 1000),
            "message": self._say,
            "filename": lambda: "C:\\Mach3\\GCode\\tango.tap",
            "param1": lambda: self._params[0],
            "param2": lambda: self._params[1],
            "param3": lambda: self._params[2],
            "open": self._open,
            "print": self._print,
            "line input": lambda number: self._files[number][1].pop(0),
            "eof": lambda number: not self._files[int(number)][1],
            "close": lambda number: self._files.pop(number),
        }

    def _moving(self) -> bool:
        """Whether something moves; the next time it is asked for, it does not."""
        moving = bool(self._queue)
        while self._queue:
            self._line(self._queue.pop(0))
        self._shown = self._places()
        return moving

    def _dro(self, number: float) -> float:
        index = int(number)
        for base, which in ((83, 0), (800, 1)):
            if base <= index < base + 6:
                name = LETTERS[index - base]
                unit = INCH if self._profile.inches and name in "XYZ" else 1.0
                value, step = self._shown[which].get(name, 0.0), self._profile.rounded
                return (round(value / step) * step if step else value) / unit
        raise Alarm("MACH3", f"OEM DRO {index} is not simulated")

    def _places(self) -> tuple[dict[str, float], dict[str, float]]:
        """→ machine and work positions, mm and deg."""
        work = self._frames.work()
        return self._frames.machine(), {name: value * self._frames.unit(name) for name, value in work.items()}

    def _button(self, number: float) -> None:
        if int(number) != STOP:
            raise Alarm("MACH3", f"OEM button {int(number)} is not simulated")
        self._queue.clear()
        self._halt = int(self._profile.ahead["N"])

    def _say(self, text: str) -> None:
        self._message = self._message or text
        self._note("stop", why="Message", message=text)

    def _open(self, name: str, how: str, number: int) -> None:
        if how == "input" and not name.lower().endswith(".tap"):
            raise Alarm("BASIC", f"file not found: {name}")
        self._files[number] = (how, list(self._program) if how == "input" else [])
        self._note("open", file=name)

    def _print(self, number: int, text: str) -> None:
        if self._files.get(number, ("", []))[0] != "append":
            raise Alarm("BASIC", "bad file number")
        self._note("output", text=text)
        self._punch(f"{text}\r\n".encode("ascii"))

    def _get(self, key: Key) -> float:
        if not isinstance(key, int):
            raise Alarm("MACH3", f"#<{key}> is no parameter")
        if 2000 <= key <= 2005:
            return self._hit[LETTERS[key - 2000]]
        return self._numbers.get(key, 0.0)


def _files(library: Iterable[str]) -> dict[str, str]:
    """lines, names of files on lines of their own → {name: text}."""
    found: dict[str, list[str]] = {}
    current: list[str] = []
    for text in library:
        if re.fullmatch(r"m\d+\.m1s", text.strip()):
            current = found.setdefault(text.strip(), [])
        else:
            current.append(text)
    return {name: "\n".join(lines) for name, lines in found.items()}


def _as_alarm(stop: MotionStop) -> Any:
    if stop.cause == "overtravel":
        return Alarm("MACH3", f"{stop.axis} soft limit", str(stop))
    return Silence() if str(stop) == "silence" else Alarm("MACH3", str(stop))
