"""Programs for Fagor 8060, 8065, 8070: G100 says nothing of what it met, so the text itself has to look and to stop.

Facts: $IF … $ENDIF stand alone; #ERROR stops, and M30 behind it ends the program whatever #ERROR does; P0 … P25 are the program's
own. #WRITE takes five identifiers, so that a touch has three lines, one a flag, of which one is written. Which variables hold the
position of an axis, by machine and by programmed coordinates, that of the contact, and whether there was one, the profile says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any

from ...records import InputError, Plan
from ..expressions import Value
from ..language import Companions, Language
from ..reading import MARK_BEHIND_SEMICOLON, REST, read_through, stated_words
from ..rehearsal import NUMBER, Rehearsal, Statement
from ..twins import Place, Twin, latched_elsewhere, offset_changed

FEED = re.compile(rf"G100((?: [XYZ]\[{NUMBER}-P[123]\])+) F({NUMBER})")
STEP = re.compile(rf"G100 ([XYZ])({NUMBER}) F({NUMBER})")
OFF = re.compile(rf"G1((?: [XYZ]\[\S+-P[123]\])+) F({NUMBER})")
TURN = re.compile(rf"#MCS G0 ([ABC])({NUMBER})")
ASSIGN = re.compile(r"(P\d{1,2})=(?!=)(.+)")
IF = re.compile(r"\$IF (.+)")
ERROR = re.compile(r'#ERROR \["[A-Z0-9 .]+"\]')
SHOWN = re.compile(r'#MSG \["[A-Z0-9 .-]+"\]')
OPEN = re.compile(r'#OPEN \["[A-Z]:[^"]+","A"\]')
TEXT = re.compile(r'#WRITE \["P(\d+) H([012])((?: [A-Z]%(?:\.4F|[A-Z]))+) S(\d+\.\d*)",([^"]+)\]')
FLAGS = 3  # lines of a touch, of which it writes one
IDENTIFIERS = 5  # of a #WRITE
START = re.compile(r'#WRITE \["TANGO START ([0-9A-F]{12}) (\d+)"\]')
END = re.compile(r'#WRITE \["TANGO END ([0-9A-F]{12}) (\d+)"\]')
SPELT = [("!=", " NE "), (">=", " GE "), ("<=", " LE "), ("==", " EQ "), (">", " GT "), ("<", " LT ")]
FRAME = {"X": "P1", "Y": "P2", "Z": "P3"}
LOCAL = range(26)
SAME_AS = {"G71": "G21"}  # what is millimetres here
TOLD = "A_TOLD"  # the flag that a twin has written
STALE = 66666.0  # in the contact variable after a move that met nothing: a real one may keep what it held before


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(line.startswith(("#OPEN [", "#WRITE [", "G100 ", "$IF V.")) for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options))


LANGUAGE = Language(reads, rehearse)


def _astray(base: Twin, start: Place, target: Place) -> Iterable[Twin]:
    yield from offset_changed(base, start, target)
    yield from latched_elsewhere(base, start, target)


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any]) -> None:
        self._spelt = lru_cache(maxsize=4096)(self._expressed)
        self._machine = Rehearsal(plan, options, self._read, latches=bool(options.get("met")), astray=_astray, framed=True)
        self._words = stated_words(options)
        self._off = {f"#{word} OFF" for word in options.get("off", "").split()}
        self._words |= {f"#SELECT PROBE [{options.get('probe_input')}]"}
        self._said: set[str] = set()
        self._options, self._state = options, options.get("probe_state", "")
        self._within = ""  # what stands in the $IF that is open: "if", "error", "end"
        self._asked = self._untooled = self._relative = False
        self._begun = self._opened = self._closed = self.over = False
        self._mark = ""
        self._due = {"#CLOSE", options.get("probe_off", "")} - {""}  # what every way out does first …
        self._left: set[str] = set()  # … and this one has done
        self._told: list[tuple[str, ...]] = []  # lines of this touch so far: what each says but for its flag

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended and self._closed):
            raise InputError("the program ends without end mark, #CLOSE or M30")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        if line.startswith(";"):
            self._mark = match[1] if (match := MARK_BEHIND_SEMICOLON.fullmatch(line)) else self._mark
        elif self.over:
            raise InputError("something follows the end of the program")
        elif not self._begun:
            if not re.fullmatch(r"%[A-Z0-9_]{1,14}", line):
                raise InputError("the program has no header %… before its first block")
            self._begun = True
        elif self._within:
            self._in_if(line)
        elif self._told and not IF.fullmatch(line):
            raise InputError(f"a touch has {FLAGS} lines, one a flag; {len(self._told)} of them are here")
        elif match := IF.fullmatch(line):
            self._if(match[1])
        elif match := ASSIGN.fullmatch(line):
            self._machine.does(self._assignment(match[1], match[2]))
        elif match := REST.fullmatch(line):
            self._machine.rests(float(match[1]))
        elif line == "M30":
            self._machine.watched()
            self.over = True
        elif not SHOWN.fullmatch(line):
            self._block(line)

    def _block(self, line: str) -> None:
        orient = self._options.get("orient", "")
        if line in self._words:
            self._machine.walk.switch(line)
            return
        if line in self._off:
            self._said.add(line)
        elif line == "D0":
            self._untooled = True
        elif line == self._options.get("reset"):
            words = (SAME_AS.get(word, word) for word in line.split() if word != "G53")
            self._machine.reset(" ".join(words))
        elif orient and (match := re.fullmatch(re.escape(orient) + f"({NUMBER})", line)):
            self._machine.turns("S", float(match[1]), False)
        elif match := TURN.fullmatch(line):
            self._tool()
            self._machine.turns(match[1], float(match[2]), True)
            self._asked = False
        elif line in ("G90", "G91"):
            self._relative = line == "G91"
        elif self._relative and (match := STEP.fullmatch(line)):
            self._asks()
            self._machine.steps(match[1], float(match[2]), float(match[3]))
        elif match := FEED.fullmatch(line):
            self._feed(match[1].split(), float(match[2]))
        elif match := OFF.fullmatch(line):
            self._free(match[1].split(), float(match[2]))
        else:
            self._print(line)

    def _tool(self) -> None:
        if missing := sorted(self._off - self._said):
            raise InputError(f"something moves before {', '.join(missing)}")
        if not self._untooled:
            raise InputError("something moves before D0 has taken the tool offset away")
        self._machine.reset("G49")

    def _targets(self, words: list[str]) -> dict[str, str]:
        """words of axes → {X Y Z: expression of its work coordinate}. Raises InputError for another frame than the axis' own."""
        self._tool()
        if self._relative:
            raise InputError("G91 is still on: G90 has to stand right behind the step")
        if len({item[0] for item in words}) < len(words):
            raise InputError(f"found {' '.join(words)}; allowed: every axis once")
        for item in words:
            if (frame := item[2:-1].rsplit("-", 1)[1]) != FRAME[item[0]]:
                raise InputError(f"found {item}; allowed: {FRAME[item[0]]} taken off instead of {frame}, the frame of {item[0]}")
        return {item[0]: self._spelt(item[2:-1]) for item in words}

    def _free(self, words: list[str], feed: float) -> None:
        self._machine.off(self._targets(words), feed, work=True)
        self._asked = False

    def _feed(self, words: list[str], feed: float) -> None:
        machine = self._machine
        said = {name: machine.same(text) + machine.base.offset[name] for name, text in self._targets(words).items()}
        target = {name: machine.base.position[name] for name in "XYZ"} | said
        self._asks()
        if machine.walk.measures:
            machine.measures(target, feed)
        else:
            machine.guarded(target, feed)

    def _asks(self) -> None:
        """Before a move with G100. Raises InputError where the probe has not been asked, or a tool offset may be on."""
        self._tool()
        if self._state and not self._asked:
            raise InputError("moves without having asked whether the probe is deflected")
        self._asked = False

    def _if(self, condition: str) -> None:
        self._within, self._left = "if", set()
        if self._state and self._state in condition:
            self._asked = True
            twin = self._machine.base.twin("stop", "the probe is deflected")
            twin.shared["A_PROBE"] = 1.0
            self._machine.doubts([twin])
        spelt = self._spelt(condition)

        def does(twin: Twin) -> None:
            twin.branch = bool(self._machine.value(twin, spelt))

        self._machine.does(does)

    def _in_if(self, line: str) -> None:
        if line == "$ENDIF" and self._within != "error":
            self._within = ""
            self._machine.does(_every_branch)
            self._records()
        elif self._within == "if" and line in self._due:
            self._left.add(line)
        elif self._within == "if" and ERROR.fullmatch(line):
            if missing := sorted(self._due - self._left):
                raise InputError(f"stops without {' and '.join(missing)}")
            self._within = "error"
        elif self._within == "error" and line == "M30":
            self._within = "end"
            self._machine.does(_stop)
        elif self._within == "if" and (match := TEXT.fullmatch(line)):
            self._within = "told"
            self._tells(match)
        elif self._within == "if" and (match := ASSIGN.fullmatch(line)):
            self._machine.does(self._assignment(match[1], match[2]))
        else:
            raise InputError("no line that an $IF may have: parameters, or #ERROR and M30")

    def _assignment(self, name: str, text: str) -> Statement:
        if int(name[1:]) not in LOCAL:
            raise InputError(f"found {name} given a value; allowed: P{LOCAL[0]} … P{LOCAL[-1]}")
        spelt = self._spelt(text)

        def does(twin: Twin) -> None:
            if twin.branch:
                twin.shared[name] = self._machine.value(twin, spelt)

        return does

    def _print(self, line: str) -> None:
        if OPEN.fullmatch(line) and not self._opened:
            self._opened = True
            return
        if not self._opened or self._closed:
            raise InputError("no line that a program of this kind may have here")
        if line == "#CLOSE":
            self._closed = True
        elif match := START.fullmatch(line):
            self._machine.start(match[1], float(match[2]), self._mark)
        elif match := END.fullmatch(line):
            self._machine.end(match[1], float(match[2]))
        else:
            raise InputError("no line that a program of this kind may have here")

    def _tells(self, match: re.Match[str]) -> None:
        """One of the lines of a touch: a twin in whose branch it stands writes its flag."""
        if not self._opened or self._closed:
            raise InputError("no line that a program of this kind may have here")
        flag, first, said = float(match[2]), not self._told, (match[1], match[3], match[4], match[5])
        if not first and said != self._told[0]:
            raise InputError("the lines of a touch differ in more than their flag")
        self._told.append(said)

        def does(twin: Twin) -> None:
            if first:
                twin.shared.pop(TOLD, None)
            if twin.branch and TOLD in twin.shared:
                raise InputError(f"two lines are written of one touch where {twin.what}")
            if twin.branch:
                twin.shared[TOLD] = flag

        self._machine.does(does)

    def _records(self) -> None:
        """All lines of a touch have been read: each twin has written one of them."""
        if len(self._told) < FLAGS:
            return
        number, words, spindle, given = self._told[0]
        self._told = []
        letters, values = re.findall(r" ([A-Z])%", words), given.split(",")
        if len(values) != len(letters) or len(set(re.findall(r"%(\.4F|[A-Z])", words))) != 1:
            raise InputError(f"{len(values)} values for {len(letters)} places, which all have to be of one kind")
        if len(values) > IDENTIFIERS:
            raise InputError(f"found {len(values)} identifiers; allowed: {IDENTIFIERS} in a #WRITE")
        places = dict(zip(letters, map(self._spelt, values), strict=True)) | {"S": spindle}
        self._machine.record(number, f"#<{TOLD}>", places | {"K": "+".join(f"[{text}]" for text in places.values())})

    def _expressed(self, text: str) -> str:
        """expression as this control spells it → as the reader of expressions does."""
        if self._state:
            text = text.replace(self._state, "#<A_PROBE>")
        for axis in self._machine.plan.machine.axes:
            for kind in ("machine_position", "programmed_position", "contact", "met"):
                if word := self._options.get(kind):
                    text = re.sub(rf"{re.escape(word)}\.{axis.name}\b", f"#<AT_{kind[:4]}_{axis.name}>", text)
        text = re.sub(r"(?<![<_A-Z])P\d+\b", lambda match: f"#<{match[0]}>", text)
        held = re.split(r"(#<\w+>)", text)
        for i in range(0, len(held), 2):
            for theirs, ours in SPELT:
                held[i] = held[i].replace(theirs, ours)
        return "".join(held)

    def _read(self, twin: Twin, key: int | str) -> Value:
        name = str(key)
        if name == "A_PROBE":
            return twin.shared.get(name, 0.0)
        if name.startswith("AT_"):
            _, kind, axis = name.split("_")
            if kind == "met":
                return float(twin.hit)
            if kind == "cont":
                programmed = self._options.get("contact_frame") == "programmed"
                return twin.shown(axis, twin.skip[axis] - (twin.offset[axis] if programmed else 0.0)) if twin.hit else STALE
            return twin.shown(axis, twin.position[axis] - (twin.offset[axis] if kind == "prog" else 0.0))
        if name not in twin.shared:
            raise InputError(f"{name} is read before it has a value")
        return twin.shared[name]


def _stop(twin: Twin) -> None:
    twin.stopped |= twin.branch


def _every_branch(twin: Twin) -> None:
    twin.branch = True
