"""Programs for LinuxCNC: the control itself aborts a move that is no probing move when the probe trips, not when it is on before.

Facts (g-code.adoc, o-code.adoc): #<_abs_x> machine and #<_x> work position; #5061 … #5066 the probed position of X Y Z A B C in
the work frame, #5070 whether there was contact; G38.3 goes on when there was none; G53 works with G0 and G1 only;
#1 … #30 are local to a subroutine, names that begin with _ are not; the last active comment of a line is carried out;
#<_hal[…]> is a pin of HAL as it is when the line is read, which may be long before it is its turn, but not behind M66.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ...records import InputError, Plan
from ..expressions import Value
from ..language import Companions, Language
from ..reading import MARK_IN_BRACKETS, REST, read_through, stated_words
from ..rehearsal import NUMBER, Rehearsal, Twin
from ..walk import PROTECTED

PLACES = dict(enumerate("XYZABC", 5061))
LOCAL = range(1, 31)
WORK = {f"_{axis.lower()}": axis for axis in "XYZABC"}  # where the machine stands, in work and in machine coordinates
MACHINE = {f"_abs_{axis.lower()}": axis for axis in "XYZABC"}
COMMENT = re.compile(r"\([A-Z0-9 .+-]*\)")
MOVE = re.compile(rf"G53 G1((?: [XYZ]{NUMBER})+) F({NUMBER})")
TURN = re.compile(rf"G53 G0 ([ABC])({NUMBER})")
ORIENT = re.compile(rf"M19 R({NUMBER}) Q\d+")
PROBE = re.compile(r"G38\.3 X(\[[^\]]+\]) Y(\[[^\]]+\]) Z(\[[^\]]+\]) F(#\d+)")
SUB = re.compile(r"O<([a-z_]+)> (SUB|ENDSUB)")
CALL = re.compile(rf"O<([a-z_]+)> CALL((?: \[(?:{NUMBER}|\d+|#<_abs_[xyz]>)\])+)")
ASSIGN = re.compile(r"#<(_tango_[a-z_]+)> = (.+)")
IF = re.compile(r"O(\d+) IF (\[.+\])")
ABORT = re.compile(r"\(ABORT,[A-Z0-9 .]+\)")
SHOWN = re.compile(r"\(MSG,[A-Z0-9 .-]+\)")
OPEN = re.compile(r"\(LOGOPEN,[A-Za-z0-9._/-]+\)")
START = re.compile(r"\(LOG,TANGO START ([0-9A-F]{12}) (\d+)\)")
END = re.compile(r"\(LOG,TANGO END ([0-9A-F]{12}) (\d+)\)")
RECORD = re.compile(r"\(LOG,P%d(#\d+) H(#<\w+>) ([A-Z])%\.[4-9]f(#<\w+>)((?: [A-Z](?:#<\w+>|#\d+))+)\)")
STILL = 1e-4  # mm
SYNCHRONOUS = "M66 E0 L0"  # the lines behind it are read when everything before it has been done
PIN = "#<_hal[motion.probe-input]>"


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith(("O<", "(LOGOPEN,")) for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options))


LANGUAGE = Language(reads, rehearse)


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any]) -> None:
        self._machine = Rehearsal(plan, options, self._read)
        self._words = stated_words(options)
        self._switches_off = options.get("probe_off") or "(LOGCLOSE)"
        self._done: list[str] = []  # what a way out has done: the probe is off, the log is closed
        self._subs: dict[str, list[str]] = {}
        self._writing: str | None = None  # the subroutine whose text is read
        self._label: str | None = None  # the IF that is open
        self._mark = ""
        self._depth = 0
        self._opened = self._closed = self.over = False
        self._asked = False  # whether the program has come to where it can look at the probe
        self._rotated = False  # whether there is a twin beside this one whose work frame is rotated

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended and self._closed) or self._label:
            raise InputError("the program ends without end mark, LOGCLOSE or M2")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if self.over:
            raise InputError("a line after the end of the program")
        if match := SUB.fullmatch(line):
            self._sub(match[1], match[2])
        elif self._writing is not None:
            self._subs[self._writing].append(line)
        elif match := MARK_IN_BRACKETS.fullmatch(line):
            self._mark = match[1]
        elif match := REST.fullmatch(line):
            self._machine.rests(float(match[1]))
        elif SHOWN.fullmatch(line):
            pass
        elif self._label is not None and line in (self._switches_off, SYNCHRONOUS, "(LOGCLOSE)"):
            self._done.append(line)
        elif (COMMENT.fullmatch(line) and line != "(LOGCLOSE)") or (self._opened and line in self._words):
            self._machine.walk.switch(line)
        elif match := ASSIGN.fullmatch(line):
            self._assign(match[1], match[2])
        elif match := IF.fullmatch(line):
            self._if(match[1], match[2])
        elif self._label is not None:
            self._within(line)
        elif line.startswith("("):
            self._print(line)
        elif line == SYNCHRONOUS and self._opened:
            self._look()
        elif line == "M2":
            self._machine.watched()
            self.over = True
        else:
            self._move(line)

    def _look(self) -> None:
        if self._asked or not self._machine.begun:
            raise InputError("the probe is looked at once, after the start mark")
        self._asked = True
        deflected = self._machine.base.twin("stop", "the probe is deflected")
        deflected.shared[PIN] = 1.0
        self._machine.doubts([deflected])

    def _move(self, line: str) -> None:
        machine = self._machine
        if machine.begun and not self._asked:
            raise InputError("moves without having asked whether the probe is deflected")
        if match := MOVE.fullmatch(line):
            words = {word[0]: float(word[1:]) for word in match[1].split()}
            if len(words) < len(match[1].split()):
                raise InputError(f"found {match[1].strip()}; allowed: every axis once")
            target = {name: machine.base.position[name] for name in "XYZ"} | words
            stays = all(abs(target[name] - machine.base.position[name]) < STILL for name in words)
            machine.moves(target, PROTECTED if stays else ("clear", "approach", "off", "back"), float(match[2]))
        elif match := TURN.fullmatch(line):
            machine.turns(match[1], self._place(match[1], float(match[2])), False)
        elif match := ORIENT.fullmatch(line):
            machine.turns("S", float(match[1]), False)
        elif match := PROBE.fullmatch(line):
            target = {n: machine.same(text) + machine.base.offset[n] for n, text in zip("XYZ", match.groups()[:3], strict=True)}
            (machine.measures if machine.walk.measures else machine.guarded)(target, machine.same(match[4]))
        elif match := CALL.fullmatch(line):
            self._call(match[1], [machine.same(text) for text in match[2].split()])
        elif re.fullmatch(r"G[\d.]+(?: G[\d.]+)*(?: M5)?", line):
            if "G61" not in line.split():
                raise InputError("G61 is missing: the control would round the corners between moves")
            machine.reset(line)
        else:
            raise InputError("no line that a program of this kind may have here")

    def _place(self, name: str, value: float) -> float:
        """Axis letter, deg as written → deg meant: with WRAPPED_ROTARY the sign is the sense of the turn, not part of the angle."""
        travel = self._machine.plan.machine.axis(name).travel
        turns = travel is None or (travel[0] <= 1e-9 and travel[1] >= math.tau - 1e-9)
        return abs(value) if self._machine.options.get("wrapped") and turns else value

    def _print(self, line: str) -> None:
        if OPEN.fullmatch(line) and not self._opened:
            self._opened = True
        elif line == "(LOGCLOSE)" and self._opened:
            self._closed = True
        elif not self._opened or self._closed:
            raise InputError("nothing is open that this could be written to")
        elif match := START.fullmatch(line):
            self._machine.start(match[1], float(match[2]), self._mark)
        elif match := END.fullmatch(line):
            self._machine.end(match[1], float(match[2]))
        elif match := RECORD.fullmatch(line):
            rest = {item[0]: item[1:] for item in match[5].split()}
            self._machine.record(match[1], match[2], {match[3]: match[4], **rest})
        else:
            raise InputError("no line that a program of this kind may have here")

    def _sub(self, name: str, word: str) -> None:
        if word == "SUB" and self._writing is None and name not in self._subs and not self._machine.begun:
            self._writing, self._subs[name] = name, []
        elif word == "ENDSUB" and self._writing == name:
            self._writing = None
        else:
            raise InputError("subroutines are stated once, one after the other, before anything moves")

    def _call(self, name: str, values: list[float]) -> None:
        if name not in self._subs or self._depth:
            raise InputError(f"found a call of {name}, which is not in this program")
        self._depth += 1
        for twin in self._machine.twins:
            twin.local.append(dict(enumerate(values, 1)))
        for line in self._subs[name]:
            try:
                self.line(line)
            except InputError as error:
                raise InputError(f"in {name}, {line!r}: {error}") from None
        if self._label is not None:
            raise InputError(f"O{self._label} has no ENDIF")
        for twin in self._machine.twins:
            twin.local.pop()
        self._depth -= 1

    def _assign(self, name: str, text: str) -> None:
        def does(twin: Twin) -> None:
            if twin.branch:
                twin.shared[name] = self._pin(twin, name) if text == PIN else self._machine.value(twin, text)

        self._machine.does(does)

    def _if(self, label: str, condition: str) -> None:
        if self._label is not None:
            raise InputError(f"O{label} within O{self._label}")
        self._label, self._done = label, []
        if not self._rotated and not self._machine.begun:
            self._rotated = True
            rotated = self._machine.base.twin("stop", "the work frame is rotated")
            rotated.shared[5230] = 10.0
            self._machine.doubts([rotated])

        def does(twin: Twin) -> None:
            twin.branch = condition == f"[EXISTS[{PIN}]]" or bool(self._machine.value(twin, condition))

        self._machine.does(does)

    def _pin(self, twin: Twin, name: str) -> float:
        if not self._asked:
            raise InputError(f"{PIN} is read before {SYNCHRONOUS}, when it need not be as it is now")
        if name not in twin.shared:
            raise InputError(f"#<{name}> has no value where pins cannot be read")
        return float(twin.shared.get(PIN) or 0.0)

    def _within(self, line: str) -> None:
        """A line of an IF that is no assignment."""
        if line == f"O{self._label} ELSE":
            self._machine.does(_other_branch)
        elif line == f"O{self._label} ENDIF":
            self._machine.does(_every_branch)
            self._label = None
        elif ABORT.fullmatch(line):
            off = self._switches_off
            if self._done != ([off, SYNCHRONOUS] if off != "(LOGCLOSE)" else []) + ["(LOGCLOSE)"]:
                raise InputError(f"a way out without {off}, {SYNCHRONOUS} and (LOGCLOSE): it leaves the probe on or the log open")
            self._done = []
            self._machine.does(_stop)
        else:
            raise InputError("no line that an IF may have")

    def _read(self, twin: Twin, key: int | str) -> Value:
        if isinstance(key, str):
            if key == "_task":
                return 1.0
            axis = WORK.get(key) or MACHINE.get(key)
            if axis is not None and axis in twin.position:
                return twin.position[axis] - (twin.offset[axis] if key in WORK else 0.0)
            if key not in twin.shared:
                raise InputError(f"#<{key}> is read before it has a value")
            return twin.shared[key]
        if key in LOCAL:
            return twin.local[-1].get(key)
        if key in PLACES and PLACES[key] in twin.skip:
            return twin.skip[PLACES[key]] - twin.offset[PLACES[key]]
        return {5070: float(twin.hit), 5220: 1.0, 5230: twin.shared.get(5230, 0.0)}.get(key)


def _other_branch(twin: Twin) -> None:
    twin.branch = not twin.branch


def _every_branch(twin: Twin) -> None:
    twin.branch = True


def _stop(twin: Twin) -> None:
    twin.stopped = twin.branch
