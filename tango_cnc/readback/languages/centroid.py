"""Programs for Centroid: protected moves that the control guards, touches that go on when nothing is met, records by M223.

Facts: positions of M115 and M125 are work coordinates under G90; #5021 … machine and #5041 … work position by axis number, to be
read when the axes stand, which a read input (#50010), M115 and M125 wait for; #24301 … the machine position of the contact, #25022
whether there was one; #9011 the input of the probe; a stop is a label behind the last line that a right program comes to.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ...records import InputError, Plan
from ..expressions import Value
from ..language import Companions, Language
from ..reading import MARK_BEHIND_SEMICOLON, REST, axes_by_number, read_through, stated_words
from ..rehearsal import NUMBER, SPOILT, Rehearsal, numbered
from ..twins import Twin

COORDINATE = r"\[[^\]]+\]"
GUARDED = re.compile(rf"M125((?: /[XYZ]{COORDINATE})+) P#9011 F({NUMBER})")
STEP = re.compile(rf"M125 /([XYZ])\[({NUMBER})\] P#9011 F({NUMBER})")
MEASURE = re.compile(rf"M115((?: /[XYZ]{COORDINATE})+) P#9011 F({NUMBER}) L1")
AWAY = re.compile(rf"G1((?: [XYZ]{COORDINATE})+) F({NUMBER})")
TURN = re.compile(rf"G53 ([ABC])({NUMBER})")
ASSIGN = re.compile(r"#(\d+) = (.+)")
IF = re.compile(r"IF \[(.+)\] THEN (#\d+ = .+|GOTO \d+)")
GOTO = re.compile(r"GOTO (\d+)")
OPEN = re.compile(r'M121 "[A-Za-z0-9_.-]+"')
START = re.compile(r'M223 "TANGO START ([0-9A-F]{12}) (\d+)\\n"')
END = re.compile(r'M223 "TANGO END ([0-9A-F]{12}) (\d+)\\n"')
RECORD = re.compile(r'M223 "P%\.0f H%\.0f((?: [A-Z]%\.[4-9]f)+)\\n"((?: #\d+)+)')
STOP = re.compile(r'M225 #(\d+) "TANGO STOPPED\. [A-Z0-9 .]+"')
SHOWN = re.compile(r'M225 (#\d+) "[A-Z0-9 .-]+"')
LONGEST = 10.0  # s that a text for the person may hold the program up
WAIT = "IF #50010"
OWN = range(29000, 30000)
INPUT, PROBE_BIT, TRIPPED = 9011, 50015, 25022
SYMBOLS = (
    ("==", " EQ "),
    ("!=", " NE "),
    ("<=", " LE "),
    (">=", " GE "),
    ("<", " LT "),
    (">", " GT "),
    ("&&", " AND "),
    ("||", " OR "),
)


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith(("M125 /", "M115 /", "M121 ")) or line == WAIT for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options, *_stops(lines(), options.get("probe_off", ""))), tail=True)


LANGUAGE = Language(reads, rehearse)


def _stops(lines: Iterable[str], off: str) -> tuple[set[int], int, int]:
    """lines, words that switch the probe off → labels that say something and end, the last label, the variable of how long.

    Raises InputError when what stands behind the labels is anything else.
    """
    tail: list[str] = []
    for _, line in numbered(lines):
        if tail or re.fullmatch(r"N\d+", line):
            tail.append(line)
    if not tail or not re.fullmatch(r"N\d+", tail[-1]):
        raise InputError("the last line is no label, with which a program ends")
    last, found, seconds = int(tail[-1][1:]), set(), -1
    rest, each = tail[:-1], 4 if off else 3
    for i in range(0, len(rest), each):
        label, *switched, said, jump = [*rest[i : i + each], *[""] * each][:each]
        if off and switched != [off]:
            raise InputError(f"{label} leaves the probe on: {off} is missing")
        match, going = STOP.fullmatch(said), GOTO.fullmatch(jump)
        if not re.fullmatch(r"N\d+", label) or not match or not going or int(going[1]) != last:
            raise InputError(f"{label} is no place where this program stops")
        if int(label[1:]) in found or int(label[1:]) == last or seconds not in (-1, int(match[1])):
            raise InputError(f"{label} appears twice, or its message is shown for another time")
        found.add(int(label[1:]))
        seconds = int(match[1])
    return found, last, seconds


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any], stops: set[int], last: int, seconds: int) -> None:
        self._axis = axes_by_number(plan, options)
        self._machine = Rehearsal(plan, options, self._read, latches=True, framed=True)
        self._stops, self._last, self._seconds = stops, last, seconds
        self._words = stated_words(options)
        self._reset, self._orient = options.get("reset", ""), options.get("orient", "")
        self._mark = ""
        self._moving = True  # since the last motion nothing has waited for the axes
        self._opened = self._asked = self._relative = self.over = False

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended):
            raise InputError("the program ends without end mark or GOTO to its last label")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if match := MARK_BEHIND_SEMICOLON.fullmatch(line):
            self._mark = match[1]
        code = line.partition(";")[0].strip() if '"' not in line else line
        if not code or code in self._words:
            self._machine.walk.switch(code)
            return
        if code == WAIT:
            self._moving = False
        elif match := REST.fullmatch(code):
            self._machine.rests(float(match[1]))
        elif code == self._reset and not self._machine.begun:
            self._machine.reset(code)
        elif match := GOTO.fullmatch(code):
            self._machine.watched()
            if int(match[1]) != self._last or not self._machine.ended:
                raise InputError("goes to another place than its end")
            self.over = True
        elif match := IF.fullmatch(code):
            self._if(match[1], match[2])
        elif match := ASSIGN.fullmatch(code):
            self._machine.does(self._assignment(int(match[1]), match[2], None))
        elif match := SHOWN.fullmatch(code):
            self._show(self._machine.same(match[1]))
        elif code.startswith(("M223", "M121")):
            self._print(code)
        else:
            self._move(code)

    def _show(self, seconds: float) -> None:
        """s of a text for the person → nothing. Raises InputError for one that holds the program up."""
        if not 0 < seconds <= LONGEST:
            raise InputError(
                f"shows its text for {seconds:g} s; allowed: up to {LONGEST:g} s, and not 0, which waits for cycle start"
            )

    def _print(self, code: str) -> None:
        """A line of the record file: opened, start mark, record, end mark."""
        if OPEN.fullmatch(code) and not self._opened:
            self._opened = True
        elif not self._opened:
            raise InputError("nothing is open that this could be written to")
        elif match := START.fullmatch(code):
            if not self._asked:
                raise InputError("begins without having asked whether the probe is deflected")
            if self._machine.same(f"#{self._seconds}") != 0:
                raise InputError(f"#{self._seconds} is not 0: what stops the program would be shown for a moment only")
            self._machine.start(match[1], float(match[2]), self._mark)
        elif match := END.fullmatch(code):
            self._machine.end(match[1], float(match[2]))
        elif match := RECORD.fullmatch(code):
            letters, values = [word[0] for word in match[1].split()], match[2].split()
            if len(values) != len(letters) + 2:
                raise InputError("the record has another number of values than of letters")
            self._machine.record(values[0], values[1], dict(zip(letters, values[2:], strict=True)))
        else:
            raise InputError("no line that a program of this kind may have here")

    def _move(self, code: str) -> None:
        """A line that moves something, or says how the next one counts."""
        machine = self._machine
        if code in ("G90", "G91"):
            self._relative = code == "G91"
        elif self._relative and (match := STEP.fullmatch(code)):
            machine.steps(match[1], float(match[2]), float(match[3]))
            self._moving = False
        elif self._relative:
            raise InputError("G91 is still on: G90 has to stand right behind the step")
        elif match := GUARDED.fullmatch(code):
            machine.guarded(self._target(match[1]), float(match[2]))
            self._moving = False
        elif match := MEASURE.fullmatch(code):
            target = self._target(match[1])
            machine.measures(target, float(match[2]))
            self._moving = False
        elif match := AWAY.fullmatch(code):
            machine.off(self._named(match[1]), float(match[2]), work=True)
            self._moving = True
        elif match := TURN.fullmatch(code):
            machine.turns(match[1], float(match[2]), True)
            self._moving = True
        elif self._orient and (match := re.fullmatch(re.escape(self._orient) + f"({NUMBER})", code)):
            machine.turns("S", float(match[1]), False)
        else:
            raise InputError("no line that a program of this kind may have here")

    @staticmethod
    def _named(words: str) -> dict[str, str]:
        """' /X[…] /Y[…]' → {X Y Z: expression}. Raises InputError for a letter that appears twice."""
        pairs = re.findall(rf"([XYZ])({COORDINATE})", words)
        if len(dict(pairs)) != len(pairs):
            raise InputError(f"found {words.strip()}; allowed: each letter once")
        return dict(pairs)

    def _target(self, words: str) -> dict[str, float]:
        """' /X[…] /Y[…]' → {X Y Z: machine mm}. Raises InputError for a letter that appears twice."""
        said = {name: self._machine.same(text) + self._machine.base.offset[name] for name, text in self._named(words).items()}
        return {name: self._machine.base.position[name] for name in "XYZ"} | said

    def _if(self, condition: str, then: str) -> None:
        """condition, what follows from it → a place where the program stops, or an assignment."""
        condition = f"[{condition}]"
        for symbol, word in SYMBOLS:
            condition = condition.replace(symbol, word)
        if match := GOTO.fullmatch(then):
            if int(match[1]) not in self._stops:
                raise InputError(f"GOTO {match[1]}: no place where this program stops")
            if not self._machine.begun and not self._asked:
                self._asked = True
                twin = self._machine.base.twin("stop", "the probe is deflected")
                twin.shared[PROBE_BIT] = 1.0
                self._machine.doubts([twin])

            def stops(twin: Twin) -> None:
                twin.stopped = bool(self._machine.value(twin, condition))

            self._machine.does(stops)
            return
        match = ASSIGN.fullmatch(then)
        assert match is not None
        self._machine.does(self._assignment(int(match[1]), match[2], condition))

    def _assignment(self, number: int, value: str, condition: str | None) -> Callable[[Twin], None]:
        """number of a variable, its value, condition (None: always) → what it does to a twin. Raises InputError."""
        if number not in OWN:
            raise InputError(f"found #{number} given a value; allowed: #29000 … #29999")

        def does(twin: Twin) -> None:
            if condition is None or self._machine.value(twin, condition):
                twin.shared[number] = self._machine.value(twin, value)

        return does

    def _read(self, twin: Twin, key: int | str) -> Value:
        """twin, number of a variable → its value. Raises InputError for one that nobody knows there."""
        assert isinstance(key, int)
        fixed = {INPUT: 15.0, PROBE_BIT: twin.shared.get(PROBE_BIT, 0.0), TRIPPED: float(twin.hit)}
        if key in fixed:
            return fixed[key]
        for base in (5020, 5040, 24300):
            if key - base in self._axis and base < key < base + 20:
                name = self._axis[key - base]
                if base == 24300:
                    return twin.shown(name, twin.skip[name]) if twin.hit else SPOILT  # what was met before
                if self._moving:
                    raise InputError(f"#{key} is read before anything has waited for the axes to stand ({WAIT})")
                return twin.shown(name, twin.position[name] - (twin.offset[name] if base == 5040 else 0.0))
        if key not in twin.shared:
            raise InputError(f"#{key} is read before it has a value")
        return twin.shared[key]
