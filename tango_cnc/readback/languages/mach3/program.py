"""Programs for Mach3: targets in variables, everything else in macros of Basic that travel with the program, which are read too.

Facts: G31 and G1 of a macro are queued by Code and done when IsMoving says so; GetVar(2000 …) is the place of the contact in work
coordinates, GetOEMDRO(83 …) machine and (800 …) work positions, GetOEMLED(825) the probe; the difference is the frame.
Mach3 skips an M code that has no macro, and after a stop it carries out lines that were read ahead: where a call is lost nothing
may move any more, and a stop has to be remembered in a variable that every macro asks first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ....records import InputError, Plan
from ...expressions import Value
from ...language import Companions, Language
from ...reading import MARK_IN_BRACKETS, REST, read_through, stated_words
from ...rehearsal import NUMBER, SPOILT, Rehearsal
from ...twins import Place, Twin, latched_elsewhere, offset_changed
from . import basic

COMPANIONS = re.compile(r"m88[0-7]\.m1s")
COMMENT = re.compile(r"\((?!.*TANGO (?:START|END) )(?:MSG,)?[A-Z0-9 .+-]*\)")
SET = re.compile(rf"#(\d+)=({NUMBER}|\d+)")
CALL = re.compile(r"M(88[0-7])(?: P(\d+))?")
MARKED = re.compile(r"M(880|886) \(TANGO (START|END) ([0-9A-F]{12}) (\d+)\)")
STATED = {*range(101, 115), 141, 142, 143, 152}  # what a program may give a value to …
KEPT = {*range(120, 137), 150, 151, 152}  # … and what a macro may
LETTERS, MACHINE, WORK, PROBE, CONTACT = "XYZABC", basic.DISPLAY + 83, basic.DISPLAY + 800, basic.LAMP + 825, 2000
START = 880
FOLDER, CALLS, DONE = 113, 114, 152  # number of the set of macros, calls with this one, calls carried out
LEFT = (-1000.0, 1.0, 1000.0)  # from what this program has counted, what an earlier one may have left
INCREMENT = 2e-4  # mm: an axis that is not to move is sent where it stands, in four decimals


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith("M880 (") or line in ("M881", "M882") for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options, companions))


LANGUAGE = Language(reads, rehearse, COMPANIONS)


def _macros(companions: Companions, off: str) -> dict[int, list[tuple[int, basic.Action]]]:
    """{file name: lines}, the word that switches the probe off → {M code: steps}.

    Raises InputError for a macro that would not refuse after a stop, or that leaves the probe on.
    """
    found: dict[int, list[tuple[int, basic.Action]]] = {}
    if not companions:
        raise InputError("its macros are missing, m880.m1s to m887.m1s")
    for name, lines in companions.items():
        try:
            found[int(name[1:4])] = basic.steps(lines)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    for code, steps in found.items():
        if left := [step for _, step in steps if isinstance(step, basic.Stop) and step.word != off]:
            raise InputError(f"m{code}.m1s: a stop says {left[0].word!r} before; allowed: probe_off of the profile, {off!r}")
    stops = {step.variable for steps in found.values() for _, step in steps if isinstance(step, basic.Stop)}
    if len(stops) != 1 or stops - KEPT or stops & STATED:
        said = ", ".join(f"#{number}" for number in sorted(stops)) or "nothing"
        raise InputError(f"macros: stops are remembered in {said}; allowed: one variable of theirs")
    (stopped,) = stops
    for code, steps in found.items():
        _refuses(code, [step for _, step in steps], stopped)
    return found


def _refuses(code: int, steps: list[basic.Action], stopped: int) -> None:
    """Raises InputError for a macro that does anything after a stop, or lets others do so."""
    if code != START and steps[:1] != [basic.Leave(f"[#{stopped} NE 0]")]:
        raise InputError(f"m{code}.m1s: does not leave first of all where #{stopped} is not 0: it would go on after a stop")
    counts = [i for i, step in enumerate(steps) if isinstance(step, basic.Given) and step.name == DONE]
    if counts != [len(steps) - 1] or steps[-1] != basic.Given(DONE, f"#{CALLS}"):
        raise InputError(
            f"m{code}.m1s: does not count itself in #{DONE} last of all: it would count where Basic has complained of it"
        )
    for i, step in enumerate(steps):
        if isinstance(step, basic.Leave) and (i or code == START):
            raise InputError(f"m{code}.m1s: leaves without a stop where {step.condition}")
        if isinstance(step, basic.Given) and step.name == stopped:
            later = steps[i + 1 :]
            if code != START or (step.value != "1" and not all(isinstance(other, basic.Given) for other in later)):
                raise InputError(f"m{code}.m1s: gives #{stopped} a value, which says that the program has stopped")


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
        self._macros = _macros(companions, str(options.get("probe_off", "")))
        self._machine = Rehearsal(plan, options, self._read, latches=True, astray=_astray, framed=True)
        for twin in self._machine.everywhere:
            twin.hit = False
        self._options, self._words = options, stated_words(options)
        self._orient, self._reset = options.get("orient", ""), options.get("reset", "")
        self._mark = ""
        self._said = ("", "", 0)  # the mark in the line that calls
        self._looked = ""  # which mark the macro has taken out of the program
        self._lost: Twin | None = None  # where the last call of a macro has done nothing
        self._moving = self._asked = self._relative = self.over = False

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not self.over:
            raise InputError("the program ends without M30")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        machine = self._machine
        if self.over:
            raise InputError("a line after the end of the program")
        if not (line.isascii() and line.isprintable()):
            raise InputError("found a character that cannot be printed or is not of ASCII")
        if match := MARK_IN_BRACKETS.fullmatch(line):
            self._mark = match[1]
        elif COMMENT.fullmatch(line) or line in self._words:
            machine.walk.switch(line)
        elif match := REST.fullmatch(line):
            machine.rests(float(match[1]))
        elif line == self._reset and not machine.begun:
            machine.reset(line)
        elif line == "M30" and machine.ended:
            self.over = True
        elif machine.ended:
            raise InputError("something happens outside of start mark and end mark")
        elif line.startswith("#"):
            self._set(line)
        elif match := MARKED.fullmatch(line):
            self._said = match[2], match[3], int(match[4])
            self._call(int(match[1]), 0)
        elif match := CALL.fullmatch(line):
            self._said = "", "", 0
            self._call(int(match[1]), int(match[2] or 0))
        elif self._orient and (match := re.fullmatch(re.escape(self._orient) + f"({NUMBER})", line)):
            machine.turns("S", float(match[1]), False)
        else:
            raise InputError("no line that a program of this kind may have here")

    def _set(self, line: str) -> None:
        for item in line.split():
            match = SET.fullmatch(item)
            if match is None or int(match[1]) not in STATED:
                raise InputError(f"found {item}; allowed: numbers for #101 … #114, #141 … #143, #152")
            statement = _given(int(match[1]), float(match[2]))
            self._machine.does(statement)
            if self._lost is not None:
                statement(self._lost)

    def _call(self, code: int, number: int) -> None:
        """A macro with its P, in all twins; beside them there is one where it is lost."""
        machine = self._machine
        if code not in self._macros:
            raise InputError(f"m{code}.m1s is not among the macros")
        if self._lost is not None:
            machine.doubts([self._lost])
        lost = machine.base.twin("stop", f"M{code} has been lost")
        self._strange()
        machine.does(_entered(float(number)))
        self._looked = ""
        self._moving = True  # what was read ahead
        for at, step in self._macros[code]:
            try:
                self._step(step)
            except InputError as error:
                raise InputError(f"m{code}.m1s line {at}: {error}") from None
        lost.shared = {**dict.fromkeys(KEPT, 0.0), **machine.base.shared, **lost.shared}  # left by this program, run before
        self._lost = lost

    def _strange(self) -> None:
        """Beside the machine there are ones whose macros are of another set, or where somebody starts at this call."""
        base, twins = self._machine.base, []
        for variable, what, others in (
            (FOLDER, "the macros are not those of this program", (-1.0, 1.0)),
            (DONE, "somebody has started in the middle of the program", LEFT),
        ):
            for other in others:
                twins.append(twin := base.twin("stop", what))
                twin.shared[variable] = (twin.shared.get(variable) or 0.0) + other
        self._machine.doubts(twins)

    def _step(self, step: basic.Action) -> None:
        machine = self._machine
        match step:
            case basic.Wait():
                self._moving = False
            case basic.Leave(condition) | basic.Stop(condition):
                if f"#{PROBE}" in condition and not machine.begun:
                    self._asks()
                machine.does(lambda twin: setattr(twin, "stopped", bool(machine.value(twin, condition))))
            case basic.Given():
                self._given(step)
            case basic.Step():
                by = {name: value for name, text in step.by.items() if (value := machine.same(text))}
                if len(by) != 1:
                    raise InputError(f"found a step along {' '.join(by) or 'nothing'}; allowed: one axis")
                machine.steps(*by.popitem(), machine.same(step.feed))
                self._relative = self._moving = True
            case basic.Absolute():
                self._relative = False
            case basic.Move() | basic.Turn() if self._relative:
                raise InputError("G91 is still on: G90 has to stand right behind the step")
            case basic.Move("G31"):
                machine.watched()
                target = {name: machine.same(text, INCREMENT) + machine.base.offset[name] for name, text in step.target.items()}
                does = machine.measures if machine.walk.measures else machine.guarded
                does(target, machine.same(step.feed))
                self._moving = True
            case basic.Move():
                machine.off(step.target, machine.same(step.feed), work=True)
                machine.does(_released)
                self._moving = True
            case basic.Turn():
                letter = machine.same(step.letter)
                if letter not in [float(ord(name)) for name in "ABC"]:
                    raise InputError("turns no axis; allowed: A B C")
                machine.turns(chr(int(letter)), machine.same(step.angle), True)
                self._moving = True
            case basic.Look():
                self._looked = step.word
                machine.does(_named("mark", 1.0))
            case basic.Say():
                self._file(step.file)
                self._marked()
            case basic.Record():
                self._file(step.file)
                machine.record(step.number, step.flag, step.places)

    def _asks(self) -> None:
        """The probe is asked: beside the machine there is one on which it is deflected."""
        self._asked = True
        twin = self._machine.base.twin("stop", "the probe is deflected")
        twin.hit = True
        self._machine.doubts([twin])

    def _given(self, step: basic.Given) -> None:
        machine = self._machine
        if isinstance(step.name, int) and step.name not in KEPT:
            raise InputError(f"found #{step.name} given a value; allowed: #120 … #136, #150 … #152")

        def does(twin: Twin) -> None:
            if not step.condition or machine.value(twin, step.condition):
                store: dict[int | str, Value] = twin.shared if isinstance(step.name, int) else twin.local[-1]
                store[step.name] = machine.value(twin, step.value)

        machine.does(does)

    def _file(self, name: str) -> None:
        if name != self._options.get("readings"):
            raise InputError(f"found the file {name}; allowed: that of the profile")

    def _marked(self) -> None:
        word, mark, count = self._said
        if self._looked != word:
            raise InputError(f"the mark {self._looked or 'of nothing'} is written; this line has {word or 'none'}")
        if word == "START":
            if not self._asked:
                raise InputError("begins without having asked whether the probe is deflected")
            self._machine.watched()
            self._machine.start(mark, count, self._mark)
        else:
            self._machine.end(mark, count)

    def _read(self, twin: Twin, key: int | str) -> Value:
        if isinstance(key, str):
            if key not in twin.local[-1]:
                raise InputError(f"{key} is read before it has a value")
            return twin.local[-1][key]
        if key == PROBE or CONTACT <= key < CONTACT + 6 or key >= basic.DISPLAY:
            if self._moving:
                raise InputError("a position or the probe is read before anything has waited for the axes to stand (IsMoving)")
            return self._shown(twin, key)
        if key not in twin.shared:
            raise InputError(f"#{key} is read before it has a value")
        return twin.shared[key]

    @staticmethod
    def _shown(twin: Twin, key: int) -> float:
        if key == PROBE:
            return float(twin.hit)
        for base, places, frame in ((CONTACT, twin.skip, True), (MACHINE, twin.position, False), (WORK, twin.position, True)):
            if base <= key < base + len(LETTERS):
                name = LETTERS[key - base]
                return twin.shown(name, places[name] - frame * twin.offset[name]) if name in places else SPOILT
        raise InputError(f"display or lamp {key % basic.DISPLAY} of the control is read, which nobody knows here")


def _astray(base: Twin, start: Place, target: Place) -> Iterator[Twin]:
    yield from offset_changed(base, start, target)
    yield from latched_elsewhere(base, start, target)


def _given(number: int, value: float) -> Callable[[Twin], None]:
    return lambda twin: twin.shared.__setitem__(number, value)


def _named(name: str, value: float) -> Callable[[Twin], None]:
    return lambda twin: twin.local[-1].__setitem__(name, value)


def _entered(number: float) -> Callable[[Twin], None]:
    """P of a call → the statement that begins it: no name has a value yet."""

    def does(twin: Twin) -> None:
        twin.local[:] = [{"param1": number}]

    return does


def _released(twin: Twin) -> None:
    twin.hit = False
