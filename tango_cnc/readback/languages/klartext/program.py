"""Klartext programs for Heidenhain controls: TCH PROBE 4 says −1 when it meets nothing, the text itself has to look and to stop.

Facts, as far as they are known: M91 makes the targets of one block machine positions; FN 18 ID240 NR1 is where an axis stands,
true behind FN 20 WAIT FOR SYNC only; TCH PROBE 4 goes DIST along IX IY IZ and puts the contact into three Q parameters and 0
or −1 into the fourth, MB takes it back after a contact; labels behind M30 are called up to their LBL 0; Q parameters are global.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ....gate import STEP_FEED, TOUCH
from ....records import OFF, Axis, InputError, Plan
from ...expressions import Value
from ...language import Companions, Language
from ...reading import MARK_BEHIND_SEMICOLON, stated_words
from ...rehearsal import PLACE, Rehearsal, at_line, numbered
from ...twins import Twin, beside_the_line
from ...walk import FARTHEST, LEAST, PROTECTED
from . import cycle_444
from .ahead import AHEAD, apart, arrival, told, unless_ahead
from .blocks import (
    ANGLE,
    ASSIGN,
    BEGIN,
    CALL,
    COMPARES,
    CYCLES,
    DECLARED,
    DWELL,
    END,
    FACTOR,
    FOLLOWS,
    HEAD,
    JUMP,
    MIRRORED,
    PRINT,
    PROBE,
    PROBE_TABLE,
    READ,
    TEXT,
    TURN,
)
from .texts import Texts, labels, spelt, whole

COMPANIONS = re.compile(r".+")
SHOWS = f"STOP ; {TOUCH}"
MASK = ["M_APPEND;", '"%S",QS1;', "M_CLOSE;"]
# No plane matters here; MM in the first block; M91, R0, no cycle and F in the blocks that move; M137 and M5 in the head
SURE = "G17 G21 G40 G49 G80 G90 G94 M5"
NO_WAY = 0.0015  # mm: less than a label asks for before it moves
NO_STEP = 1e-4  # mm: nothing a control could take a direction from
MIRROR = "mirror image"  # what is asked besides the scaling factors


def reads(head: list[str]) -> bool:
    """first lines of a program → whether it is of this family."""
    return any(re.match(r"\d+ BEGIN PGM ", line) for line in head[:2])


def rehearse(lines: Callable[[], Iterator[str]], plan: Plan, options: Mapping[str, Any], companions: Companions) -> None:
    """program, plan, options, companions → nothing. Raises InputError naming the line that must not reach a machine."""
    at = 0, ""
    program: _Program | None = None
    for name, texts in companions.items():
        if list(texts) != MASK:
            raise InputError(f"{name}: found {list(texts)}; allowed: {MASK}, which adds what the program says to its file")
    try:
        for at in numbered(_blocks(lines())):
            program = program or _Program(plan, options, labels(block for _, block in numbered(_blocks(lines()))))
            if not program.over:
                program.line(at[1])
        if program is None:
            raise InputError("an empty program")
        program.finish(at[1])
    except InputError as error:
        raise at_line(*at, error) from None


LANGUAGE = Language(reads, rehearse, COMPANIONS)


def _blocks(lines: Iterable[str]) -> Iterator[str]:
    """lines → blocks without their numbers. Raises InputError unless they count from 0."""
    for wanted, line in enumerate(whole(lines)):
        number, _, block = line.strip().partition(" ")
        if number != str(wanted):
            raise InputError(f"found the block number {number} in {line[:60]!r}; allowed: {wanted}")
        yield block


class _Program:
    """Block by block."""

    def __init__(self, plan: Plan, options: Mapping[str, Any], bodies: Mapping[str, list[str]]) -> None:
        self._machine = Rehearsal(plan, options, self._read, latches=True, astray=beside_the_line, framed=True)
        self._plan, self._options, self._bodies = plan, options, bodies
        self._stops = {
            label for label, body in bodies.items() if body == [*filter(None, [options.get("probe_off")]), "STOP", "M30"]
        }
        names = options.get("axis_numbers") or {name: i for i, name in enumerate("XYZABC", 1)}
        self._axis = {str(number): name for name, number in names.items()}
        self._head = set(HEAD) | {
            words
            for option, *said in (
                ("plane_reset", "PLANE RESET STAY"),
                ("tcpm_reset", "FUNCTION RESET TCPM", "M129"),
                ("shortest", *(["M126"] if any(map(_endless, plan.machine.axes)) else [])),
            )
            if options.get(option)
            for words in said
        }
        self._words = stated_words(options) | set(CYCLES)
        self._unasked = (
            {*"123", MIRROR} if options.get("scaling_check") else set()
        )  # axes whose factor nobody has asked, mirror image
        self._texts = Texts()
        self._name, self._mark, self._before = "", "", ""
        self._probing: list[re.Match[str]] = []
        self._angle = 0.0
        self._columns: dict[str, str] = {}  # of the probe table: parameter that it was read into
        self._ahead: list[str] = []  # what is left of the label that is carried out
        self._shows = options.get("show") == "stop" and options.get("gate") == "finger"
        self._depth = 0
        self._moving, self._alone = True, False  # axes may move; only those of twins that are not on their way to a label
        self.over = False

    def finish(self, last: str) -> None:
        """last block of the file. Raises InputError when the program has stopped too soon."""
        if not (self.over and self._machine.ended and last == END.format(self._name)):
            raise InputError("the program ends without end mark, M30 or END PGM")

    def line(self, block: str) -> None:
        """One block. Raises InputError when it must not reach a machine."""
        if match := MARK_BEHIND_SEMICOLON.fullmatch(block):
            self._mark = match[1]
        if match := BEGIN.fullmatch(block):
            self._begin(match[1])
        code = block.partition(";")[0].strip()
        if not code or not self._name or BEGIN.fullmatch(block):
            if code and not self._name:
                raise InputError("found no BEGIN PGM … MM")
            return
        if block == SHOWS and self._shows and self._machine.walk.proving:
            self._shows = False  # whoever has read it presses start; once, right before the stylus is touched
        elif match := cycle_444.CALL.fullmatch(code):
            self._cycle_444(match)
        elif self._probing or code.startswith("TCH PROBE"):
            self._probe(code)
        elif match := JUMP.fullmatch(code):
            self._jump(match)
        elif match := READ.fullmatch(code):
            self._system(match[1], match[2], match[3])
        elif match := FACTOR.fullmatch(code):
            self._factor(match[1], match[2], 1.0, "cycle 26 scales an axis")
        elif match := MIRRORED.fullmatch(code):
            self._factor(match[1], MIRROR, 0.0, "cycle 8 mirrors an axis")
        elif match := PROBE_TABLE.fullmatch(code):
            self._table(match[1], match[2], match[3])
        elif match := ASSIGN.fullmatch(code):
            self._stays(match[1])
            self._texts.changed(match[1])
            self._machine.does(unless_ahead(self._assignment(match[1], spelt(match[2]))))
        elif self._depth and (match := re.fullmatch(r"LBL ([1-9]\d*)", code)):
            self._machine.does(arrival(match[1]))
        else:
            self._one_way(code)
        self._before = code

    def _begin(self, name: str) -> None:
        if self._name:
            raise InputError("a second BEGIN PGM")
        self._name = name

    def _one_way(self, code: str) -> None:
        """Blocks that all twins carry out: none of them is on its way to a label."""
        machine = self._machine
        if any(AHEAD in twin.shared for twin in machine.twins):
            if code != "FN 20: WAIT FOR SYNC":
                raise InputError("depends on where the probe was met")
            self._moving = self._moving and not (self._alone and AHEAD not in machine.base.shared)
            return
        for begins, wanted in FOLLOWS.items():
            if code.startswith(begins) and not self._before.startswith(wanted):
                raise InputError(f"found {code} without {wanted} before it")
        if code == "FN 20: WAIT FOR SYNC":
            self._moving = False
        elif match := DWELL.fullmatch(code):
            self._machine.rests(float(match[1]))
        elif code in self._head:
            self._head.discard(code)
        elif code in self._words:
            self._machine.walk.switch(code)
        elif match := ANGLE.fullmatch(code):
            self._angle = float(match[1])
        elif match := TEXT.fullmatch(code):
            self._texts.assign(match[1], match[2])
        elif match := DECLARED.fullmatch(code):
            self._texts.declare(match[1], match[2])
        elif match := PRINT.fullmatch(code):
            self._print(match[1], match[2])
        elif self._depth:
            raise InputError("no block that a label of this program may have")
        elif code == "M30":
            machine.watched()
            self.over = True
        elif code == "M19":
            machine.turns("S", self._angle, False)
        elif match := TURN.fullmatch(code):
            machine.turns(match[1], float(match[2]), True)
            self._moving = True
        elif match := CALL.fullmatch(code):
            self._call(match[1])
        else:
            raise InputError("no block that a program of this kind may have here")

    def _call(self, label: str) -> None:
        if self._unasked:
            raise InputError(
                f"something moves before ID210 {'NR3' if MIRROR in self._unasked else 'NR4'} has said that nothing is "
                f"{'mirrored' if MIRROR in self._unasked else 'scaled'}, see controller.scaling_check"
            )
        if label not in self._bodies or label in self._stops:
            raise InputError(f"found a call of label {label}, which is not after M30 or has no LBL 0")
        self._depth += 1
        body = self._bodies[label]
        for i, block in enumerate(body):
            self._ahead = body[i + 1 :]
            try:
                self.line(block)
            except InputError as error:
                raise InputError(f"in label {label}, {block!r}: {error}") from None
        if self._probing or any(AHEAD in twin.shared for twin in self._machine.twins):
            raise InputError(f"label {label} ends within a TCH PROBE, or before a place that it jumps to")
        self._ahead, self._alone = [], False
        self._depth -= 1

    def _jump(self, match: re.Match[str]) -> None:
        function, left, compare, right, label = match.groups()
        theirs, ours = COMPARES[function]
        if compare != theirs:
            raise InputError(f"found FN {function} with {compare}; allowed: {theirs}")
        if label not in self._stops and f"LBL {label}" not in self._ahead:
            raise InputError(f"label {label} is no place where this program stops for good, and not further on in this label")
        condition = f"[{spelt(left)}] {ours} [{spelt(right)}]"

        def does(twin: Twin) -> None:
            if self._machine.value(twin, condition):
                twin.stopped = label in self._stops
                twin.shared[AHEAD] = float(label)

        self._machine.does(unless_ahead(does))

    def _stays(self, parameter: str) -> None:
        """Raises InputError for a parameter that cycle 444 needs as it was when the program began."""
        if self._machine.begun and parameter == self._columns.get("R"):
            raise InputError(f"{parameter} is the radius of the ball from the probe table")

    def _system(self, parameter: str, group: str, number: str) -> None:
        name = self._axis.get(number, "")
        if name not in self._machine.base.position:
            raise InputError(f"found axis number {number}; allowed: {' '.join(sorted(self._axis))}")
        if self._moving and any(AHEAD not in twin.shared for twin in self._machine.twins):
            raise InputError(f"{name} is read before anything has waited for the axes to stand (FN 20)")
        self._stays(parameter)
        self._texts.changed(parameter)

        def does(twin: Twin) -> None:
            twin.shared[parameter] = twin.shown(name, twin.position[name]) if group == "240" else cycle_444.in_its_frame(twin, name)

        self._machine.does(unless_ahead(does))

    def _factor(self, parameter: str, asked: str, right: float, otherwise: str) -> None:
        """The scaling factor of an axis, or which axes are mirrored, and a twin where a cycle has left that on."""
        self._stays(parameter)
        twin = self._machine.base.twin("stop", otherwise)
        self._machine.doubts([twin])
        self._machine.does(unless_ahead(lambda each: each.shared.update({parameter: 2.0 if each is twin else right})))
        self._unasked.discard(asked)

    def _table(self, parameter: str, number: str, index: str) -> None:
        """A column of the probe table, and twins where it says something else: with it the program must not begin."""
        column = cycle_444.SYSTEM.get((number, index), "")
        if not column or self._depth or self._machine.begun:
            raise InputError("the probe table is read before the start mark, by one of the numbers that are known")
        said = cycle_444.table(self._plan)[column]
        self._columns[column] = parameter
        self._machine.does(lambda twin: twin.shared.update({parameter: said}))
        for other in cycle_444.other_tables(self._plan, column):
            twin = self._machine.base.twin("stop", f"{column} of the probe table is {other:g}")
            twin.shared[parameter] = other
            self._machine.doubts([twin])

    def _assignment(self, parameter: str, expression: str) -> Callable[[Twin], None]:
        def does(twin: Twin) -> None:
            twin.shared[parameter] = self._machine.value(twin, expression)

        return does

    def _probe(self, code: str) -> None:
        """One of the four blocks of TCH PROBE 4; at the last one the axes move."""
        match = PROBE[len(self._probing)].fullmatch(code)
        if match is None:
            raise InputError("no block that TCH PROBE 4 in machine coordinates may have")
        self._probing.append(match)
        if len(self._probing) == len(PROBE):
            _, results, way, dist = self._probing
            self._probing = []
            self._drive(int(results[1]), way.groups(), dist[1], float(dist[2]), float(dist[3]))

    def _drive(self, result: int, way: Iterable[str], distance: str, feed: float, back: float) -> None:
        texts = {name: spelt(text) for name, text in zip("XYZ", way, strict=True)}
        for i in range(4):
            self._texts.changed(f"Q{result + i}")
        if self._machine.walk.measures and not any(AHEAD in twin.shared for twin in self._machine.twins):
            self._measure(result, texts, spelt(distance), feed, back)
        elif back:
            raise InputError(f"found MB {back:g} after a guarded move; allowed: 0")
        else:
            self._guarded(result, texts, spelt(distance), feed)

    def _measure(self, result: int, way: Mapping[str, str], distance: str, feed: float, back: float) -> None:
        machine = self._machine
        machine.watched()
        start = dict(machine.base.position)
        along = {name: machine.same(text) for name, text in way.items()}
        size = sum(a**2 for a in along.values()) ** 0.5
        if size < NO_STEP:
            raise InputError("found a probing direction of length 0")
        gone = machine.same(distance) / size
        if not LEAST <= back <= FARTHEST:
            raise InputError(f"found MB {back:g} after a measuring move; allowed: {OFF:g} mm off the facet")
        machine.measures({name: start[name] + gone * a for name, a in along.items()}, feed)
        machine.freed()
        self._moving = True

        def results(twin: Twin) -> None:
            told(twin, result)
            if twin.hit:
                cycle_444.contact(twin)
                went = sum((twin.position[n] - start[n]) * along[n] / size for n in along)
                twin.position.update({n: twin.position[n] - min(back, went) * along[n] / size for n in along})

        machine.does(results)

    def _guarded(self, result: int, way: Mapping[str, str], distance: str, feed: float) -> None:
        """To one place in all twins; those that are there already are on their way to the label behind the move.

        Where the machine is one of those, that the label waits for the axes behind its move has been seen elsewhere.
        """
        machine = self._machine
        going = [twin for twin in machine.twins if AHEAD not in twin.shared]
        if len(going) == len(machine.twins):
            machine.watched()
        goal = {name: machine.base.position[name] for name in "XYZ"}
        for twin in going:
            along = {name: machine.value(twin, text) for name, text in way.items()}
            size = sum(a**2 for a in along.values()) ** 0.5
            if size < NO_STEP:
                raise InputError("found a probing direction of length 0")
            gone = machine.value(twin, distance) / size
            there = {name: twin.position[name] + gone * along[name] for name in goal}
            goal = there if twin is machine.base else goal
            if apart(there, goal) > PLACE:
                raise InputError("a guarded move goes to another place when something has gone wrong before")
        if any(apart(twin.position, goal) > NO_WAY for twin in machine.twins if AHEAD in twin.shared):
            raise InputError("moves in some cases only")
        moved = {name: goal[name] - machine.base.position[name] for name in goal}
        if machine.inches is not None and len(steps := [name for name in moved if abs(moved[name]) > NO_WAY]) == 1:
            self._moving = True
            machine.steps(steps[0], round(moved[steps[0]], 6), STEP_FEED)  # its label has one feed, and DIST is all that it goes
        elif AHEAD in machine.base.shared:
            machine.moves(goal, PROTECTED, feed)
        else:
            self._moving, self._alone = True, len(going) < len(machine.twins)
            machine.guarded(goal, feed)
        machine.does(unless_ahead(lambda twin: told(twin, result)))

    def _cycle_444(self, match: re.Match[str]) -> None:
        """Measures, in all twins but those on their way to a label, which have to be those that have found nothing."""
        machine, table = self._machine, cycle_444.table(self._plan)
        going = [twin for twin in machine.twins if AHEAD not in twin.shared]
        if not machine.walk.measures or going != [machine.base] or any(w.fate != "find" for w in machine.twins[1:]):
            raise InputError("cycle 444 measures what has been found, and is left out where nothing has")
        base, start = machine.base, {name: machine.base.position[name] for name in "XYZ"}
        if unseen := sorted(set(table) - set(self._columns)):
            raise InputError(f"nothing has looked at {' '.join(unseen)} of the probe table, by which cycle 444 moves")
        pole = self._options.get("length_ends") == "pole"
        asked = cycle_444.asked(match, lambda text: machine.value(base, spelt(text)), table, base, pole)
        if max(abs(asked.begin[n] - start[n]) for n in start) > PLACE or abs(asked.height - start["Z"]) > PLACE:
            raise InputError("cycle 444 goes somewhere by itself before it probes")
        before = cycle_444.marked(base)
        machine.measures(asked.end, table["F"], found=True)
        nominal = {name: machine.walk.at[name] for name in "XYZ"}
        machine.does(unless_ahead(cycle_444.left(asked, start, nominal)))
        machine.doubts(list(cycle_444.doubts(base, before, asked, start)))
        machine.freed()
        self._moving = self._alone = True

    def _print(self, mask: str, output: str) -> None:
        if (mask, output) != (self._options.get("mask"), self._options.get("output")):
            raise InputError(f"found the files {mask} and {output}; allowed: those of the profile")
        kind, values = self._texts.printed()
        if kind == "start":
            if self._head:
                raise InputError(f"the program begins without {' or '.join(sorted(self._head))}")
            self._machine.reset(SURE)
            self._machine.start(values[0], float(values[1]), self._mark)
        elif kind == "end":
            self._machine.end(values[0], float(values[1]))
        else:
            number, flag, *places = values
            if len({text[0] for text in places}) < len(places):
                raise InputError("a letter appears twice in the record")
            self._machine.record(number, flag, {text[0]: text[1:] for text in places})

    def _read(self, twin: Twin, key: int | str) -> Value:
        if key not in twin.shared:
            raise InputError(f"{key} is read before it has a value")
        return twin.shared[key]


def _endless(axis: Axis) -> bool:
    return axis.kind == "rotary" and (axis.travel is None or axis.travel[1] - axis.travel[0] > math.radians(800))
