"""Programs for Siemens 840D: MEAS stops a move at a contact and says nothing, so the text itself has to look and to stop.

Facts: SUPA and D0 make targets machine positions; $AA_IM is where an axis stands, read behind STOPRE only, of a rotary one where
it was sent ($VA_IM: where it stands); $AA_MM where the probe was met, $AC_MEA[1] whether it was; DC(…) turns the short way, AC(…)
to the position as it stands; $P_ACTFRAME[X,TR] what is left of frames (shift, fine shift, turn, scale, mirror image).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any

from ...records import InputError, Plan
from ..expressions import Value
from ..handed import Handed
from ..language import Companions, Language
from ..reading import MARK_BEHIND_SEMICOLON, REST, read_through, stated_words
from ..rehearsal import NUMBER, SPOILT, Rehearsal, Statement, Twin, numbered

FEED = re.compile(rf"SUPA D0 G1 MEAS=[12]((?: [XYZ]{NUMBER})+) F({NUMBER})")
STEP = re.compile(rf"SUPA D0 G1 MEAS=[12] ([XYZ])=TG_WAY([+-]\d+\.\d*) F({NUMBER})")
OFF = re.compile(rf"SUPA D0 G1((?: [XYZ](?:{NUMBER}|=\S+))+) F({NUMBER})")
INPUT = re.compile(r"(?:MEAS=|\$A_PROBE\[|\$AC_MEA\[)(\d+)")
TURN = re.compile(rf"SUPA D0 G0 ([ABC])=(?:AC|DC)\(({NUMBER})\)")
ORIENT = re.compile(rf"SPOS=({NUMBER})")
ASSIGN = re.compile(r"(TG_[A-Z]+)=([^\"]+)")
JUMP = re.compile(r"IF (.+) GOTOF (TG_STOP_\d+)")
IF = re.compile(r"IF (.+)")
DEFINE = re.compile(r"DEF (INT|REAL|STRING\[200\]) TG_[A-Z]+(,TG_[A-Z]+)*")
WRITE = re.compile(r'WRITE\(TG_ERROR,"[^"]+",(.+)<<"\'H0A\'"\)')
FILE = re.compile(r'WRITE\(TG_ERROR,"_N_[A-Z0-9_]+",([^<]+)\)')  # a file of the control is open all the time
OPEN = re.compile(r'EXTOPEN\(TG_ERROR,"[^"]+","SYN","EXCL"\)')
CLOSE = re.compile(r'EXTCLOSE\(TG_CLOSED,"[^"]+"\)')
TEXT = re.compile(r'TG_TEXT=SPRINT\("P(\d+) H%D((?: [A-Z]%\.4F)+) S(-?\d+\.\d*) K%\.4F",(.+)\)')
SETTLES = re.compile(r"G4 F0\.\d")  # s, too short for a hand
START = re.compile(r'"TANGO START ([0-9A-F]{12}) (\d+)"')
END = re.compile(r'"TANGO END ([0-9A-F]{12}) (\d+)"')
SHOWN = re.compile(r'MSG\((?:"[A-Z0-9 .-]+")?\)')
STOPS = re.compile(r'MSG\("[A-Z0-9 .]+"(?:<<" ERROR "<<TG_ERROR)?\)|SETAL\(\d+\)|M0|STOPRE')
SPELT = [("<>", " NE "), (">=", " GE "), ("<=", " LE "), ("==", " EQ "), (">", " GT "), ("<", " LT ")]
SPELT += [("(", "["), (")", "]"), ("TRUNC", "FIX")]
SYSTEM = re.compile(r"\$([AV][ACX]?_[A-Z]+|P_ACTFRAME)\[([A-Z1-9])(?:,([A-Z]{2}))?\]")
OWN = re.compile(r"\$(VA_IM|AA_MM)\[([A-Z][A-Z0-9_]*)\]")  # with the name of a machine axis
ASKED = {  # what the control says of itself → name here, its value where all is well, and what is wrong where it is another
    "$MN_SCALING_SYSTEM_IS_METRIC": ("METRIC", 1.0, "the control's own units are inches"),
    "$P_TRAFO": ("TRAFO", 0.0, "a transformation is on"),
}
PARTS = re.compile(r"\$(?:P_ACTFRAME|AC_DRF)\[([A-Z])(?:,([A-Z]{2}))?\]")
FRAME = {"TR": 0.0, "FI": 0.0, "RT": 0.0, "SC": 1.0, "MI": 0.0}  # component of a frame → its value where no frame is on
END_POINT = "65535"
SAME_AS = {
    "G60": "G61",
    "G601": "G61",
    "G71": "G21",
    "G710": "G21",
}  # what is millimetres here; G710 for feeds and system variables too
MADE_SURE = ("G49", "G80")  # D0 stands in every move; the control has no modal drilling but what G0 and G1 end


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any("TG_ERROR" in line for line in head)


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    read_through(lines, lambda: _Program(plan, options, _stops(lines(), options.get("probe_off", ""))), tail=True)


LANGUAGE = Language(reads, rehearse)


def _stops(lines: Iterable[str], off: str) -> set[str]:
    """lines, words that switch the probe off → labels behind the end that leave no probe on and never go on."""
    found: set[str] = set()
    label, held, behind = "", False, False
    owed: set[str] = {off} - {""}  # what a way out has to do: switch the probe off, close the device
    due: set[str] = set()
    for _, line in numbered(lines):
        owed |= {"EXTCLOSE"} if OPEN.fullmatch(line) else set()
        if behind and line.endswith(":"):
            label, held, due = line[:-1], False, set(owed)
        elif behind and label and not held and (done := "EXTCLOSE" if CLOSE.fullmatch(line) else line) in due:
            due.remove(done)
        elif behind and label:
            if line == "M30" and held and not due:
                found.add(label)
            held = line == "M0" or (held and bool(STOPS.fullmatch(line)))
            label = label if STOPS.fullmatch(line) else ""
        behind = behind or line == "M30"
    return found


class _Program:
    """Line by line."""

    def __init__(self, plan: Plan, options: Mapping[str, Any], stops: set[str]) -> None:
        self._machine = Rehearsal(plan, options, self._read, latches=True, framed=True)
        parts = [f"{axis} {part}" for axis in "XYZ" for part in (*FRAME, "DRF")]
        parts += [f"{axis} {part}" for axis in plan.machine.rotary for part in ("TR", "FI")]
        self._unasked = {"METRIC": "metric_check", "TRAFO": "frame_check", **dict.fromkeys(parts, "frame_check")}
        given = options.get("machine_axes") or {}
        self._own = {
            str(given.get(axis.name, axis.name)): axis.name for axis in plan.machine.axes
        }  # name of a machine axis → letter
        self._words = stated_words(options) | {"D0"}
        self._words |= {"TRAFOOF", "CYCLE800()", "G500", "TRANS"}
        self._head = {word for option, word in (("trafoof", "TRAFOOF"), ("cycle800", "CYCLE800()")) if options.get(option)}
        self._head |= {"G500", "TRANS"}  # nothing but SUPA would keep the first move from going down by the work offset
        self._input = str(options.get("probe_input", 1))
        self._stops, self._options = stops, options
        self._text: tuple[str, str, dict[str, str]] | None = None  # of the record that is next
        self._shown: list[str] = []  # what its text shows, as expressions
        self._moving, self._asked, self._within, self._settled = True, False, False, True
        self._opened = self._closed = self.over = False
        self._mark = ""
        name = str(options.get("handshake", "none"))
        self._handed = None if name == "none" else Handed(name)

    def finish(self) -> None:
        """Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended and self._closed == self._opened):
            raise InputError("the program ends without end mark, EXTCLOSE or M30")

    def line(self, line: str) -> None:
        """One line of the file. Raises InputError when it must not reach a machine."""
        line = self._lettered(line)
        if (asked := INPUT.search(line)) and asked[1] != self._input:
            raise InputError(f"found {asked[0]}; the probe is at input {self._input}")
        if line.startswith(";"):
            self._mark = match[1] if (match := MARK_BEHIND_SEMICOLON.fullmatch(line)) else self._mark
        elif not self._computes(line):
            if self._within:
                raise InputError("no line that an IF may have")
            if not (self._states(line) or self._acts(line)):
                self._print(line)

    def _computes(self, line: str) -> bool:
        """→ whether the line computes, branches, records or hands over; then it has."""
        if self._handed is not None and self._handed.takes(line):
            self._hand_over(self._handed)
        elif match := JUMP.fullmatch(line):
            self._jump(match[1], match[2])
        elif line == "ENDIF" and self._within:
            self._within = False
            self._machine.does(_every_branch)
        elif match := IF.fullmatch(line):
            self._if(match[1])
        elif match := TEXT.fullmatch(line):
            self._record(match)
        elif match := ASSIGN.fullmatch(line):
            self._frame(match[2])
            self._machine.does(self._assignment(match[1], match[2]))
        else:
            return False
        return True

    def _states(self, line: str) -> bool:
        """→ whether the line only waits, shows or switches something, or ends the program; then it is done."""
        if match := REST.fullmatch(line):
            self._machine.rests(float(match[1]))
        elif SETTLES.fullmatch(line):
            self._settled = True
        elif SHOWN.fullmatch(line):
            pass
        elif line == "STOPRE":
            self._moving = False
        elif line in self._words or DEFINE.fullmatch(line):
            self._machine.walk.switch(line)
            self._head.discard(line)
        elif line == self._options.get("reset"):
            self._machine.reset(" ".join([*(SAME_AS.get(word, word) for word in line.split()), *MADE_SURE]))
        elif line == "M30":
            self._machine.watched()
            self.over = True
        else:
            return False
        return True

    def _acts(self, line: str) -> bool:
        """→ whether the line moves an axis; then it has."""
        if match := TURN.fullmatch(line):
            self._machine.turns(match[1], float(match[2]), True)
            self._moving, self._asked, self._settled = True, False, False
        elif match := ORIENT.fullmatch(line):
            self._machine.turns("S", float(match[1]), False)
        elif match := FEED.fullmatch(line):
            self._feed(match[1].split(), float(match[2]))
        elif match := STEP.fullmatch(line):
            self._may_move()
            self._machine.steps(match[1], float(match[2]), float(match[3]))
            self._moving, self._asked = True, False
        elif match := OFF.fullmatch(line):
            self._free(match[1].split(), float(match[2]))
        else:
            return False
        return True

    def _frame(self, text: str) -> None:
        """An expression that asks for parts of a frame: beside the machine there are others where this part of it is left."""
        for axis, part in PARTS.findall(text):
            twin = self._machine.base.twin("stop", f"a frame is left: {part or 'DRF'} of {axis}")
            twin.shared[f"P_ACTFRAME__{axis}{part}" if part else f"AC_DRF__{axis}"] = FRAME.get(part, 0.0) + 1.0
            self._machine.doubts([twin])
            self._unasked.pop(f"{axis} {part or 'DRF'}", None)

    def _lettered(self, line: str) -> str:
        """line with names of machine axes → the same with letters. Raises InputError for a name that the profile does not state."""

        def letter(match: re.Match[str]) -> str:
            if match[2] not in self._own:
                raise InputError(f"found {match[0]}; allowed: the names {', '.join(self._own)}, see controller.machine_axes")
            return f"${match[1]}[{self._own[match[2]]}]"

        return OWN.sub(letter, line)

    def _free(self, words: list[str], feed: float) -> None:
        self._machine.off({name: _spelt(word[1:].removeprefix("=")) for name, word in _once(words).items()}, feed)
        self._moving, self._asked = True, False

    def _feed(self, words: list[str], feed: float) -> None:
        machine = self._machine
        target = {name: machine.base.position[name] for name in "XYZ"} | {n: float(word[1:]) for n, word in _once(words).items()}
        self._may_move()
        if machine.walk.measures:
            machine.measures(target, feed)
        else:
            machine.guarded(target, feed)
        self._moving, self._asked = True, False

    def _may_move(self) -> None:
        """Raises InputError where something that has to come before a move of MEAS has not come."""
        if self._head:
            raise InputError(f"something moves before {' '.join(sorted(self._head))}")
        if left := [f"{what} ({option})" for what, option in self._unasked.items() if self._options.get(option)]:
            raise InputError(f"something moves before the control was asked for {', '.join(left)}")
        if self._options.get("probe_state") and not self._asked:
            raise InputError("moves without having asked whether the probe is deflected")

    def _jump(self, condition: str, label: str) -> None:
        if label not in self._stops or self._within:
            raise InputError(f"{label} is no place where this program stops for good")
        self._frame(condition)
        if "$A_PROBE" in condition:
            self._asked = True
            twin = self._machine.base.twin("stop", "the probe is deflected")
            twin.shared["A_PROBE"] = 1.0
            self._machine.doubts([twin])
        for word, (name, well, what) in ASKED.items():
            if word in condition:
                self._unasked.pop(name, None)
                twin = self._machine.base.twin("stop", what)
                twin.shared[name] = 1.0 - well
                self._machine.doubts([twin])

        def does(twin: Twin) -> None:
            twin.stopped = bool(self._machine.value(twin, _spelt(condition)))

        self._machine.does(does)

    def _if(self, condition: str) -> None:
        if self._within:
            raise InputError("an IF within an IF")
        self._within = True

        def does(twin: Twin) -> None:
            twin.branch = bool(self._machine.value(twin, _spelt(condition)))

        self._machine.does(does)

    def _assignment(self, name: str, text: str) -> Statement:
        expression = _spelt(text)

        def does(twin: Twin) -> None:
            if twin.branch:
                twin.shared[name] = self._machine.value(twin, expression)

        return does

    def _record(self, match: re.Match[str]) -> None:
        letters, values = re.findall(r" ([A-Z])%", match[2]), match[4].split(",")
        if len(values) != len(letters) + 2:
            raise InputError(f"{len(values)} values for {len(letters) + 2} places")
        places = dict(zip(letters, map(_spelt, values[1:-1]), strict=True)) | {"S": match[3], "K": _spelt(values[-1])}
        self._text, self._shown = (match[1], _spelt(values[0]), places), [_spelt(value) for value in values]

        def does(twin: Twin) -> None:
            twin.shared.update({f"TEXT {i}": self._machine.value(twin, shown) for i, shown in enumerate(self._shown)})

        self._machine.does(does)

    def _hand_over(self, handed: Handed) -> None:
        """A line of the handshake → what it gives, when it is the last one."""
        if self._within:
            raise InputError("a variable of the handshake within an IF")
        if handed.guard and handed.guard not in self._stops:
            raise InputError(f"{handed.guard} is no place where this program stops for good")
        machine = self._machine
        if handed.waits:  # G4 and STOPRE of its loop: the axes stand
            self._moving = False
        if handed.assigned is not None:  # it has the value of this moment
            key, text = handed.assigned[0], _spelt(handed.assigned[1])

            def does(twin: Twin) -> None:
                twin.shared[f"CELL {key}"] = machine.value(twin, text)

            machine.does(does)
        if handed.complete is None:
            return
        given, handed.complete = handed.complete, None
        for what, shown in given.items():
            for twin in machine.twins:
                if machine.value(twin, _spelt(shown)) != twin.shared[f"CELL {what}"]:
                    raise InputError(f"{what} was put there before its value was there")
        point = given["point"]
        if point == "0" or point == END_POINT:
            try:
                mark, count = _hash(handed.lasting), float(handed.lasting["count"])
            except (KeyError, ValueError):
                raise InputError("hash and number of touches are not in their variables") from None
            if point == "0":
                machine.start(mark, count, self._mark)
            else:
                machine.end(mark, count)
            return
        names = [axis.name for axis in machine.plan.machine.axes]
        if missing := [name for name in (*names, "sum", "flag") if name not in given]:
            raise InputError(f"the record of touch {point} has no {' '.join(missing)}")
        places = {name: _spelt(given[name]) for name in names} | {"K": _spelt(given["sum"])}
        machine.record(point, _spelt(given["flag"]), places)

    def _print(self, line: str) -> None:
        if OPEN.fullmatch(line) and not self._opened:
            self._opened = True
        elif CLOSE.fullmatch(line) and self._opened:
            self._closed = True
            return
        elif ((match := WRITE.fullmatch(line)) and self._opened and not self._closed) or (
            (match := FILE.fullmatch(line)) and not self._opened
        ):
            self._write(match[1])
        else:
            raise InputError("no line that a program of this kind may have here")
        for twin in self._machine.everywhere:
            twin.shared["TG_ERROR"] = 0.0
        twin = self._machine.base.twin("stop", "nothing can be written")
        twin.shared["TG_ERROR"] = 1.0
        self._machine.doubts([twin])

    def _write(self, text: str) -> None:
        if text == "TG_TEXT" and self._text is not None:
            for twin in self._machine.twins:
                if any(self._machine.value(twin, shown) != twin.shared[f"TEXT {i}"] for i, shown in enumerate(self._shown)):
                    raise InputError("TG_TEXT was put together before its values were there")
            self._machine.record(*self._text)
            self._text = None
        elif match := START.fullmatch(text):
            self._machine.start(match[1], float(match[2]), self._mark)
        elif match := END.fullmatch(text):
            self._machine.end(match[1], float(match[2]))
        else:
            raise InputError(f"nobody knows what {text} is")

    def _read(self, twin: Twin, key: int | str) -> Value:
        name, _, axis = str(key).partition("__")
        if name in ("AA_IM", "AA_MM", "VA_IM") and axis in twin.position:
            if self._moving:
                raise InputError(f"${name}[{axis}] is read before anything has waited for the axes to stand (STOPRE)")
            if name == "VA_IM" and not self._settled:
                raise InputError(f"$VA_IM[{axis}] is read before its axis has come to rest (G4 F0.2)")
            if name == "AA_MM" and not twin.hit:
                return SPOILT  # what was met before
            if name == "AA_IM" and axis not in "XYZ" and self._options.get("rotary_position") == "$VA_IM":
                return self._machine.base.position[axis]  # where it was sent
            return twin.shown(axis, (twin.skip if name == "AA_MM" else twin.position)[axis])
        if name == "P_ACTFRAME":
            return twin.shared.get(str(key), FRAME.get(axis[1:], 0.0))
        if name == "AC_DRF":
            return twin.shared.get(str(key), 0.0)
        for known, well, _ in ASKED.values():
            if name == known:
                return twin.shared.get(name, well)
        if name == "AC_MEA":
            return float(twin.hit)
        if name == "A_PROBE":
            if self._moving:
                raise InputError("$A_PROBE is read before anything has waited for the axes to stand (STOPRE)")
            return twin.shared.get(name, 0.0)
        if key not in twin.shared:
            raise InputError(f"{key} is read before it has a value")
        return twin.shared[key]


def _hash(lasting: Mapping[str, str]) -> str:
    """what stands in the variables → the hash of the program, twelve hexadecimal digits."""
    return "".join(f"{int(lasting[f'mark{i}']):04X}" for i in range(3))


def _once(words: list[str]) -> dict[str, str]:
    """words of axes → {axis: its word}. Raises InputError for an axis that appears twice."""
    named = {word[0]: word for word in words}
    if len(named) < len(words):
        raise InputError(f"found {' '.join(words)}; allowed: every axis once")
    return named


@lru_cache(maxsize=4096)
def _spelt(text: str) -> str:
    """expression as this control spells it → as the reader of expressions does."""
    text = SYSTEM.sub(lambda match: f"#<{match[1]}__{match[2]}{match[3] or ''}>", text)
    for word, (name, _, _) in ASKED.items():
        text = text.replace(word, f"#<{name}>")
    text = re.sub(r"\bTG_[A-Z]+\b", lambda match: f"#<{match[0]}>", text)
    held = re.split(r"(#<\w+>)", text)
    for i in range(0, len(held), 2):
        for theirs, ours in SPELT:
            held[i] = held[i].replace(theirs, ours)
    return "".join(held)


def _every_branch(twin: Twin) -> None:
    twin.branch = True
