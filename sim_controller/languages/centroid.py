"""A Centroid control (CNC11, CNC12): M115 searches, M125 is guarded, M223 writes into a file, variables are those of its macros.

Facts: M-Series operator's manual (M115 to M126, M120 to M122, M223, M225, G53, variables), cncsnw.com on macros, the macros that
Centroid ships. Its habits: M115 without L1 and M125 cancel the job; positions follow G90 and G91; #5021 and #5041 are read before
the moves in front of them are done unless something waits (a read input, M115, M125); positions are shown in the units of the
machine, which need not be those of the program; M2 sends Z home; a program ends with its last line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from tango_cnc.records import Array, Machine

from ..motion import Motion, MotionStop, Note
from ._shared.alarm import Alarm, Silence
from ._shared.known import ORIENT, Controls, Shown
from ._shared.scales import commanded, shown
from .rs274.expressions import POWERS, PRODUCTS, SUMS, Key, Levels, Operator, Reader

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]

RELATIONS: Mapping[str, Operator] = {
    "==": lambda a, b: float(a == b),
    "!=": lambda a, b: float(a != b),
    "<=": lambda a, b: float(a <= b),
    ">=": lambda a, b: float(a >= b),
    "<": lambda a, b: float(a < b),
    ">": lambda a, b: float(a > b),
}
LOGIC: Mapping[str, Operator] = {"||": lambda a, b: float(bool(a or b)), "&&": lambda a, b: float(bool(a and b))}
LEVELS: Levels = (LOGIC, RELATIONS, SUMS, {**PRODUCTS, "%": lambda a, b: math.fmod(a, b)}, {**POWERS, "^": lambda a, b: a**b})
G_CODES = (0, 1, 4, 17, 20, 21, 40, 43, 49, 50, 53, 54, 61, 64, 69, 80, 90, 91, 94, 98)
WRITABLE = (range(1, 200), range(29000, 32000), range(33000, 35000))
INCH = 25.4
FORMAT = re.compile(r"%(?:\.(\d+))?f")


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control."""

    axes: tuple[str, ...]  # axis 1, 2, 3 …
    numbered: str = ""  # their letters instead, whether the machine has the axis or not; - where no axis has that number
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg
    probe: Mapping[str, float] = field(default_factory=lambda: {"P": 15.0})  # machine parameter 11, with its sign
    scaled: Mapping[str, float] = field(default_factory=dict)  # of work coordinates; -1 is a mirror image (G51)
    inches: bool = False  # the machine's own units, in which positions are read
    read_ahead: bool = True
    orient: str = "R"  # letter of the angle behind M19; behind another one the spindle stays as it is
    macros: tuple[str, ...] = ("M19",)  # M codes that the builder has made macros for
    sticks: bool = False  # #25022 says contact behind a probing move that met nothing, too
    old_contact: bool = False  # #24301 … are not written: those of the touch before remain


CONTROLS = Controls(
    shown_by={
        "axis_numbers": Shown(("numbered",), "the list of system variables: which axis #5021, #5041 and #24301 are, which #5022 …"),
        "orient": ORIENT,
    }
)


def default_profile(machine: Machine) -> Profile:
    """machine → profile with X Y Z and then the rotary letters in alphabetical order."""
    return Profile((*machine.linear, *machine.rotary))


class Control:
    """The control from switching on to switching off; what M223 writes goes to `punch`."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._variables: dict[int, float] = {}
        self._contact = self._place()
        self._tripped = 0.0
        self._known = self._place()

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of a file → executed to the last. Raises Alarm where the job is cancelled, Silence when its power fails."""
        whole = [line.rstrip() for line in lines]
        labels: dict[int, int] = {}
        for i, line in enumerate(whole):
            if match := re.match(r"\s*[nN]\[?(\d+)\]?", line):
                labels.setdefault(int(match[1]), i)
        self._open, self._inch, self._relative, self._motion_code, self._feed = False, False, False, 0, 0.0
        self._variables = {}
        index = 0
        try:
            while index < len(whole):
                self._note("block", program="", line=index + 1, text=whole[index])
                self._motion.reads(whole[index])
                jump = self._line(whole[index])
                if jump is not None and jump not in labels:
                    raise Alarm("CANCEL", f"N{jump} not found", whole[index])
                index = index + 1 if jump is None else labels[jump]
        except MotionStop as stop:
            raise _as_alarm(stop) from None

    def _line(self, raw: str) -> int | None:
        """One line → the label to go on at, None for the next line."""
        texts: list[str] = []

        def kept(match: re.Match[str]) -> str:
            texts.append(match[1])
            return f"~{len(texts) - 1}~"

        held = re.sub(r'"([^"]*)"', kept, raw)
        if '"' in held:
            raise Alarm("CANCEL", "a string is not closed", raw)
        code = re.sub(r"\s", "", held.partition(";")[0]).lower()
        code = re.sub(r"^n\[?\d+\]?", "", code)
        return self._statement(code, texts, raw) if code else None

    def _statement(self, code: str, texts: list[str], raw: str) -> int | None:
        if code.startswith("if"):
            return self._if(code, texts, raw)
        if match := re.fullmatch(r"goto(\d+)", code):
            return int(match[1])
        if code.startswith("#"):
            self._assign(code, raw)
        else:
            self._words(code, texts, raw)
        return None

    def _if(self, code: str, texts: list[str], raw: str) -> int | None:
        self._known = self._place() if re.fullmatch(r"if#50\d{3}", code) else self._known
        reader = self._reader(code, 2)
        truth = reader.whole() != 0
        if reader.done:
            return None
        if not reader.take("then"):
            raise Alarm("CANCEL", "THEN expected", raw)
        yes, _, no = code[reader.at :].partition("else")
        chosen = yes if truth else no
        return self._statement(chosen, texts, raw) if chosen else None

    def _assign(self, code: str, raw: str) -> None:
        reader = self._reader(code)
        key = reader.key()
        if not reader.take("="):
            raise Alarm("CANCEL", "= expected", raw)
        value = reader.whole()
        if not reader.done or not isinstance(key, int) or not any(key in part for part in WRITABLE):
            raise Alarm("CANCEL", "no assignment to a variable that can be written", raw)
        self._variables[key] = value

    def _words(self, code: str, texts: list[str], raw: str) -> None:
        if match := re.match(r"m(120|121|223|225|115|116|125|126)(?!\d)", code):
            number, rest = int(match[1]), code[match.end() :]
            if number in (120, 121):
                self._open = True
                self._note("open", file=texts[0])
            elif number == 223:
                self._write(texts[0], self._values(rest, raw), raw)
            elif number == 225:
                self._known = self._place()
                self._show(rest, texts[0], raw)
            else:
                self._search(rest, number in (115, 116), raw)
            return
        if match := re.fullmatch(r"m(94|95) ?/(\d{1,3})", code.strip()):
            self._note("m", code=int(match[1]), output=int(match[2]))
            return
        reader, words = self._reader(code), []
        while not reader.done:
            letter = code[reader.at]
            if not letter.isalpha():
                raise Alarm("CANCEL", "invalid character", raw)
            reader.at += 1
            words.append((letter.upper(), reader.value()))
        self._block(words, raw)

    def _show(self, rest: str, form: str, raw: str) -> None:
        """M225: a text on the screen, for the seconds of its variable; of 0, until somebody presses cycle start."""
        held, _, values = rest.rpartition("~0~")
        message, seconds = self._filled(form, self._values(values, raw)), self._values(held, raw)[0]
        if seconds <= 0:
            self._note("stop", why="M225", message=message)
        else:
            self._note("message", text=message)
            self._motion.dwell(seconds)

    def _values(self, text: str, raw: str) -> list[float]:
        reader, found = self._reader(text.replace("~0~", "")), []
        while not reader.done:
            found.append(reader.value())
        return found

    def _write(self, form: str, values: list[float], raw: str) -> None:
        if not self._open:
            raise Alarm("CANCEL", "no data file is open", raw)
        text = self._filled(form, values)
        self._note("output", text=text.rstrip("\n"))
        self._punch(text.encode("ascii"))

    def _filled(self, form: str, values: list[float]) -> str:
        if len(FORMAT.findall(form)) != len(values):
            raise Alarm("CANCEL", "as many values as formats expected", form)
        left = iter(values)
        return FORMAT.sub(lambda m: f"{next(left):.{m[1] or 6}f}", form).replace("\\n", "\n")

    def _search(self, text: str, wanted: bool, raw: str) -> None:
        """M115 and M125: to a position until the input of the probe changes."""
        reader = self._reader(text)
        axes: dict[str, float] = {}
        others: dict[str, float] = {}
        while not reader.done:
            slash = reader.take("/")
            letter = text[reader.at].upper()
            reader.at += 1
            (axes if slash else others)[letter] = reader.value()
        if "P" not in others or others["P"] != self._profile.probe["P"]:
            raise Alarm("CANCEL", "Missing or invalid P value", raw)
        feed = others.get("F", self._feed) * (INCH if self._inch else 1.0)
        if feed <= 0 or not axes or any(name not in self._profile.axes for name in axes):
            raise Alarm("CANCEL", "no feed, or no axis that there is", raw)
        skip = self._motion.skip(self._target(axes), feed)
        self._tripped = float(skip.hit)
        if skip.hit and not self._profile.old_contact:
            self._contact = self._place(skip.position)
        self._known = self._place()
        if skip.hit != wanted and not others.get("L"):
            raise Alarm("CANCEL", "probe did not detect the surface" if wanted else "unexpected probe contact", raw)

    def _block(self, words: list[tuple[str, float]], raw: str) -> None:
        codes = [int(value) for letter, value in words if letter == "G"]
        m_codes = [int(value) for letter, value in words if letter == "M"]
        values = {letter: value for letter, value in words if letter not in "GM"}
        for code in codes:
            if code not in G_CODES:
                raise Alarm("CANCEL", "invalid G code", raw)
        self._inch = (self._inch or 20 in codes) and 21 not in codes
        self._relative = (self._relative or 91 in codes) and 90 not in codes
        self._motion_code = next((code for code in codes if code in (0, 1)), self._motion_code)
        self._feed = values.get("F", self._feed)
        for code in m_codes:
            self._m(code, values, raw)
        axes = {name: value for name, value in values.items() if name in "XYZABC"}
        if any(name not in self._profile.axes for name in axes):
            raise Alarm("CANCEL", "invalid axis", raw)
        if 4 in codes:
            self._motion.dwell(values.get("P", 0.0))
        elif 53 in codes:
            if self._relative:
                raise Alarm("CANCEL", "G53 may only be used with G90", raw)
            self._motion.rapid(commanded(self._motion, {name: value * self._unit(name) for name, value in axes.items()}))
        elif axes and self._motion_code == 0:
            self._motion.rapid(self._target(axes))
        elif axes:
            feed = self._feed * (INCH if self._inch else 1.0)
            if feed <= 0:
                raise Alarm("CANCEL", "feedrate is zero", raw)
            self._motion.feed(self._target(axes), feed)
        if not self._profile.read_ahead:
            self._known = self._place()

    def _m(self, code: int, values: Mapping[str, float], raw: str) -> None:
        if code in (2, 30):
            raise Alarm("M2", "Z goes home and the program starts again", raw)
        if code == 19 and "M19" in self._profile.macros:
            if self._profile.orient in values:
                self._motion.rapid({"S": math.radians(values[self._profile.orient] % 360)})
        elif f"M{code}" not in self._profile.macros and code > 10:
            raise Alarm("CANCEL", f"M{code} is not defined", raw)
        self._note("m", code=code)

    def _reader(self, text: str, at: int = 0) -> Reader:
        reader = Reader(text, self._get, LEVELS)
        reader.at = at
        return reader

    def _get(self, key: Key) -> float:
        if not isinstance(key, int):
            raise Alarm("CANCEL", f"#<{key}> is no variable")
        for base, place in ((5020, self._known), (5040, self._known), (24300, self._contact)):
            if base < key <= base + len(letters := self._profile.numbered or self._profile.axes):
                if (name := letters[key - base - 1]) not in place:
                    return 0.0
                offset = self._profile.g54.get(name, 0.0) if base == 5040 else 0.0
                return (place[name] - offset) / (INCH if self._profile.inches and name in "XYZ" else 1.0)
        if 50001 <= key <= 51312:
            wired = self._profile.probe["P"]
            if key - 50000 == abs(int(wired)) % 50000:
                return float(self._motion.deflected == (wired > 0))
            return 0.0
        fixed = {
            9011: self._profile.probe["P"],
            25022: 1.0 if self._profile.sticks else self._tripped,
            4006: 20.0 if self._inch else 21.0,
        }
        return fixed[key] if key in fixed else self._variables.get(key, 0.0)

    def _target(self, axes: Mapping[str, float]) -> dict[str, float]:
        here = self._place()
        goal = {}
        for name, value in axes.items():
            base = here[name] if self._relative else self._profile.g54.get(name, 0.0)
            goal[name] = base + value * self._unit(name) * self._profile.scaled.get(name, 1.0)
        return commanded(self._motion, goal)

    def _unit(self, name: str) -> float:
        return INCH if self._inch and name in "XYZ" else 1.0

    def _place(self, position: Array | None = None) -> dict[str, float]:
        return shown(self._motion, self._profile.axes, position)


def _as_alarm(stop: MotionStop) -> Exception:
    if stop.cause == "overtravel":
        return Alarm("CANCEL", f"{stop.axis} travel exceeded", str(stop))
    return Silence() if str(stop) == "silence" else Alarm("STOP", str(stop))
