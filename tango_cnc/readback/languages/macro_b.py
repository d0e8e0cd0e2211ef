"""Programs of the Macro-B family: G31 that says nothing of what it met, so the text itself has to look and to stop.

Facts: what stands behind M30 is not read into the memory; arguments of G65 and system variables #5021 (machine), #5041 (work),
#5061 (skip position, work) by axis number;
#4008 the word in force of G43 G44 G49;
what a jump goes to is looked for by its sequence number; an alarm ends everything, so what is to be in order is done before it;
local variables #1 … #33 of a called program are its own; a statement behind THEN is carried out when the condition is not 0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ...gate import INCH, TOUCH
from ...records import InputError, Plan
from ..expressions import Value
from ..language import Companions, Language
from ..reading import MARK_IN_BRACKETS, axes_by_number, read_through, stated_words
from ..rehearsal import NUMBER, Rehearsal, Twin, numbered

ARGUMENTS = {"A": 1, "B": 2, "C": 3, "I": 4, "J": 5, "K": 6, "F": 9, "S": 19, "T": 20, "X": 24, "Y": 25, "Z": 26}
ARGUED = max(ARGUMENTS.values())
LOCAL, COMMON = range(1, 34), range(100, 150)
WORD = rf"(?:#\d+|{NUMBER}|\[\S+\])"
COMMENT = re.compile(r"\([^()]*\)")
PROGRAM, LABEL, BEFORE = re.compile(r"O(\d{4,5})"), re.compile(r"N\d{1,5}"), re.compile(r"%|O\d{4,5}")
FEED = re.compile(rf"(G31(?:\.[1-4])?(?: P[1-9]\d?)?|G1) ((?:[XYZ]{WORD} )+)F(#\d+|{NUMBER})")
STEP = re.compile(rf"G91 (G31(?:\.[1-4])?(?: P[1-9]\d?)?) ([XYZ])({NUMBER}) F({NUMBER})")
TURN = re.compile(rf"G90 G53 G0 ([ABC])({NUMBER})")
ASSIGN = re.compile(r"#(\d+)=(.+)")
IF = re.compile(r"IF\[(.+)\]THEN(#\d+=.+)")
JUMP, PASSES = re.compile(r"IF\[(.+)\]GOTO(\d{1,5})"), re.compile(r"GOTO(\d{1,5})")
ALARM = re.compile(r"#3000=\d{1,3}")
CALL = re.compile(rf"G65 P(\d+)((?: [A-Z]{NUMBER})+)")
START = re.compile(r"DPRNT\[TANGO\*START\*([0-9A-F]{12})\*(#\d+)\[60\]\]")
END = re.compile(r"DPRNT\[TANGO\*END\*([0-9A-F]{12})\*(#\d+)\[60\]\]")
RECORD = re.compile(r"DPRNT\[P(#\d+)\[60\]\*H(#\d+)\[10\]((?:\*[A-Z]#\d+\[(?:44|43|53)\])+)\]")
LENGTH = re.compile(r"IF\[#4008NE49\]THEN#3000=\d{1,3}")
MODE = re.compile(r"IF\[#(40[012]\d)EQ(\d{1,3}(?:\.\d)?)\]THEN#3000=\d{1,3}")
SHOWS = f"#3006=1({TOUCH})"
DWELL = re.compile(r"G4 [PX]\d{1,2}\.")
STOP = 3000
WANTED = 121  # number of the set of macros that the program was written for
BLANKS = 2  # one is read while the motion before it is carried out, the next one when that is done
ENDS = ("M30", "M2")
LONGEST_WAY = 3  # blocks before an alarm
PASSIVE = {"POPEN", "PCLOS", ""}
OTHERS = ("M880(", "M115 /", "M121 ", "M125 /")  # Mach4 and Centroid have the same variables


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    if any(line.startswith(OTHERS) for line in head):
        return False
    return any(re.match(r"O\d{4,5}\(", line) for line in head[:2]) or any("DPRNT[" in line or "#5041" in line for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options, lines()), tail=True)


LANGUAGE = Language(reads, rehearse)


def _texts(lines: Iterable[str]) -> dict[int, list[str]]:
    """lines → {program number: its lines}; 0 is the main one, or what has no number. A control reads no further than its end."""
    found: dict[int, list[str]] = {}
    current: list[str] = found.setdefault(0, [])
    for _, line in numbered(lines):
        code = COMMENT.sub("", line)
        if match := PROGRAM.fullmatch(code):
            if int(match[1]) in found:
                raise InputError(f"O{match[1]} appears twice")
            current = found.setdefault(int(match[1]), [])
        else:
            current.append(line)
        if code in ENDS:
            found[0] = [*found[0], *current] if current is not found[0] else current
            break
    return {number: text for number, text in found.items() if not number or any(COMMENT.sub("", line) == "M99" for line in text)}


def _ways_out(text: Iterable[str]) -> dict[int, list[str]]:
    """lines of one program → {sequence number: the blocks from there up to the alarm}. A number that appears twice has none."""
    found: dict[int, list[str]] = {}
    labels: list[int] = []
    way: list[str] | None = None
    for line in text:
        if way is None and not line.startswith("N"):
            continue
        code = COMMENT.sub("", line)
        if LABEL.fullmatch(code):
            labels.append(int(code[1:]))
            way = []
        elif way is not None and ALARM.fullmatch(code):
            found[labels[-1]], way = way, None
        elif way is not None:
            way = [*way, code] if len(way) < LONGEST_WAY else None
    return {number: way for number, way in found.items() if labels.count(number) == 1}


class _Program:
    """Line by line."""

    closes: tuple[str, ...] = ("PCLOS",)  # what closes where records go

    def __init__(self, plan: Plan, options: Mapping[str, Any], lines: Iterable[str]) -> None:
        texts = _texts(lines)
        macros = {number: text for number, text in texts.items() if number}
        self._ways = {number: _ways_out(text) for number, text in texts.items()}
        self._in = 0  # number of the macro whose text is carried out
        self._past: int | None = None  # sequence number up to which ways out are passed by
        off = options.get("probe_off")
        self._tidy = [] if options.get("alarm") == "at once" else [*([off] if off else []), *self.closes]
        self._on, self._watching = options.get("probe_on") or None, False
        self._axis = axes_by_number(plan, options)
        self._machine = Rehearsal(plan, options, self._read, framed=True, dynamic=True)
        if options.get("position_unit") == "inch":
            self._machine.base.unit, self._machine.everywhere[-1].unit = INCH, 1.0
            self._machine.everywhere[-1].what = "positions come in mm"
        self._macros, self._mark = macros, ""
        self._aside = False  # within the text of a macro
        self._words = stated_words(options)
        self._reset, orient = options.get("reset", ""), options.get("orient", "")
        self._turned = re.compile(re.escape(orient) + f"({NUMBER})") if orient else None
        self._signed = options.get("rollover") == "signed"
        self._moving = True  # since the last motion nothing has waited for the axes
        self._depth = 0
        self._skip, self._wait = options.get("skip", "G31"), options.get("wait", "G53")
        self._ahead = self._wait.startswith("G103")  # macro statements are carried out ahead of motion
        self._limited, self._blank = False, 0  # whether reading ahead is down to one block; empty blocks since the last motion
        self._ask, self._asked = bool(options.get("length_check")), False  # whether no tool length is on
        self._unasked = {(int(number), float(code)) for number, code in (options.get("must_be_off") or {}).items()}
        self._state, self._free = int(options.get("probe_state") or 0), False  # variable of the probe; whether it has been asked
        for twin in self._machine.everywhere:
            twin.shared[self._state] = 0.0
        self._begun = self._opened = self._closed = self._relative = False
        self._shows = options.get("show") == "stop" and options.get("gate") == "finger"
        self.over = False

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended and self._closed):
            raise InputError("the program ends without end mark, PCLOS or end of program")

    def line(self, line: str) -> None:
        """One line of the tape. Raises InputError when it must not reach a machine."""
        if match := MARK_IN_BRACKETS.fullmatch(line):
            self._mark = match[1]
        code = COMMENT.sub("", line)
        if not self._depth and (self._aside or (PROGRAM.fullmatch(code) and int(code[1:]) in self._macros)):
            self._aside = code != "M99"  # the text of a macro, which is carried out where it is called
            return
        if self._past is not None:
            self._passes(code)
            return
        if LABEL.fullmatch(code) or (not self._begun and BEFORE.fullmatch(code)):
            return
        self._begun |= code != ""
        if not (self._states(line, code) or self._waits(code) or self._acts(code) or self._computes(code)):
            self._print(code)

    def _states(self, line: str, code: str) -> bool:
        """→ whether the line is one of the head or the end, or switches something; then it is done."""
        if code in PASSIVE:
            if (code == "POPEN" and self._opened) or (code == "PCLOS" and self._closed):
                raise InputError(f"a second {code}")
            self._opened |= code == "POPEN"
            self._closed |= code == "PCLOS"
        elif LENGTH.fullmatch(code) and not self._opened:
            self._asked = True
        elif (match := MODE.fullmatch(code)) and not self._opened:
            self._unasked.discard((int(match[1]), float(match[2])))
        elif code == "G21" and not self._opened:
            self._machine.reset(code)
        elif line == SHOWS and self._shows and self._machine.walk.proving:
            self._shows = False  # whoever has read it presses start; once, right before the stylus is touched
        elif code == self._reset:
            if self._ask and not self._asked and "G49" in code.split():
                raise InputError("G49 by itself may move Z by a tool length: IF[#4008NE49]THEN#3000=… has to stand before it")
            self._machine.reset(code)
        elif code in self._words:
            self._machine.walk.switch(code)
            self._watching |= code == self._on
        elif code in ENDS and self._depth == 0:
            self._machine.watched()
            self.over = True
        elif code == "G90":
            self._relative = False
        else:
            return False
        return True

    def _waits(self, code: str) -> bool:
        """→ whether the line only lets time pass or ends reading ahead; then it is done."""
        if DWELL.fullmatch(code):
            self._machine.rests(float(code.split()[1][1:]))
        elif code == self._wait:
            self._limited = True
            self._moving = self._moving and self._ahead
        elif code == ";" and self._ahead:
            self._blank += 1
            self._moving = self._moving and not (self._limited and self._blank >= BLANKS)
        else:
            return False
        return True

    def _acts(self, code: str) -> bool:
        """→ whether the line moves an axis; then it has."""
        if match := self._turned.fullmatch(code) if self._turned else None:
            self._machine.turns("S", float(match[1]), False)
        elif match := TURN.fullmatch(code):
            self._machine.turns(match[1], self._angle(match[1], float(match[2])), True)
            self._moving, self._blank = True, 0
        elif match := STEP.fullmatch(code):
            self._step(match[1], match[2], float(match[3]), float(match[4]))
        elif match := FEED.fullmatch(code):
            self._feed(match[1], match[2].split(), match[3])
        else:
            return False
        return True

    def _computes(self, code: str) -> bool:
        """→ whether the line computes, branches or calls a macro; then it has."""
        if match := JUMP.fullmatch(code):
            self._probe(match[1])
            self._machine.does(self._jump(match[1], int(match[2])))
        elif match := PASSES.fullmatch(code):
            self._past = int(match[1])
        elif match := IF.fullmatch(code):
            self._probe(match[1])
            self._machine.does(self._assignment(match[2], match[1]))
        elif ASSIGN.fullmatch(code):
            self._machine.does(self._assignment(code, None))
        elif match := CALL.fullmatch(code):
            self._call(int(match[1]), match[2].split())
        else:
            return False
        return True

    def _probe(self, condition: str) -> None:
        """The probe is asked: beside the machine there is one on which it is deflected."""
        if self._state and condition == f"#{self._state}NE0":
            if self._moving:
                raise InputError(f"#{self._state} is read before anything has waited for the axes to stand ({self._wait})")
            twin = self._machine.base.twin("stop", "the probe is deflected")
            twin.shared[self._state] = 1.0
            self._machine.doubts([twin])
            self._free = True

    def _angle(self, name: str, value: float) -> float:
        """axis letter, deg as written → deg meant: for endless axes of such controls the sign is the sense of the turn."""
        travel = self._machine.plan.machine.axis(name).travel
        endless = travel is None or travel[1] - travel[0] > math.radians(800)
        return abs(value) if self._signed and endless else value

    def _print(self, code: str) -> None:
        if not self._opened or self._closed:
            raise InputError("no line that a program of this kind may have here")
        if match := START.fullmatch(code):
            self._machine.start(match[1], self._machine.same(match[2]), self._mark)
        elif match := END.fullmatch(code):
            self._machine.end(match[1], self._machine.same(match[2]))
        elif match := RECORD.fullmatch(code):
            items = match[3].split("*")[1:]
            places = {item[0]: item[1:].split("[")[0] for item in items}
            if len(places) < len(items):
                raise InputError("a letter appears twice in the record")
            self._machine.record(match[1], match[2], places)
        else:
            raise InputError("no line that a program of this kind may have here")

    def _step(self, word: str, name: str, by: float, feed: float) -> None:
        """The step that shows whether positions come in mm, a distance under G91."""
        self._asks(word)
        self._machine.steps(name, by, feed)
        self._relative, self._moving, self._blank = True, self._ahead, 0

    def _asks(self, word: str) -> None:
        """Before a move with the skip word. Raises InputError for another word, or where nobody has asked what it takes."""
        if self._unasked:
            number, asked = min(self._unasked)
            raise InputError(f"something moves before IF[#{number}EQ{asked:g}]THEN#3000=… has asked, see controller.must_be_off")
        if word != self._skip:
            raise InputError(f"found {word}; allowed: {self._skip}, the word of the profile")
        if self._state and not self._free:
            raise InputError("moves without having asked whether the probe is deflected")
        self._free = False

    def _feed(self, word: str, words: list[str], feed: str) -> None:
        letters = [item[0] for item in words]
        if letters != sorted(set(letters)):
            raise InputError(f"found {' '.join(letters)}; allowed: X Y Z, each once")
        if self._relative:
            raise InputError("G91 is still on: G90 has to stand right behind the step")
        speed = self._machine.same(feed)
        if word == "G1":
            self._machine.off({item[0]: item[1:] for item in words}, speed, work=True)
            self._moving, self._blank = True, 0
            return
        self._asks(word)
        named = {item[0]: self._machine.same(item[1:]) + self._machine.base.offset[item[0]] for item in words}
        target = {name: self._machine.base.position[name] for name in "XYZ"} | named
        if self._machine.walk.measures:
            self._machine.measures(target, speed)
        else:
            self._machine.guarded(target, speed)
        self._moving = self._ahead  # nothing is read ahead of the end of a G31, but by controls that want empty blocks
        self._blank = 0

    def _assignment(self, text: str, condition: str | None) -> Callable[[Twin], None]:
        match = ASSIGN.fullmatch(text)
        assert match is not None
        number, value = int(match[1]), match[2]
        if number == STOP:
            if not re.fullmatch(r"\d{1,3}", value):
                raise InputError(f"found the alarm {value}; allowed: a number")
            if self._tidy and (self._opened or self._watching):
                raise InputError(f"an alarm that {self._untidy()}; with alarm: at once in the profile it may")
        elif number not in LOCAL and number not in COMMON:
            raise InputError(f"found #{number} given a value; allowed: #1 … #33, #100 … #149")

        def does(twin: Twin) -> None:
            if condition is not None and not self._machine.value(twin, condition):
                return
            if number == STOP:
                twin.stopped = True
                return
            store = twin.local[-1] if number in LOCAL else twin.shared
            store[number] = self._machine.value(twin, value)

        return does

    def _jump(self, condition: str, number: int) -> Callable[[Twin], None]:
        """condition, sequence number → the statement. Raises InputError where no alarm is there that leaves all in order."""
        way = self._ways[self._in].get(number)
        if way is None:
            raise InputError(f"found GOTO{number}; allowed: one number of this program, behind which an alarm stands")
        if way != self._tidy:
            raise InputError(f"N{number} {self._untidy()}")

        def does(twin: Twin) -> None:
            twin.stopped |= bool(self._machine.value(twin, condition))

        return does

    def _untidy(self) -> str:
        return f"stops without {' and '.join(self._tidy)} right before the alarm: it leaves the probe on or the port open"

    def _passes(self, code: str) -> None:
        """A line of the ways out, which a program that has gone well does not carry out."""
        if code == f"N{self._past}":
            self._past = None
        elif not (LABEL.fullmatch(code) or code in self._tidy or ALARM.fullmatch(code)):
            raise InputError(f"GOTO{self._past} leaves it out; allowed there: ways out that end with an alarm")

    def _call(self, number: int, words: list[str]) -> None:
        if number not in self._macros or self._depth:
            raise InputError(f"found a call of O{number}, which is not in this program")
        arguments: dict[int | str, Value] = {}
        for word in words:
            if word[0] not in ARGUMENTS:
                raise InputError(f"found the argument {word[0]}; allowed: {' '.join(ARGUMENTS)}")
            arguments[ARGUMENTS[word[0]]] = float(word[1:])
        foreign = self._machine.base.twin("stop", f"somebody else's O{number} has run")
        other = self._machine.base.twin("stop", f"O{number} belongs to another program")
        if WANTED in other.shared:
            other.shared[WANTED] = (other.shared[WANTED] or 0.0) + 1
        self._machine.doubts([other])
        self._depth += 1
        self._in = number
        for twin in self._machine.twins:
            twin.local.append(dict(arguments))
        for line in self._macros[number]:
            if COMMENT.sub("", line) == "M99":
                break
            try:
                self.line(line)
            except InputError as error:
                raise InputError(f"in O{number}, {line!r}: {error}") from None
        else:
            raise InputError(f"O{number} has no M99")
        self._in = 0
        for twin in self._machine.twins:
            twin.local.pop()
        self._depth -= 1
        self._machine.doubts([foreign])

    def _read(self, twin: Twin, key: int | str) -> Value:
        assert isinstance(key, int)
        if key == 0:
            return None
        local = twin.local[-1]
        if 0 < key < COMMON[0]:
            if key in local or (key in LOCAL and key <= ARGUED):
                return local.get(key)
        elif key in COMMON and key in twin.shared:
            return twin.shared[key]
        kind, axis = divmod(key - 5000, 20) if 5020 < key < 5080 else (0, 0)
        if kind and axis in self._axis:
            name = self._axis[axis]
            if kind == 3 and self._moving and self._ahead:
                raise InputError(f"#{key} is read before two empty blocks after G103 P1 have waited for the axes to stop")
            if kind == 3:
                return twin.shown(name, twin.skip[name] - twin.offset[name])
            if self._moving:
                raise InputError(f"#{key} is read before anything has waited for the axes to stand ({self._wait})")
            return twin.shown(name, twin.position[name] - (twin.offset[name] if kind == 2 else 0.0))
        if key not in twin.shared:
            raise InputError(f"#{key} is read before it has a value")
        return twin.shared[key]
