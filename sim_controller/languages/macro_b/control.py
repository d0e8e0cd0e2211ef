"""A Fanuc-like control that runs Custom Macro B, with its habits: it stores the end point when a probing move misses, ends a
probing move at once when the probe is already deflected, reads numbers without decimal point in thousandths, prints silently
cut numbers and sends its alarms to nobody."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Alarm
from .._shared.memory import stored
from .alarms import alarm, as_alarm
from .axes import Axes
from .blocks import Block, Word, words
from .expressions import Expression, arithmetic
from .printing import printed
from .profile import Profile, default_profile
from .program import Program, condition_and_rest, main_of, split
from .variables import ARGUMENTS, Variables

__all__ = ["Control", "Profile", "default_profile"]

DC2, DC4 = b"\x12", b"\x14"
ENDS = {"lf": b"\n", "crlf": b"\r\n", "lfcrcr": b"\n\r\r", "cr": b"\r"}
DEEPEST = 4  # levels of subprograms and macros below the main program
G_CODES = {0, 1, 4, 15, 28, 31, 40, 43, 49, 50, 53, 61, 64, 65, 67, 69, 80, 90, 91, 94, 97, 98, 99, *range(17, 22), *range(54, 60)}
GROUPS = {0: 1, 1: 1, 17: 2, 18: 2, 19: 2, 90: 3, 91: 3, 94: 5, 20: 6, 21: 6, 43: 8, 49: 8} | dict.fromkeys(range(54, 60), 14)
STOPS = (0, 1, 2, 30)  # M-codes after which nothing is read ahead


class Control:
    """The control's memory from switching on to switching off; `library` holds programs stored in it before."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._axes = Axes(motion, profile)
        self._variables = Variables(self._system, self._set_system)
        self._programs = dict(split(library))
        self._modal: dict[int, float] = {1: 0, 2: 17, 3: 90, 5: 94, 6: 21, 8: 49, 14: 54, **profile.left_on}
        self._feed = 0.0
        self._open = False
        self._clocks = {3001: 0.0, 3002: 0.0}

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines between the % of one tape; `streamed` executes them while they arrive, else they are stored first.

        Returns at M02 or M30. Raises Alarm where the control would show one, Silence when its power fails.
        """
        self._variables.reset()
        self._open = False
        self._modal |= {1: 0, 3: 90}
        try:
            if streamed:
                main = Program("main program", (line for line in lines if not re.match(r"\s*[O:]\d", line)), streamed=True)
            else:
                held = stored(lines, self._profile.memory, lambda where: alarm("PS0070", where))
                tape = split(held, self._profile.reading_stops)
                if not tape:
                    raise alarm("PS5010", "empty tape")
                self._programs |= dict(tape)
                number, text = main_of(tape)
                main = Program(f"O{number}", text)
            self._level(main, 0)
        except MotionStop as stop:
            raise as_alarm(stop) from None
        except Alarm:
            if self._open:
                self._note("left open", what="the port")
            raise

    def _level(self, program: Program, depth: int) -> bool:
        """Runs a program or subprogram; → whether M02 or M30 ended everything."""
        index = 0
        while True:
            block = program.at(index)
            if block is None:
                raise alarm("PS5010", program.name)
            self._note("block", program=program.name, line=index + 1, text=block.raw)
            self._motion.reads(block.raw)
            ended, jump, began = None, None, self._motion.time
            if block.is_macro:
                jump = self._macro(program, index, block)
            elif block.text:
                ended, jump = self._nc(program, index, block, depth)
            if ended is not None:
                return ended
            self._axes.passed(self._motion.time > began)
            index = index + 1 if jump is None else jump

    def _macro(self, program: Program, index: int, block: Block) -> int | None:
        """Executes a macro statement; → index to go on at, None for the next block."""
        text = block.text
        if text.startswith("IF["):
            truth, rest = condition_and_rest(text, self._expression(text, 2))
            if rest.startswith("THEN"):
                if truth:
                    self._assign(rest[4:], block)
                return None
            if not rest.startswith("GOTO"):
                raise alarm("PS0125", block.raw)
            self._refuse_branch(program, block)
            return self._goto(program, index, rest) if truth else None
        if text.startswith("GOTO"):
            return self._goto(program, index, text)
        if text.startswith(("WHILE[", "DO")):
            self._refuse_branch(program, block)
            end = program.partner(index)
            truth, rest = condition_and_rest(text, self._expression(text, 5)) if text.startswith("WHILE") else (True, text)
            if not rest.startswith("DO"):
                raise alarm("PS0125", block.raw)
            return None if truth else end + 1
        if text.startswith("END"):
            self._refuse_branch(program, block)
            return program.partner(index)
        if text in ("POPEN", "PCLOS"):
            self._open = text == "POPEN"
            self._punch(DC2 if self._open else DC4)
        elif text.startswith("DPRNT["):
            self._print(text, block)
        elif text.startswith("#"):
            self._assign(text, block)
        else:
            raise alarm("PS0125", block.raw)
        return None

    def _refuse_branch(self, program: Program, block: Block) -> None:
        if program.streamed and not self._profile.branches_in_dnc:
            raise alarm("PS0123", block.raw)

    def _goto(self, program: Program, index: int, text: str) -> int:
        block = program.at(index)
        assert block is not None
        self._refuse_branch(program, block)
        expression = self._expression(text, 4)
        number = arithmetic(expression.primary())
        if expression.at != len(text):
            raise alarm("PS0125", block.raw)
        return program.sequence(int(number), index)

    def _assign(self, text: str, block: Block) -> None:
        target = self._expression(text, 0)
        if not text.startswith("#"):
            raise alarm("PS0125", block.raw)
        number = target.reference()
        if not text.startswith("=", target.at):
            raise alarm("PS0125", block.raw)
        source = self._expression(text, target.at + 1)
        value = source.value()
        if source.at != len(text):
            raise alarm("PS0127" if text[source.at].isalpha() else "PS0114", block.raw)
        if number in (3000, 3006):
            self._message(number, arithmetic(value), block.comment)
        else:
            self._variables.set(number, None if value is None else arithmetic(value))

    def _message(self, number: int, value: float, comment: str) -> None:
        if number == 3000:
            raise Alarm(f"MC{3000 + int(value) % 1000:04d}", comment.strip())
        self._note("stop", why="#3006", message=comment.strip())
        self._axes.settle()

    def _print(self, text: str, block: Block) -> None:
        if not text.endswith("]"):
            raise alarm("PS0114", block.raw)
        line = printed(text[6:-1], self._variables.get, self._profile.padding, self._profile.overflow)
        if not self._open:
            self._note("lost", text=line, why="DPRNT without POPEN")
            return
        self._note("output", text=line)
        self._punch(line.encode("ascii") + ENDS[self._profile.line_end])

    def _nc(self, program: Program, index: int, block: Block, depth: int) -> tuple[bool | None, int | None]:
        """Executes an NC block; → (whether everything ended, or None to go on; index to go on at, or None for the next)."""
        found = list(words(block.text, self._variables.get))
        g_codes = [word.value for word in found if word.letter == "G"]
        if 103 in g_codes and self._profile.macros_ahead:
            self._axes.limited = any(word.letter == "P" and word.value == 1 for word in found)
            return None, None
        skip = self._profile.skip_word
        if 31 in g_codes and (("P" in skip and not any(word.letter == "P" for word in found)) or "." in skip):
            raise alarm("P601", block.raw)
        if "." in skip:
            g_codes = [31.0 if code == float(skip[1:5]) else code for code in g_codes]
        for code in g_codes:
            if code not in G_CODES:
                raise alarm("PS0010", block.raw)
            if code in GROUPS:
                self._modal[GROUPS[int(code)]] = int(code)
        if 65 in g_codes:
            return self._call_macro(found, block, depth), None
        m_codes = [int(word.value) for word in found if word.letter == "M"]
        before = self._feed
        if 31 in g_codes and self._profile.skip_feed == "own" and not any(word.letter == "F" for word in found):
            raise alarm("P603", block.raw)
        self._set_feed(found)
        self._axes.inch, self._axes.work = self._modal[6] == 20, int(self._modal[14])
        if 19 in m_codes:
            for angle in (word.value for word in found if word.letter == self._profile.orient):
                self._motion.rapid({"S": math.radians(angle % 360)})
        self._move(g_codes, [word for word in found if word.letter not in "GMFST"], 19 in m_codes, block)
        if 31 in g_codes and self._profile.skip_feed == "own":
            self._feed = before
        for code in m_codes:
            self._note("m", code=code)
        waits = self._profile.waits.replace(" ", "")
        if any(code in STOPS for code in m_codes) or (waits and block.text == waits):
            self._axes.settle()
        if 98 in m_codes:
            return self._call_subprogram(found, block, depth), None
        if 99 in m_codes:
            target = next((word.value for word in found if word.letter == "P"), None)
            if depth:
                return False, None
            self._refuse_branch(program, block)
            return None, 0 if target is None else program.sequence(int(target), index)
        return (True if 2 in m_codes or 30 in m_codes else None), None

    def _set_feed(self, found: list[Word]) -> None:
        for word in found:
            if word.letter == "F":
                self._feed = word.value * (25.4 if self._modal[6] == 20 else 1.0)

    def _move(self, g_codes: list[float], found: list[Word], oriented: bool, block: Block) -> None:
        """Everything in a block that moves an axis, or the clock."""
        axes = [word for word in found if word.letter in self._profile.axes]
        others = {word.letter: word for word in found if word.letter not in self._profile.axes}
        allowed = {"P", "L", "H", "D", "Q", "O"} | ({"R"} if oriented else set())
        for letter in others:
            if letter not in allowed:
                raise alarm("PS0009", f"{letter} in {block.raw}")
        if 4 in g_codes:
            self._dwell(others.get("P"), next((word for word in axes if word.letter == "X"), None))
            return
        if 43 in g_codes or 49 in g_codes:
            self._axes.select_length(int(others["H"].value) if "H" in others and 43 in g_codes else 0, not axes)
        self._axes.incremental = self._modal[3] == 91
        if 28 in g_codes:
            self._axes.reference(axes)
        elif 53 in g_codes:
            self._axes.machine_move(axes)
        elif 31 in g_codes:
            if self._feed <= 0:
                raise alarm("PS0011", block.raw)
            if self._feed > self._profile.fastest_skip:
                raise alarm("PS0035", f"{block.raw} is faster than {self._profile.fastest_skip:g}")
            wired = re.search(r"P(\d+)", self._profile.skip_word)
            self._axes.skip(axes, self._feed, wired is not None and others["P"].value != int(wired[1]))
        elif axes and self._modal[1] == 0:
            self._axes.rapid(axes)
        elif axes:
            if self._feed <= 0:
                raise alarm("PS0011", block.raw)
            self._axes.feed(axes, self._feed)

    def _dwell(self, milliseconds: Word | None, seconds: Word | None) -> None:
        if milliseconds is not None:
            whole = self._profile.point_seconds and milliseconds.literal is not None and "." in milliseconds.literal
            self._motion.dwell(milliseconds.value / (1 if whole else 1000))  # Haas: P1. is a second, P1 a thousandth
        elif seconds is not None:
            plain = seconds.literal is not None and "." not in seconds.literal
            self._motion.dwell(seconds.value * (0.001 if plain else 1.0))

    def _subprogram(self, found: list[Word], block: Block, depth: int) -> Program:
        number = next((int(word.value) for word in found if word.letter == "P"), None)
        if number is None:
            raise alarm("PS0076", block.raw)
        if number not in self._programs:
            raise alarm("PS0076", f"O{number}")
        if depth >= DEEPEST:
            raise alarm("PS0077", block.raw)
        return Program(f"O{number}", self._programs[number])

    def _call_subprogram(self, found: list[Word], block: Block, depth: int) -> bool | None:
        times = next((int(word.value) for word in found if word.letter == "L"), 1)
        for _ in range(times):
            if self._level(self._subprogram(found, block, depth), depth + 1):
                return True
        return None

    def _call_macro(self, found: list[Word], block: Block, depth: int) -> bool | None:
        """G65: the words become local variables; without decimal point those of axes and radii count least increments."""
        times = next((int(word.value) for word in found if word.letter == "L"), 1)
        arguments = {}
        for word in found[1 + [w.letter for w in found].index("G") :]:
            if word.letter in "GNO":
                raise alarm("PS0129", block.raw)
            if word.letter in ARGUMENTS:
                plain = word.literal is not None and "." not in word.literal and word.letter in "ABCIJKQRUVWXYZ"
                scale = float(self._profile.increment) if plain and not self._profile.calculator else 1.0
                arguments[ARGUMENTS[word.letter]] = word.value * scale
        for _ in range(times):
            program = self._subprogram(found, block, depth)
            self._variables.enter(arguments)
            ended = self._level(program, depth + 1)
            self._variables.leave()
            if ended:
                return True
        return None

    def _expression(self, text: str, at: int) -> Expression:
        return Expression(text, self._variables.get, at)

    def _system(self, number: int) -> float | None:
        if number in (3001, 3002):
            scale = 1000.0 if number == 3001 else 1 / 3600
            return self._motion.time * scale + self._clocks[number]
        if 4001 <= number <= 4022:
            return float(self._modal.get(number - 4000, 0))
        if number == 4109:
            return self._feed
        if number and number == self._profile.probe_variable:
            return float(self._axes.deflected)
        value = self._axes.variable(number)
        if value is None:
            raise alarm("PS0115", f"#{number}")
        return value

    def _set_system(self, number: int, value: float | None) -> None:
        if number in (3001, 3002):
            scale = 1000.0 if number == 3001 else 1 / 3600
            self._clocks[number] = (value or 0.0) - self._motion.time * scale
        elif number not in (3003, 3004) and not self._axes.set_variable(number, value or 0.0):
            raise alarm("PS0116" if self._axes.variable(number) is not None else "PS0115", f"#{number}")
