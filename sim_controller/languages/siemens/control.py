"""A Sinumerik-like control (840D sl, ONE), with its habits: MEAS says nothing when it meets nothing and keeps what it latched
before, only axes named in the block are latched, variables are as old as the last STOPRE, SUPA leaves tool length and
transformation in, WRITE adds a line feed to files and none to devices, errors of files are numbers that nobody has to look at."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, MutableMapping

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Alarm
from .._shared.memory import stored
from .alarms import alarm, as_alarm
from .axes import Axes, Profile, Target, default_profile
from .expressions import Reader, Value, real, truth
from .program import Block, block_of, jumped_to, partners_of

__all__ = ["Control", "Profile", "default_profile"]

G_CODES = {f"G{n}" for n in (0, 1, 4, 17, 18, 19, 40, 53, 54, 500, 60, 601, 64, 71, 90, 91, 94, 710)}
WORDS = {"TRAFOOF", "TRANS", "ROT", "TOROTOF", "STOPRE"}
CALLS = {"MSG", "SETAL", "WRITE", "EXTOPEN", "EXTCLOSE", "CYCLE800"}
TYPES: dict[str, Value] = {"INT": 0, "REAL": 0.0, "BOOL": False, "STRING": ""}
PARAMETER = re.compile(r"R\d{1,3}")
TRAORI = 16  # code of a transformation of five axes
LONGEST = 200  # characters that WRITE takes


class Control:
    """The control's memory from switching on to switching off; `files` is what WRITE left in it."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._axes = Axes(motion, profile)
        self.files: dict[str, str] = {}
        self.parameters: MutableMapping[str, float] = {}  # R parameters and global user data, that others write and read too
        self._open: set[str] = set()
        self._variables: dict[str, Value] = {}
        self._types: dict[str, str] = {}
        self._motion_code, self._feed, self._message, self._executed = "G0", 0.0, "", False
        self._measuring = 1  # input of the probe that MEAS has looked at last

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of one program, which is stored before it is executed. Raises Alarm and Silence."""
        self._variables, self._types, self._executed = {}, {}, False
        self._motion_code, self._axes.incremental = "G1", False
        self._axes.settle()
        try:
            held = stored(lines, self._profile.memory, lambda where: alarm("6500", where))
            self._program([block_of(line) for line in held if not line.startswith("%")])
        except MotionStop as stop:
            raise as_alarm(stop) from None
        finally:
            self._open.clear()

    def _program(self, blocks: list[Block]) -> None:
        partners = partners_of(blocks)
        index = 0
        while index < len(blocks):
            block = blocks[index]
            self._note("block", program="MPF", line=index + 1, text=block.raw)
            self._motion.reads(block.raw)
            if re.match(r"M(30|0?2|17)\b", block.text):
                return
            jump = self._execute(blocks, partners, index, block) if block.text else None
            index = index + 1 if jump is None else jump
        raise alarm("14011")

    def _execute(self, blocks: list[Block], partners: dict[int, int], index: int, block: Block) -> int | None:
        """Executes one block; → index to go on at, None for the next one."""
        reader = Reader(block.text, self._get)
        if reader.take("DEF"):
            if self._executed:
                raise alarm("12190", block.raw)
            self._define(reader, block)
            return None
        self._executed = True
        if reader.take("IF"):
            yes = truth(reader.value())
            if jump := reader.take("GOTOF", "GOTOB", "GOTO"):
                label = reader.name()
                _done(reader, block)
                return jumped_to(blocks, index, jump, label) if yes else None
            _done(reader, block)
            return None if yes else partners[index] + 1
        if reader.take("ELSE"):
            return partners[index] + 1
        if reader.take("ENDIF"):
            return None
        if reader.take("WHILE"):
            yes = truth(reader.value())
            _done(reader, block)
            return None if yes else partners[index] + 1
        if reader.take("ENDWHILE"):
            return partners[index]
        if jump := reader.take("GOTOF", "GOTOB", "GOTO"):
            return jumped_to(blocks, index, jump, reader.name())
        self._statement(reader, block)
        return None

    def _define(self, reader: Reader, block: Block) -> None:
        kind = reader.take(*TYPES)
        if kind is None:
            raise alarm("12080", block.raw)
        if kind == "STRING":
            reader.expect("[")
            reader.value()
            reader.expect("]")
        while True:
            name = reader.name()
            if len(name) > 31:
                raise alarm("12420", name)
            if name in self._variables or name in self._profile.axes:
                raise alarm("12170", name)
            self._types[name], self._variables[name] = kind, TYPES[kind]
            if reader.take("="):
                self._assign(name, reader.value())
            if not reader.take(","):
                break
        _done(reader, block)

    def _statement(self, reader: Reader, block: Block) -> None:
        name = re.match(r"[A-Z_][A-Z0-9_]*", block.text.upper())
        word = name[0] if name else ""
        if word in self._variables:
            reader.name()
            reader.expect("=")
            value = reader.value()
            _done(reader, block)
            self._assign(word, value)
        elif PARAMETER.fullmatch(word) or word in self._profile.user:
            reader.name()
            named = self._parameter(word, self._index(reader) if word in self._profile.user else None)
            reader.expect("=")
            value = reader.value()
            _done(reader, block)
            self.parameters[named] = float(real(value))
        elif word in CALLS:
            self._call(word, block)
        elif word in WORDS:
            reader.name()
            _done(reader, block)
            if word == "STOPRE":
                self._axes.settle()
            elif word == "TRAFOOF":
                self._axes.transformation = False
            elif word == "TRANS":  # without axes: no programmable frame is left, MIRROR, SCALE and ROT neither
                self._axes.mirrored = ()
        else:
            self._nc(reader, block)

    def _index(self, reader: Reader) -> Value:
        reader.expect("[")
        index = reader.value()
        reader.expect("]")
        return index

    def _parameter(self, name: str, index: Value | None) -> str:
        """R700, or the field of an array of global user data → its name. Raises Alarm for a field that there is not."""
        if index is None:
            return name
        if not 0 <= real(index) < self._profile.user[name]:
            raise alarm("17020", f"{name}[{index}]")
        return f"{name}[{int(real(index))}]"

    def _assign(self, name: str, value: Value) -> None:
        kind = self._types[name]
        if (kind == "STRING") != isinstance(value, str):
            raise alarm("12150", f"{name}={value!r}")
        if kind == "INT":
            number = real(value)
            if not abs(number) < 2**31:
                raise alarm("14051", name)
            value = int(math.copysign(math.floor(abs(number) + 0.5), number))
        self._variables[name] = float(real(value)) if kind == "REAL" else truth(value) if kind == "BOOL" else value

    def _get(self, name: str, index: Value | None) -> Value:
        if index is None:
            if name in self._variables:
                return self._variables[name]
            if PARAMETER.fullmatch(name):
                return self.parameters.get(name, 0.0)
            if name == "$MN_SCALING_SYSTEM_IS_METRIC":
                return not self._profile.inches
            if name == "$P_TRAFO":
                return TRAORI if self._axes.transformation else 0
        elif name in self._profile.user:
            return self.parameters.get(self._parameter(name, index), 0.0)
        elif (name.startswith(("$AA_", "$VA_")) or name == "$AC_DRF") and isinstance(index, str):
            return self._axes.variable(name, index)
        elif name == "$P_ACTFRAME" and isinstance(index, str) and "," in index:
            return self._axes.frame(*index.split(",", 1))
        elif index in (1, 2) and name == "$AC_MEA":
            return self._axes.measured if index == self._measuring else 0
        elif index in (1, 2) and name == "$A_PROBE":
            return int(self._axes.deflected) if index == self._profile.probe_input else 0
        raise alarm("12550", name if index is None else f"{name}[{index}]")

    def _call(self, word: str, block: Block) -> None:
        if word in ("MSG", "SETAL", "CYCLE800"):
            given = self._given(block.text[len(word) :], block)
            if word == "MSG":
                self._message = str(given[0]) if given else ""
                self._note("message", text=self._message)
            elif word == "SETAL":
                if not given:
                    raise alarm("12090", block.raw)
                raise Alarm(str(int(real(given[0]))), self._message)
            return
        match = re.fullmatch(rf"{word}\s*\(\s*([A-Z_][A-Z0-9_]*)\s*,(.*)\)", block.text, re.IGNORECASE)
        if match is None or self._types.get(match[1].upper()) != "INT":
            raise alarm("12080", block.raw)
        given = self._given(f"({match[2]})", block)
        if len(given) < (2 if word == "WRITE" else 1) or not all(isinstance(value, str) for value in given):
            raise alarm("12090", block.raw)
        self._variables[match[1].upper()] = self._file(word, [str(value) for value in given])

    def _given(self, text: str, block: Block) -> list[Value]:
        reader = Reader(text, self._get)
        given = reader.arguments()
        _done(reader, block)
        return given

    def _file(self, word: str, given: list[str]) -> int:
        """→ error number, 0 for none."""
        name = given[0]
        if word == "EXTOPEN":
            if name not in self._profile.devices:
                return 16
            self._open.add(name)
            return 0
        if word == "EXTCLOSE":
            known = name in self._open
            self._open.discard(name)
            return 0 if known else 16
        text = given[1]
        if len(text) > LONGEST:
            return 9
        if name.startswith("/dev/"):
            if name not in self._open:
                return 16
            self._note("output", text=text.rstrip("\n"))
            self._punch(text.encode("ascii", "replace"))
            return 0
        if len(self.files.get(name, "")) + len(text) + 1 > self._profile.room:
            return 10
        self.files[name] = self.files.get(name, "") + text + "\n"
        self._note("output", text=text)
        return 0

    def _nc(self, reader: Reader, block: Block) -> None:
        if match := re.fullmatch(r"G4 F(\d+\.?\d*)", block.text):  # s; this F is no feed
            self._motion.dwell(float(match[1]))
            return
        targets: dict[str, Target] = {}
        measure, suppressed, spindle = 0.0, False, None
        while reader.peek():
            word = reader.name()
            if word == "SUPA":
                suppressed = True
            elif word == "MEAS":
                reader.expect("=")
                measure = abs(real(reader.value()))
                if measure not in (1, 2):
                    raise alarm("12550", block.raw)
            elif word == "SPOS":
                reader.expect("=")
                spindle = self._position(reader).value
            elif re.fullmatch(r"G\d+", word):
                self._g_code(word, block)
            elif re.fullmatch(r"D\d+", word):
                self._tool(int(word[1:]))
            elif re.fullmatch(r"[ML]\d+", word):
                self._m_code(word)
            elif re.fullmatch(r"N\d+", word):
                continue
            else:
                self._address(word, reader, targets, block)
        if spindle is not None:
            self._motion.rapid({"S": math.radians(spindle % 360)})
        if not targets:
            return
        if measure or self._motion_code == "G1":
            if self._feed <= 0:
                raise alarm("10860", block.raw)
            if not measure:
                self._axes.move(targets, self._feed, suppressed=suppressed)
                return
            self._measuring = int(measure)
            self._motion.watches(measure == self._profile.probe_input)
            try:
                self._axes.measure(targets, self._feed, suppressed=suppressed)
            finally:
                self._motion.watches(True)
        else:
            self._axes.move(targets, None, suppressed=suppressed)

    def _address(self, word: str, reader: Reader, targets: dict[str, Target], block: Block) -> None:
        """`X-3.5`, `X=…`, `F180.`; a number that was read as part of the name is given back."""
        match = re.fullmatch(r"([A-Z])(\d*)", word)
        if match is None:
            raise alarm("12550", word)
        letter = match[1]
        reader.at -= len(match[2])
        equals = reader.take("=")
        if not equals and reader.peek() in ("", "("):
            raise alarm("12080", block.raw)
        if letter == "F":
            self._feed = real(reader.value() if equals else self._literal(reader, block))
        elif letter in self._profile.axes:
            targets[letter] = self._position(reader) if equals else Target(self._literal(reader, block))
        else:
            raise alarm("12550", word)

    def _literal(self, reader: Reader, block: Block) -> float:
        match = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))(?![\w.])").match(reader.text, reader.at)
        if match is None:
            raise alarm("12080", block.raw)
        reader.at = match.end()
        return float(match[1])

    def _position(self, reader: Reader) -> Target:
        way = reader.take("DC", "AC", "IC", "ACP", "ACN")
        if way is None:
            return Target(real(reader.value()))
        reader.expect("(")
        value = real(reader.value())
        reader.expect(")")
        return Target(value, way)

    def _g_code(self, word: str, block: Block) -> None:
        if word not in G_CODES:
            raise alarm("12470", block.raw)
        if word in ("G0", "G1"):
            self._motion_code = word
        elif word in ("G90", "G91"):
            self._axes.incremental = word == "G91"
        elif word in ("G54", "G500"):
            self._axes.settable = word == "G54"

    def _tool(self, number: int) -> None:
        if number and number not in self._profile.tool_lengths:
            raise alarm("17180", f"D{number}")
        self._axes.tool = number

    def _m_code(self, word: str) -> None:
        if int(word[1:]) in (0, 1):
            self._axes.settle()
            self._note("stop", why=word, message=self._message)
        else:
            self._note("m", code=int(word[1:]))


def _done(reader: Reader, block: Block) -> None:
    if reader.peek():
        raise alarm("12080", block.raw)
