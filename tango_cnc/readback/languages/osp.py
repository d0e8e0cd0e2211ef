"""Programs for Okuma OSP: G31 says nothing of what it met, subprograms behind M02 look and stop.

Facts: a stop is VDOUT 990 … 993, behind which the program must turn in a circle; IF and GOTO jump to names of their own program;
CALL gives its arguments to variables of the subprogram alone. Which variables hold the position of an axis and that of the contact
is taken from the profile, and that both are machine coordinates: the program has to find out when they are not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from ...gate import TOUCH
from ...records import InputError, Plan
from ..expressions import Value
from ..language import Companions, Language
from ..reading import MARK_IN_BRACKETS, REST, read_through, stated_words
from ..rehearsal import NUMBER, Rehearsal, numbered
from ..twins import Twin, latched_elsewhere

SHOWS = f"M00({TOUCH})"
COMMENT = re.compile(r"\([^()]*\)")
NAME = re.compile(r"O[A-Z0-9]{1,4}")
LABEL = re.compile(r"N[A-Z0-9]{1,5}")
IF = re.compile(r"IF\[(.+)\] (N[A-Z0-9]{1,5})")
GOTO = re.compile(r"GOTO (N[A-Z0-9]{1,5})")
ASSIGN = re.compile(r"(VC\d{1,3}|TG[A-Z])=([^']+)")
CALL = re.compile(r"CALL (O[A-Z0-9]{1,4})((?: P[A-Z]=[^\s=]+)+)")
FEED = re.compile(rf"([A-Z0-9 .]+?) ?((?: [XYZ]{NUMBER})+) F({NUMBER})")
OFF = re.compile(rf"G1((?: [XYZ]=[A-Z0-9\[\]]+[-+]{NUMBER})+) F({NUMBER})")
TURN = re.compile(rf"G0 ([ABC])({NUMBER})")
TEXT = re.compile(r"VUACM\[1\]='[A-Z0-9 .]{1,16}'")
STOP = re.compile(r"VDOUT\[99[0-3]\]=[1-9]\d*")
PUT = re.compile(r"PUT '([A-Z0-9 ]*)'")
VALUE = re.compile(r"PUT ([A-Z]{2}\d{0,3}),(\d{1,2})")
OPEN = re.compile(r"FWRITC [A-Z]{2}\d:[A-Z0-9-]{1,16}\.[A-Z]{3};A")
START = re.compile(r"TANGO START ([0-9A-F]{12}) (\d+)")
END = re.compile(r"TANGO END ([0-9A-F]{12}) (\d+)")
WORD = re.compile(r"[A-Z]\w*")
OPERATORS = {"ABS", "SQRT", "FIX", "EQ", "NE", "GT", "GE", "LT", "LE", "AND", "OR"}
FRAME = {"G10", "G170", "G53"}  # no rotation, no tool centre point, no tool length: what the first has, the third is G49 elsewhere
CLOSE = "CLOSE C"
NOT_AGAIN = "IF[VRSTT EQ 128]"
LOST = "IF[VACOD NE 0]"
STALE = 66666.0  # in the contact variable after a move that met nothing: a real one may keep what it held before
STEPS = 500  # lines of a subprogram: more is a circle


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith(("FWRITC ", "IF[VRSTT")) for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options, _behind(lines())), tail=True)


LANGUAGE = Language(reads, rehearse)


@dataclass
class _Part:
    """Lines up to the next program name, and where its names are."""

    lines: list[str] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)

    def stops(self, name: str, off: str, opened: bool) -> bool:
        """sequence name, words that switch the probe off, file is open → whether nothing comes out, and all is left in order:

        the probe off, the file closed once where it is open, a text, the alarm, and back to the text.
        """
        at = self.names.get(name)
        if at is None:
            return False
        for word in (*filter(None, [off]), *([CLOSE] if opened else [])):
            if self.lines[at : at + 1] != [word]:
                return False
            at += 1
        text, stop, again = [*self.lines[at : at + 3], "", "", ""][:3]
        back = GOTO.fullmatch(again)
        circles = back is not None and self.names.get(back[1]) == (at if opened else self.names[name])
        return bool(TEXT.fullmatch(text) and STOP.fullmatch(stop)) and circles


def _behind(lines: Iterable[str]) -> dict[str, _Part]:
    """lines → {program name: its part} of what stands behind M02; '' is what belongs to the main program."""
    found = {"": _Part()}
    behind, current = False, found[""]
    for _, line in numbered(lines):
        code = COMMENT.sub("", line)
        if behind and NAME.fullmatch(code):
            if code in found:
                raise InputError(f"{code} appears twice in the program")
            current = found[code] = _Part()
        elif behind and LABEL.fullmatch(code):
            if code in current.names:
                raise InputError(f"{code} appears twice in one program")
            current.names[code] = len(current.lines)
        elif behind and code:
            current.lines.append(code)
        behind = behind or code == "M02"
    return found


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any], parts: Mapping[str, _Part]) -> None:
        self._spelt = lru_cache(maxsize=4096)(self._expressed)
        self._machine = Rehearsal(plan, options, self._read, astray=latched_elsewhere, framed=True)
        self._parts, self._options = parts, options
        self._names = [axis.name for axis in plan.machine.axes if axis.kind != "spindle"]
        self._words = stated_words(options)
        self._wait, self._state = options.get("wait", ""), options.get("probe_state", "")
        self._moving, self._asked, self._named = True, False, False
        self._relative = self._stepped = False  # G91 is on; the step before all else has been made, and nothing else since
        self._seen: set[str] = set()  # what has to have been asked before anything moves
        self._shows = options.get("show") == "stop" and options.get("gate") == "finger"
        self._put: str | None = None
        self._pressed = False  # somebody touches the stylus; whether that was noticed has to be asked
        self._opened = self._closed = self.over = False
        self._mark = ""

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended and self._closed):
            raise InputError("the program ends without end mark, CLOSE C or M02")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if match := MARK_IN_BRACKETS.fullmatch(line):
            self._mark = match[1]
        code = COMMENT.sub("", line)
        orient = self._options.get("orient", "")
        if not code or (not self._named and NAME.fullmatch(code)):
            self._named |= code != ""
        elif not self._named:
            raise InputError("the program has no name O… before its first block")
        elif code in ("G90", "G91"):
            self._relative = code == "G91"
        elif self._relative:
            self._step(code)
        elif match := IF.fullmatch(code):
            self._ask(match[1], match[2])
        elif code == self._wait:
            self._moving = False
        elif match := REST.fullmatch(code):
            self._machine.rests(float(match[1]))
        elif code in self._words:
            self._machine.walk.switch(code)
        elif code == self._options.get("reset"):
            words = code.split()
            self._machine.reset(" ".join(["G49" if word == "G53" else word for word in words if word not in FRAME - {"G53"}]))
        elif code == self._options.get("machine_frame"):
            self._seen.add("frame")
        elif match := CALL.fullmatch(code):
            self._call(match[1], dict(item.split("=") for item in match[2].split()))
        elif line == SHOWS and self._shows and self._machine.walk.proving:
            self._shows = False  # whoever has read it presses start; once, right before the stylus is touched
        elif code == "M02":
            self._machine.watched()
            self.over = True
        elif orient and (match := re.fullmatch(re.escape(orient) + f"=({NUMBER})", code)):
            self._machine.turns("S", float(match[1]), False)
        elif match := TURN.fullmatch(code):
            self._ready()
            self._machine.turns(match[1], float(match[2]), True)
            self._moving, self._asked = True, False
        elif match := FEED.fullmatch(code):
            self._feed(match[1], match[2].split(), float(match[3]))
        elif match := OFF.fullmatch(code):
            self._free(match[1].split(), float(match[2]))
        elif match := ASSIGN.fullmatch(code):
            self._machine.does(lambda twin: self._assign(twin, code))
        else:
            self._print(code)

    def _ready(self) -> None:
        wanted = {"frame", "restart"} | ({"number"} if self._options.get("frame_check") else set())
        if missing := sorted(wanted - self._seen):
            raise InputError(f"something moves before the program has asked for or stated: {', '.join(missing)}")

    def _free(self, words: list[str], feed: float) -> None:
        if len({item[0] for item in words}) < len(words):
            raise InputError(f"found {' '.join(words)}; allowed: every axis once")
        self._machine.off({item[0]: self._spelt(item[2:]) for item in words}, feed)
        self._moving, self._asked = True, False

    def _feed(self, word: str, words: list[str], feed: float) -> None:
        machine = self._machine
        self._ready()
        target = {name: machine.base.position[name] for name in "XYZ"} | {item[0]: float(item[1:]) for item in words}
        if len({item[0] for item in words}) < len(words):
            raise InputError(f"found {' '.join(words)}; allowed: every axis once")
        if word != self._options.get("skip"):
            raise InputError(f"found {word}; allowed: {self._options.get('skip')}, and G1 from where a measuring move has ended")
        if self._state and not self._asked:
            raise InputError("moves without having asked whether the probe is deflected")
        if machine.walk.measures:
            self._pressed = machine.walk.proving
            machine.measures(target, feed)
        else:
            machine.guarded(target, feed)
        self._moving, self._asked, self._stepped = True, False, False

    def _step(self, code: str) -> None:
        """Behind G91: whether the probe is deflected may be asked, then the step before all else, then G90."""
        match = FEED.fullmatch(code)
        if (asked := IF.fullmatch(code)) and self._state:
            self._ask(asked[1], asked[2])
        elif code == self._wait:
            self._moving = False
        elif match is None or match[1] != self._options.get("skip") or len(match[2].split()) != 1 or self._stepped:
            raise InputError("G91 is still on: G90 has to stand right behind the step")
        elif self._state and not self._asked:
            raise InputError("moves without having asked whether the probe is deflected")
        else:
            self._ready()
            word = match[2].strip()
            self._machine.steps(word[0], float(word[1:]), float(match[3]))
            self._moving, self._asked, self._stepped = True, False, True

    def _ask(self, condition: str, name: str) -> None:
        """A question in the main program, whose answer is a stop."""
        if not self._parts[""].stops(name, self._options.get("probe_off", ""), self._opened):
            raise InputError(f"{name} is no place where this program stops for good{self._tidy()}")
        question = f"IF[{condition}]"
        if question in (NOT_AGAIN, LOST):
            if question == LOST and self._moving:
                raise InputError(f"VACOD is read before anything has waited for the axes to stand ({self._wait})")
            self._seen.add("restart" if question == NOT_AGAIN else "number")
            return
        felt = condition == f"VC{self._options.get('common', 1)} EQ 0" and self._pressed
        if felt or (self._stepped and not self._state_in(condition)):
            self._pressed = False
            self._machine.does(lambda twin: setattr(twin, "stopped", bool(self._machine.value(twin, self._spelt(condition)))))
            return
        if not self._state_in(condition):
            raise InputError("no question that a program of this kind has here")
        twin = self._machine.base.twin("stop", "the probe is deflected")
        twin.shared["A_PROBE"] = 1.0
        self._machine.doubts([twin])
        self._asked = True

        def does(twin: Twin) -> None:
            twin.stopped = bool(self._machine.value(twin, self._spelt(condition)))

        self._machine.does(does)

    def _tidy(self) -> str:
        """→ what a stop has to do first here, for the error."""
        wanted = [*filter(None, [self._options.get("probe_off", "")]), *([CLOSE] if self._opened else [])]
        return f", with {' and '.join(wanted)} first and once" if wanted else ""

    def _state_in(self, condition: str) -> bool:
        return bool(self._state) and self._state in condition

    def _call(self, name: str, arguments: Mapping[str, str]) -> None:
        part = self._parts.get(name)
        if part is None or not name:
            raise InputError(f"found a call of {name}, which is not in this program")
        if bare := [f"{key}={text}" for key, text in arguments.items() if key != "PT" and re.fullmatch(r"-?\d+", text)]:
            raise InputError(f"found {' '.join(bare)}; allowed: numbers with a decimal point, without which some controls count µm")
        if any(line.startswith("PUT ") for line in part.lines):
            self._record(name, part, arguments)
            return
        moving = self._moving

        def does(twin: Twin) -> None:
            self._moving = moving
            self._run(twin, name, part, {key: self._machine.value(twin, self._spelt(text)) for key, text in arguments.items()})

        self._machine.does(does)

    def _run(self, twin: Twin, name: str, part: _Part, arguments: dict[str, Value]) -> None:
        """One machine through a subprogram, up to RTS or to a stop."""
        twin.local.append({key: value for key, value in arguments.items()})
        at = 0
        for _ in range(STEPS):
            code = part.lines[at] if at < len(part.lines) else ""
            at += 1
            target = None
            if code == "RTS":
                twin.local.pop()
                return
            if match := IF.fullmatch(code):
                if self._machine.value(twin, self._spelt(match[1])):
                    target = match[2]
            elif match := GOTO.fullmatch(code):
                target = match[1]
            elif code == self._wait:
                self._moving = False
            elif ASSIGN.fullmatch(code):
                self._assign(twin, code)
            else:
                raise InputError(f"in {name}, {code!r}: no line that a program of this kind may have here")
            if target is not None:
                if part.stops(target, self._options.get("probe_off", ""), self._opened):
                    twin.stopped = True
                    twin.local.pop()
                    return
                if target not in part.names:
                    raise InputError(f"in {name}, {code!r}: there is no {target}")
                at = part.names[target]
        raise InputError(f"{name} does not come to RTS")

    def _assign(self, twin: Twin, code: str) -> None:
        match = ASSIGN.fullmatch(code)
        assert match is not None
        common = range(self._options.get("common", 1), self._options.get("common", 1) + 9)
        if match[1].startswith("VC") and int(match[1][2:]) not in common:
            raise InputError(f"{code!r}: found {match[1]} given a value; allowed: VC{common[0]} … VC{common[-1]}")
        store = twin.shared if match[1].startswith("VC") else twin.local[-1]
        store[match[1]] = self._machine.value(twin, self._spelt(match[2]))

    def _record(self, name: str, part: _Part, arguments: Mapping[str, str]) -> None:
        """A subprogram that prints: its sum, then letters and values in turn, then WRITE C."""
        assigned = [line for line in part.lines if ASSIGN.fullmatch(line)]
        printed = part.lines[len(assigned) :]
        *items, write, back = [*printed, "", ""][: len(printed)] if len(printed) > 1 else ["", ""]
        texts, values = [PUT.fullmatch(item) for item in items[::2]], [VALUE.fullmatch(item) for item in items[1::2]]
        if part.lines[: len(assigned)] != assigned or (write, back) != ("WRITE C", "RTS") or not self._opened or self._closed:
            raise InputError(f"{name} is no record: sum, texts and values in turn, WRITE C, RTS")
        if self._put is not None or len(texts) != len(values) or not all(texts) or not all(values):
            raise InputError(f"{name} is no record: texts and values have to take turns")
        letters = [match[1].strip() for match in texts if match]
        terms = [arguments.get(match[1], f"#<{match[1]}>") for match in values if match]
        room = {letter: int(match[2]) for letter, match in zip(letters, values, strict=True) if match}
        if letters[:2] != ["P", "H"] or any(len(letter) != 1 for letter in letters) or len(room) != len(letters):
            raise InputError(f"{name} prints the letters {' '.join(letters)}; they begin with P H, each once")
        if room["P"] < len(str(self._machine.plan.touches[-1].number)) or min(r for key, r in room.items() if key not in "PH") < 10:
            raise InputError(f"{name} prints numbers in fewer places than they need: digits would be lost")

        def does(twin: Twin) -> None:
            twin.local.append({key: self._machine.value(twin, self._spelt(text)) for key, text in arguments.items()})
            for line in assigned:
                self._assign(twin, line)
            twin.local.pop()

        self._machine.does(does)
        self._machine.record(terms[0], terms[1], dict(zip(letters[2:], terms[2:], strict=True)))

    def _print(self, code: str) -> None:
        if OPEN.fullmatch(code) and not self._opened:
            self._opened = True
        elif code == CLOSE and self._opened and self._put is None:
            self._closed = True
        elif (match := PUT.fullmatch(code)) and self._put is None and self._opened and not self._closed:
            self._put = match[1]
        elif code == "WRITE C" and self._put is not None:
            if match := START.fullmatch(self._put):
                self._machine.start(match[1], float(match[2]), self._mark)
            elif match := END.fullmatch(self._put):
                self._machine.end(match[1], float(match[2]))
            else:
                raise InputError(f"nobody knows what {self._put!r} is")
            self._put = None
        else:
            raise InputError("no line that a program of this kind may have here")

    def _expressed(self, text: str) -> str:
        """expression as this control spells it → as the reader of expressions does."""
        if self._state:
            text = text.replace(self._state, "A_PROBE")
        for name in self._names:
            for kind in ("position", "contact"):
                text = text.replace(str(self._options.get(kind, "")).replace("?", name), f"AT_{kind}_{name}")
        return WORD.sub(lambda match: match[0] if match[0] in OPERATORS else f"#<{match[0]}>", text)

    def _read(self, twin: Twin, key: int | str) -> Value:
        name = str(key)
        if name.startswith("AT_") or name == "A_PROBE":
            if self._moving:
                raise InputError(f"{name[3:]} is read before anything has waited for the axes to stand ({self._wait})")
            if name == "A_PROBE":
                return twin.shared.get(name, 0.0)
            _, kind, axis = name.split("_")
            if axis not in self._names:
                raise InputError(f"found the position of {axis}; allowed: {', '.join(self._names)}")
            if kind == "contact" and not twin.hit:
                return STALE
            return twin.shown(axis, (twin.position if kind == "position" else twin.skip)[axis])
        for store in (twin.local[-1], twin.shared):
            if name in store:
                return store[name]
        raise InputError(f"{name} is read before it has a value")
