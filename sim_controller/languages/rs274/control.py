"""An RS-274/NGC control as LinuxCNC is one: O-words, named parameters, G38, active comments that write files and stop.

Facts: NIST RS274/NGC version 3, LinuxCNC's g-code.adoc, o-code.adoc and overview.adoc. Its habits: G38.3 that meets nothing says
so in #5070 only; a probe that is on before a search is an error; a contact in any other move ends the program; G94 in a block
clears the feed; G53 goes with G0 and G1 only; angles are taken as they are. G38.4 and G38.5, away from contact, are not simulated.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from tango_cnc.records import Machine

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Alarm, Silence
from .._shared.known import Controls
from .axes import Frames
from .expressions import LINUXCNC, Key, Reader
from .program import Line, Program

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]

GROUPS: Mapping[str, tuple[float, ...]] = {
    "motion": (0, 1, 38.2, 38.3, 80),
    "plane": (17, 18, 19),
    "distance": (90, 91),
    "feed": (93, 94),
    "units": (20, 21),
    "radius": (40,),
    "length": (43, 49),
    "frame": (54,),
    "path": (61, 61.1, 64),
}
ONCE = (4, 53, 92, 92.1, 92.2)
M_CODES = (0, 1, 2, 5, 9, 19, 30, 60, 62, 63, 64, 65, 66)
LOCAL = range(1, 31)
DEEPEST = 10
TRUTHS = ("_task", "_absolute", "_metric")
FORMAT = re.compile(r"%(d|f|\.(\d)f)|(#(?:<[^<>]+>|\d+))")


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control."""

    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg
    g92: Mapping[str, float] = field(default_factory=dict)  # mm and deg
    rotation: Mapping[str, float] = field(default_factory=dict)  # R: deg, of G54 about its origin
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # H → mm
    hal: bool = True  # HAL_PIN_VARS: a program may read pins as #<_hal[…]>
    preview: bool = False  # nothing moves: #<_task> is 0, as for the interpreter that draws the path


CONTROLS = Controls()


def default_profile(machine: Machine) -> Profile:
    """machine → profile without offsets."""
    return Profile()


class Control:
    """The control from switching on to switching off; what it writes into a file goes to `punch`, one line each."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._frames = Frames(motion, profile.g54, profile.rotation.get("R", 0.0), profile.tool_lengths)
        self._frames.g92 |= profile.g92
        self._stored = Program(library)
        self._numbers: dict[int, float] = {}
        self._names: dict[str, float] = {}
        self._local: list[dict[Key, float]] = [{}]
        self._hit = 0.0
        self._probed: dict[str, float] = dict.fromkeys(self._frames.axes, 0.0)
        self._modal: dict[str, float] = {"motion": 80, "distance": 90, "units": 21, "feed": 94}
        self._feed = 0.0
        self._open = False

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of a file → executed to M2, M30 or their end. Raises Alarm where the control would stop, Silence without power."""
        self._local, self._open = [{}], False
        self._numbers, self._names = {}, {}
        program = Program(lines)
        try:
            self._walk(program, 0, 0)
        except MotionStop as stop:
            raise _as_alarm(stop) from None

    def _walk(self, program: Program, index: int, depth: int) -> bool:
        """From a line to the end of a program or subroutine; → whether M2 or M30 ended everything."""
        while index < len(program.lines):
            item = program.lines[index]
            self._note("block", program="", line=index + 1, text=item.raw)
            self._motion.reads(item.raw)
            if item.word:
                following = self._o_word(program, index, item, depth)
                if following is None:
                    return False
                if following < 0:
                    return True
                index = following
                continue
            if self._block(item):
                return True
            index += 1
        return False

    def _o_word(self, program: Program, index: int, item: Line, depth: int) -> int | None:
        """→ index to go on at, None at the end of a subroutine, −1 when everything has ended."""
        word = item.word
        if word == "sub":
            return program.partner(index, ("endsub",)) + 1
        if word in ("endsub", "return"):
            return None
        if word == "call":
            return -1 if self._call(program, item, depth) else index + 1
        if word in ("if", "while"):
            return self._branch(program, index, item)
        if word in ("elseif", "else"):  # reached from above: the branch before it was taken
            return program.partner(index, ("endif",)) + 1
        if word == "endwhile":
            return program.opener(index, ("while",))
        if word == "endif":
            return index + 1
        raise Alarm("RS274", f"O word {word} is not simulated", item.raw)

    def _branch(self, program: Program, index: int, item: Line) -> int:
        if item.word == "while":
            return index + 1 if self._true(item) else program.partner(index, ("endwhile",)) + 1
        while not (item.word == "else" or (item.word in ("if", "elseif") and self._true(item))):
            index = program.partner(index, ("elseif", "else", "endif"))
            item = program.lines[index]
            if item.word == "endif":
                break
        return index + 1

    def _true(self, item: Line) -> bool:
        reader = self._reader(item.text)
        truth = reader.bracket() != 0
        if not reader.done:
            raise reader.wrong("the end of the line")
        return truth

    def _call(self, program: Program, item: Line, depth: int) -> bool:
        held = program if item.label in program.subs else self._stored
        if item.label not in held.subs:
            raise Alarm("RS274", "Unable to open file of subroutine", item.raw)
        if depth >= DEEPEST:
            raise Alarm("RS274", "Too many nested subroutine calls", item.raw)
        reader, values = self._reader(item.text), []
        while not reader.done:
            values.append(reader.bracket())
        self._local.append({i: values[i - 1] if i <= len(values) else 0.0 for i in LOCAL})
        ended = self._walk(held, held.subs[item.label] + 1, depth + 1)
        self._local.pop()
        return ended

    def _block(self, item: Line) -> bool:
        """A line of words, assignments and a comment; → whether it ended the program."""
        reader = self._reader(item.text)
        words: list[tuple[str, float]] = []
        settings: list[tuple[Key, float]] = []
        while not reader.done:
            if reader.text.startswith("#", reader.at):
                key = reader.key()
                if not reader.take("="):
                    raise reader.wrong("=")
                settings.append((key, reader.value()))
            else:
                letter = reader.text[reader.at]
                if not letter.isalpha():
                    raise Alarm("RS274", f"Bad character '{letter}' used", item.raw)
                reader.at += 1
                words.append((letter.upper(), reader.value()))
        for key, value in settings:  # all of them after everything has been read
            self._set(key, value)
        if item.comment:
            self._comment(item.comment)
        return self._words(words, item)

    def _words(self, found: list[tuple[str, float]], item: Line) -> bool:
        codes = [round(value, 1) for letter, value in found if letter == "G"]
        m_codes = [value for letter, value in found if letter == "M"]
        values = {letter: value for letter, value in found if letter not in "GM"}
        if len(values) + len(codes) + len(m_codes) != len(found):
            raise Alarm("RS274", "Multiple words of one letter", item.raw)
        for code in codes:
            group = next((name for name, members in GROUPS.items() if code in members), None)
            if group is None and code not in ONCE:
                raise Alarm("RS274", "Unknown g code used", item.raw)
            if group and sum(other in GROUPS[group] for other in codes) > 1:
                raise Alarm("RS274", "Two g codes used from same modal group", item.raw)
            if group:
                self._modal[group] = code
        for code in m_codes:
            if code not in M_CODES:
                raise Alarm("RS274", "Unknown m code used", item.raw)
        if 94 in codes:
            self._feed = 0.0
        self._frames.inch, self._frames.relative = self._modal["units"] == 20, self._modal["distance"] == 91
        self._feed = values.get("F", self._feed)
        if 19 in m_codes:
            self._motion.rapid({"S": math.radians(values.get("R", 0.0) % 360)})
        self._frame(codes, values, item)
        self._move(codes, values, item)
        for code in m_codes:
            self._note("m", code=int(code))
        return any(code in (2, 30) for code in m_codes)

    def _frame(self, codes: list[float], values: Mapping[str, float], item: Line) -> None:
        """G43, G49, G92: what shifts the work frame."""
        length = int(values.get("H", 0)) if 43 in codes else 0
        if (43 in codes or 49 in codes) and not self._frames.select_length(length):
            raise Alarm("RS274", "Requested tool not found in the tool table", item.raw)
        if 92 in codes:
            here = self._frames.work()
            for name in self._frames.axes:
                if name in values:
                    self._frames.g92[name] += (here[name] - values[name]) * self._frames.unit(name)
        if 92.1 in codes or 92.2 in codes:
            self._frames.g92 = dict.fromkeys(self._frames.axes, 0.0)

    def _move(self, codes: list[float], values: Mapping[str, float], item: Line) -> None:
        axes = {name: value for name, value in values.items() if name in "XYZABCUVW"}
        strange = [name for name in axes if name not in self._frames.axes]
        if strange:
            raise Alarm("RS274", f"Cannot move axis {strange[0]}: it does not exist", item.raw)
        if 4 in codes:
            self._motion.dwell(values.get("P", 0.0))
            return
        motion = self._modal["motion"]
        probing = [code for code in codes if code in (38.2, 38.3)]
        if 53 in codes and (motion not in (0, 1) or self._frames.relative):
            raise Alarm("RS274", "Must use g0 or g1 with g53, in absolute distance mode", item.raw)
        if not axes or 92 in codes:
            if probing:
                raise Alarm("RS274", "X, Y, Z … missing with G38", item.raw)
            return
        if motion == 80:
            raise Alarm("RS274", "Cannot use axis values without a g code that uses them", item.raw)
        target = self._frames.target(axes, 53 in codes)
        feed = self._feed * self._frames.unit("X")
        if motion == 0:
            self._motion.rapid(target)
        elif feed <= 0:
            raise Alarm("RS274", "Cannot do G1 or G38 with zero feed rate", item.raw)
        elif motion == 1:
            self._motion.feed(target, feed)
        else:
            self._probe(target, feed, motion == 38.2, item)

    def _probe(self, target: Mapping[str, float], feed: float, must: bool, item: Line) -> None:
        if self._motion.deflected:
            raise Alarm("RS274", "Probe is already tripped when starting G38.2 or G38.3 move", item.raw)
        skip = self._motion.skip(target, feed)
        if skip.already:
            raise Alarm("RS274", "Probe is already tripped when starting G38.2 or G38.3 move", item.raw)
        self._hit, self._probed = float(skip.hit), self._frames.machine(skip.position)
        if must and not skip.hit:
            raise Alarm("RS274", "G38.2 move finished without making contact.", item.raw)

    def _comment(self, text: str) -> None:
        """An active comment, the last one of its line."""
        word, _, rest = text.strip().partition(",")
        word = word.strip().lower()
        if word == "abort":
            if not self._profile.preview:
                raise Alarm("ABORT", rest.strip())
        elif word in ("logopen", "logappend"):
            self._open = True
            self._note("open", file=rest.strip())
        elif word == "logclose":
            self._open = False
        elif word == "log":
            line = self._filled(rest)
            if not self._open:
                self._note("lost", text=line, why="LOG without LOGOPEN")
            else:
                self._note("output", text=line)
                self._punch(f"{line}\n".encode("ascii"))
        elif word in ("probeopen", "probeclose"):
            raise Alarm("RS274", f"({word.upper()}) is not simulated")
        else:
            self._note("message", text=self._filled(rest))

    def _filled(self, text: str) -> str:
        """text of LOG, PRINT, DEBUG → the same with its parameters in the formats that stand before them."""
        form = 6

        def value(match: re.Match[str]) -> str:
            nonlocal form
            if match[1]:
                form = 0 if match[1] == "d" else int(match[2]) if match[2] else 4
                return ""
            key = match[3][1:].strip("<>").lower()
            number = self._get(int(key) if key.isdigit() else key)
            return f"{number:.{form}f}"

        return FORMAT.sub(value, text)

    def _reader(self, text: str) -> Reader:
        return Reader(text, self._get, LINUXCNC)

    def _get(self, key: Key) -> float:
        if isinstance(key, str):
            return self._named(key)
        if key in LOCAL:
            return self._local[-1].get(key, 0.0)
        axes = dict(enumerate("XYZABC", 0))
        if 5061 <= key <= 5066:
            return self._frames.work(self._probed)[axes[key - 5061]] if axes[key - 5061] in self._probed else 0.0
        if 5221 <= key <= 5226:
            return self._frames.offset(axes[key - 5221]) if axes[key - 5221] in self._probed else 0.0
        if 5420 <= key <= 5425:
            return self._frames.work()[axes[key - 5420]] if axes[key - 5420] in self._probed else 0.0
        fixed = {5070: self._hit, 5220: 1.0, 5230: self._frames.rotation, 5210: float(any(self._frames.g92.values()))}
        return fixed.get(key, self._numbers.get(key, 0.0))

    def _named(self, name: str) -> float:
        place = re.fullmatch(r"_(abs_)?([xyzabc])", name)
        if place and place[2].upper() in self._frames.axes:
            letter = place[2].upper()
            return self._frames.machine()[letter] / self._frames.unit(letter) if place[1] else self._frames.work()[letter]
        if name in TRUTHS:
            return float(
                {"_task": not self._profile.preview, "_absolute": not self._frames.relative}.get(name, not self._frames.inch)
            )
        if name == "_feed":
            return self._feed
        if name == "_hal[motion.probe-input]" and self._profile.hal:
            return float(self._motion.deflected)
        store = self._names if name.startswith("_") else self._local[-1]
        if name not in store:
            raise Alarm("RS274", f"Named parameter #<{name}> not defined")
        return store[name]

    def _set(self, key: Key, value: float) -> None:
        if isinstance(key, str):
            if name_is_fixed(key):
                raise Alarm("RS274", f"Cannot assign to read-only parameter #<{key}>")
            store: dict[Key, float] = self._names if key.startswith("_") else self._local[-1]  # type: ignore[assignment]
            store[key] = value
        elif key in LOCAL:
            self._local[-1][key] = value
        elif 31 <= key <= 5000:
            self._numbers[key] = value
        else:
            raise Alarm("RS274", f"Cannot assign to read-only parameter #{key}")


def name_is_fixed(name: str) -> bool:
    """name of a parameter → whether only the control writes it."""
    return bool(re.fullmatch(r"_(abs_)?[xyzabcuvw]", name)) or name in (*TRUTHS, "_feed")


def _as_alarm(stop: MotionStop) -> Exception:
    if stop.cause == "overtravel":
        return Alarm("MOTION", f"Linear move on line would exceed joint {stop.axis}'s limit", str(stop))
    if stop.cause == "collision":
        return Alarm("MOTION", "Probe tripped during non-probe move.", str(stop))
    return Silence() if str(stop) == "silence" else Alarm("MACHINE", str(stop))
