"""The machine that does what the plan expects, and the machines beside it on which something has gone wrong.

A `Twin` is one of them: its variables, where its axes stand, where its probe was met last. Every statement of a program is
carried out on all of them. A twin that must stop (`fate` "stop") has to reach an alarm before the next motion; one that may
go on has to record the flag that `fate` names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any

from ..gate import INCH, STEP_FEED, step
from ..nearest import printable
from ..records import InputError, Plan
from .expressions import Value, constant, expression
from .phases import BEGUN, OWED, TOLD, Action, Phase, after
from .twins import Place, Twin, latched_elsewhere, offset_changed, other_contacts, stopped_short, turned_otherwise
from .walk import PROTECTED, Walk

NUMBER = r"-?\d+\.\d*"  # with its decimal point, without which controls count in thousandths
SHORT = 3.0  # tolerances of the profile by which a protected move is stopped short
TOLERANCE = 0.02  # mm, where the profile has none
OFFSET = {"X": 11.25, "Y": -7.5, "Z": 203.5, "A": 3.0, "B": -2.0, "C": 31.0}  # machine minus work coordinates
SPOILT = 77777.0  # in variables whose values are of the touch before
ROUNDS = 20  # touches in a row without contact after which a program must have stopped that counts none by its profile
# plane, mm, no compensation of radius and length, no cycle, absolute, mm/min, and a spindle that stands
MODAL = {"G17", "G21", "G40", "G49", "G80", "G90", "G94", "M5"}
RESETS = re.compile(r"M5|G(17|21|40|40\.1|49|50|50\.1|54|61|64|67|69|80|90|94|97|98|13\.1|15|25|160|234|254)")
TWINS_RECORDED = (
    6  # twins that reach a record: the expected contact, a miss, and four other contacts; one more where finding was early
)
LATE = 4.0  # tolerances of the profile before the end of a measuring move at which a contact still is one
VARIABLE = re.compile(r"#(?:(\d+)|<(\w+)>)")
FARTHER = 0.3  # of the way from the nominal contact to the search end, where a touch that finds meets the facet
LETS_GO = 3.0  # s that a hand needs
PLACE = 2e-3  # mm or deg, of a recorded coordinate

Statement = Callable[[Twin], None]
Astray = Callable[[Twin, Place, Place], Iterable[Twin]]


class Rehearsal:
    """A program on its way through all twins; a family of dialects reads the lines and calls these methods."""

    def __init__(
        self,
        plan: Plan,
        options: Mapping[str, Any],
        read: Callable[[Twin, int | str], Value],
        latches: bool = False,
        astray: Astray | None = None,
        framed: bool = False,
        dynamic: bool = False,
    ) -> None:
        """plan, every option of its profile, how a twin's variable is read; whether the control latches machine positions.

        `framed`: the program takes the difference of two frames from the control: a step has to show first that it is in mm.
        `dynamic`: a work offset of the control may turn with its rotary axes: the program has to notice it there.
        `astray`: where else a measuring move may say that its contact was, which has to stop the program.
        """
        self._latches, self._dynamic = latches, dynamic
        self._astray = astray or (latched_elsewhere if latches else offset_changed)
        self.plan, self.options, self._read = plan, options, read
        self.walk = Walk(plan, options)
        start = dict(self.walk.at)
        self.twins = [Twin("1", "nothing has gone wrong", start, dict(start), dict(OFFSET))]
        self.inches = self.base.twin("stop", "positions come in inches") if framed else None  # until a step has been made
        if self.inches is not None:
            self.inches.unit = INCH
        self._silent: Twin | None = None  # where this touch and all after it miss
        self._statements: list[Statement] = []
        self._modal: set[str] = set()
        self._unlucky: Twin | None = None  # where touch after touch has missed, and what each left behind is there still
        self._missed = 0  # how often
        self._dead: Twin | None = None  # the same from finding until the record, for a measuring move that is left out then
        self._since: list[Statement] = []
        self._once = False  # a touch that finds nothing is counted once: nothing is measured then
        self._late: Twin | None = None  # where only the second of two touches has met its facet; it may have stopped before
        self._phase = Phase.HEAD
        self.records = 0
        self._mark = ""

    @property
    def begun(self) -> bool:
        """→ whether the start mark has been read."""
        return self._phase is not Phase.HEAD

    @property
    def ended(self) -> bool:
        """→ whether the end mark has been read."""
        return self._phase is Phase.ENDED

    @property
    def base(self) -> Twin:
        """→ the machine on which nothing goes wrong."""
        return self.twins[0]

    @property
    def everywhere(self) -> tuple[Twin, ...]:
        """→ all machines, the one with it whose positions come in inches."""
        return (*self.twins, *([self.inches] if self.inches else []))

    def value(self, twin: Twin, text: str) -> float:
        """expression → its value in a twin. Raises InputError for what is no expression."""
        try:
            return (constant(text) or (expression(text)(partial(self._read, twin)),))[0] or 0.0
        except (ValueError, ZeroDivisionError, OverflowError, TypeError) as error:
            raise InputError(f"{text!r} has no value: {error}") from None

    def same(self, text: str, within: float = 1e-6) -> float:
        """expression → its value, which must not depend on what has gone wrong by more than `within`."""
        first, *rest = constant(text) or (self.value(twin, text) for twin in self.twins)
        if any(abs(first - other) > within for other in rest):
            raise InputError(f"{text!r} depends on where the probe was met")
        return first

    def does(self, statement: Statement) -> None:
        """Carries a statement out in every twin that goes on. Raises InputError when it stops the program for nothing."""
        if self._silent is not None:
            self._statements.append(statement)
        if self._dead is not None:
            self._since.append(statement)
        for twin in self.everywhere:
            statement(twin)
        if self.base.stopped:
            raise InputError("stops the program though nothing has gone wrong")
        self.twins = [twin for twin in self.twins if not twin.stopped]

    def watched(self) -> None:
        """Something moves or ends now. Raises InputError when the program goes on where something has gone wrong before."""
        for twin in self.twins:
            if twin.fate == "stop":
                raise InputError(f"the program goes on although {twin.what}")

    def doubts(self, twins: Iterable[Twin]) -> None:
        """Adds twins where something has gone wrong."""
        self.twins.extend(twins)

    def reset(self, words: str) -> None:
        """Modal words before anything moves. Raises InputError for a word that is none of those known to be harmless."""
        for word in words.split():
            if not RESETS.fullmatch(word):
                raise InputError(f"found the word {word}; allowed here: modal words that switch something off or state units")
            self._modal.add(word)

    def _goes(self, step: Action) -> None:
        """The program goes on by a step. Raises InputError where its phase does not allow it."""
        self._phase = after(self._phase, step)

    def steps(self, name: str, by: float, feed: float) -> None:
        """axis letter, mm, mm/min → the step before all else; beside it there are positions in inches and a mirror image."""
        inches, self.inches = self.inches, None
        wanted, far = step(self.plan)
        if inches is None or name != wanted or abs(by - far) > 1e-9:
            raise InputError(f"found a step of {name} {by:g} mm; allowed: one of {wanted} {far:g} mm, before anything else moves")
        self._ready()
        self._within(feed, STEP_FEED)
        after(self._phase, Action.GUARDED)
        self.walk.steps(name, by)
        start, target = dict(self.base.position), {name: self.base.position[name] + by}
        for twin in (*self.twins, inches):
            twin.position[name] += by
            twin.skip, twin.hit = dict(twin.position), False
        short = SHORT * float(self.options.get("tolerance", TOLERANCE))
        mirrored = self.base.twin("stop", f"{name} goes the other way: a mirror image")
        mirrored.position[name] = mirrored.skip[name] = start[name] - by
        self.doubts([inches, mirrored, *stopped_short(self.base, start, target, short, self._latches)])

    def _ready(self) -> None:
        self.watched()
        if self.inches is not None:
            name, by = step(self.plan)
            raise InputError(f"something moves before a step of {name} {by:g} mm has shown whether positions come in mm")
        if missing := sorted(MODAL - self._modal):
            where = ", see controller.reset" if "reset" in self.options else ""
            raise InputError(f"something moves before {' '.join(missing)} is stated{where}")
        if self._phase not in BEGUN:
            raise InputError("something moves outside of start mark and end mark")

    def moves(self, target: Mapping[str, float], kinds: tuple[str, ...], feed: float) -> None:
        """{X Y Z: machine mm}, kinds of moves that it may be, mm/min → all twins are there. Raises InputError when it is wrong."""
        self._ready()
        self._within(feed, self.options.get("positioning_feed", feed))
        self.walk.linear(target, kinds)
        self._dies()
        for twin in self.twins:
            twin.position.update(target)
        if self._dead is not None:
            self._since.append(_there(target))
        if self._phase in TOLD:  # on record, and back where the next touch finds it: the same way back wherever the probe was met
            self.twins = [self.base, *(w for w in self.twins[1:] if w is self._unlucky)]
        self._goes(Action.MOVES)

    def off(self, places: Mapping[str, str], feed: float, work: bool = False) -> None:
        """{X Y Z: expression}, mm/min → the probe has come free, wherever the measuring move has ended; nothing guards this move.

        `work`: the expressions are work coordinates and not machine coordinates.

        Raises InputError when it is anything but a short move off the facet, or not right after a measuring move.
        """
        self._ready()
        if not {*places} <= {*"XYZ"}:
            raise InputError(f"found an unprotected move of {' '.join(places)}; allowed: X Y Z")
        self._goes(Action.LEAVES)
        self._within(feed, self.options.get("positioning_feed", feed))
        self._dies()

        def goes(twin: Twin) -> None:
            twin.position.update({name: self.value(twin, text) + work * twin.offset[name] for name, text in places.items()})

        for twin in self.twins:
            start = dict(twin.position)
            goes(twin)
            self.walk.off({name: twin.position[name] - start[name] for name in "XYZ"})
        if self._dead is not None:
            self._since.append(goes)

    def freed(self) -> None:
        """The control itself has taken the probe off the facet."""
        self._goes(Action.FREED)

    def guarded(self, target: Mapping[str, float], feed: float) -> None:
        """A move that stops at a contact and says nothing: whoever looks afterwards must find it stopped short."""
        if self._phase in BEGUN:
            after(self._phase, Action.GUARDED)
        start = dict(self.base.position)
        self.moves(target, PROTECTED, feed)
        for twin in self.twins:
            twin.skip, twin.hit = dict(twin.position), False
        short = SHORT * float(self.options.get("tolerance", TOLERANCE))
        self.doubts(stopped_short(self.base, start, target, short, self._latches))

    def measures(self, target: Mapping[str, float], feed: float, found: bool = False) -> None:
        """A measuring move: contact where the plan expects it; beside it a miss, an early contact, a changed work offset.

        One that finds meets the facet elsewhere than the one that measures, so that nobody can record the one for the other.
        `found`: it is made only where the facet has been found, and then the control itself stops when it meets nothing.
        """
        self._ready()
        if self._phase in OWED:
            raise InputError("the touch before has no record")
        if self.walk.proving:
            self._proves(target, feed)
            return
        approach = self.plan.strategy.approach
        finds = self.walk.next is not None and self.walk.next.kind == "find"
        self._within(feed, approach.find.feed if finds and approach.find else approach.feed)
        start, base = dict(self.base.position), self.base
        self.walk.linear(target, ("find" if finds else "probe",))
        farther = FARTHER if finds else 0.0
        base.met({n: self.walk.at[n] + farther * (target[n] - self.walk.at[n]) for n in target}, start, target)
        zone = max(approach.standoff - approach.search, 0.1 * approach.standoff)
        if approach.find and not finds:
            zone -= self.plan.nearer
        if found:
            self._left_out(target)
        else:
            self._found_otherwise(base, start, target)
        near_the_end = LATE * float(self.options.get("tolerance", TOLERANCE))
        miss, *others = other_contacts(base, start, target, zone, near_the_end)
        if finds:
            early = others[1]
            early.fate, early.what, early.found = "find", "finding has met its facet early", {n: early.skip[n] for n in target}
            miss.fate, miss.what, others = "find", "finding has met nothing", [early]
        self._goes(Action.FINDS if finds else Action.MEASURES)
        self._once = found
        self.doubts([*others, *self._astray(base, start, target)])
        if not found:
            self.doubts([miss])
            dead = "stop", "no touch finds anything any more"
            if self.options.get("cycle") != 444:  # which measures nothing that has not been found
                self._misses_again(miss, target, 2 if approach.find else 1)
            self._silent, self._statements = miss.twin(*dead), []
        if finds:
            self._dead, self._since = miss.twin(*dead), [_there(target)]

    def _proves(self, target: Mapping[str, float], feed: float) -> None:
        """The move of the gate: the stylus is touched, or meets its facet; beside it there is a probe that notices nothing."""
        start, base, step = dict(self.base.position), self.base, Action.FINDS if self.walk.on_facet else Action.PROVES
        self.walk.proof(target, feed)
        base.met({name: self.walk.at[name] for name in target}, start, target)
        dead = base.twin("stop", "the probe is dead, off, or wired to another input")
        dead.position.update(target)
        dead.skip, dead.hit = dict(dead.position), False
        self._goes(step)
        self.doubts([dead])

    def rests(self, seconds: float) -> None:
        """s without motion: somebody who has touched the stylus lets it go. Raises InputError where something has gone wrong."""
        self.watched()
        if self._phase is Phase.TOUCHED and seconds >= LETS_GO:
            self._goes(Action.RESTS)
            self.base.hit = False

    def _misses_again(self, miss: Twin, target: Mapping[str, float], each: int) -> None:
        """Beside the machine there is one that misses again and again, `each` times a touch, until it has to have stopped."""
        twin = next((twin for twin in self.twins if twin is self._unlucky), None)
        if twin is None:
            twin = self._unlucky = miss.twin("0", "no touch finds anything any more")
            self._missed = 0
            self.doubts([twin])
        twin.position.update(target)
        twin.skip, twin.hit = dict(twin.position), False
        self._missed += 1
        if self._missed >= each * int(self.options.get("misses", ROUNDS)):
            twin.fate = "stop"

    def _found_otherwise(self, base: Twin, start: Mapping[str, float], target: Mapping[str, float]) -> None:
        """Where finding has met nothing, measuring may meet the facet all the same: then that is what the record has to say.

        Where it has met it early, measuring does so too.
        """
        for twin in self.twins:
            if twin.fate == "find" and twin.found is not None:
                twin.fate = "2"
                twin.met(twin.found, start, target)
            elif twin.fate == "find":
                twin.fate, twin.position, twin.skip, twin.hit = "1", dict(base.position), dict(base.skip), True
                self._late = twin

    def _left_out(self, target: Mapping[str, float]) -> None:
        """What finding has not met, or early, is not measured: on record is what has been found, for a miss the end of the move."""
        for twin in self.twins:
            if twin.fate == "find":
                twin.fate, twin.hit = ("0", False) if twin.found is None else ("2", True)
                twin.skip = twin.position | dict(target if twin.found is None else twin.found)

    def _dies(self) -> None:
        """What the program did after the last measuring move stops it in the end, if nothing is ever touched."""
        silent, self._silent = self._silent, None
        if silent is not None:
            self._stops(silent, self._statements, 2 if self.plan.strategy.approach.find else 1)

    def _stops(self, dead: Twin, statements: Iterable[Statement], each: int) -> None:
        """Repeats statements where nothing is touched, `each` times a touch. Raises InputError when they stop nothing."""
        rounds = each * int(self.options.get("misses", ROUNDS))
        for _ in range(rounds):
            for statement in statements:
                statement(dead)
                if dead.stopped:
                    return
        raise InputError(f"the program goes on after {rounds} touches in a row that found nothing")

    def turns(self, name: str, value: float, asked: bool) -> None:
        """axis letter, deg, whether the program has to ask if it has arrived. Raises InputError when it is wrong."""
        if self._phase in BEGUN and MODAL - self._modal:
            raise InputError("something turns before the modal state is stated")
        self._goes(Action.TURNS)
        if self.walk.rotary(name, value):
            self.watched()
        for twin in self.twins:
            twin.position[name] = value
        if asked:
            self.doubts(turned_otherwise(self.base, name, self._dynamic))

    def start(self, mark: str, count: float, wanted: str) -> None:
        """The start mark. Raises InputError when it is not that of this program."""
        if mark != wanted or count != len(self.plan.touches):
            raise InputError(f"the start mark is {mark} {count:g}; this program is {wanted} {len(self.plan.touches)}")
        self._goes(Action.STARTS)
        self._mark = wanted

    def end(self, mark: str, count: float) -> None:
        """The end mark. Raises InputError when it is not that of this program, or touches or moves are missing."""
        self.watched()
        if mark != self._mark:
            raise InputError(f"the end mark is that of {mark}; this program is {self._mark}")
        if self.ended:
            raise InputError("a second end mark")
        recorded = 0 if self.plan.only else len(self.plan.touches)
        if count != len(self.plan.touches) or self.records != recorded:
            raise InputError(f"the end mark says {count:g}; {self.records} of {recorded} touches are on record")
        self.walk.ends()
        self._goes(Action.ENDS)

    def record(self, number: str, flag: str, places: Mapping[str, str]) -> None:
        """expressions of touch number, flag and coordinates → the touch is on record. Raises InputError when it is another."""
        self.watched()
        self._dies()
        if self._once and self._dead is not None:
            self._stops(self._dead, self._since, 1)
        touch = self.plan.touches[self.records] if self.records < len(self.plan.touches) else None
        if self._phase not in OWED or touch is None:
            raise InputError("a record without a touch")
        names = [axis.name for axis in self.plan.machine.axes]
        if [*places] != [*names, "K"]:
            raise InputError(f"the record has {' '.join(places)}; allowed: {' '.join(names)} K")
        for twin in self.twins:
            said = self.value(twin, flag)
            if f"{said:g}" != twin.fate:
                raise InputError(f"the flag is {said:g} where {twin.what}; it has to be {twin.fate}")
            if self.value(twin, number) != touch.number:
                raise InputError(f"the record is of touch {self.value(twin, number):g}; this is touch {touch.number}")
            for name in names:
                there = self.walk.at["S"] if name == "S" else twin.skip[name]
                off = self.value(twin, places[name]) - there
                off = off if name in "XYZ" else (off + 180.0) % 360.0 - 180.0
                if abs(off) > PLACE:
                    raise InputError(f"the record has {name} {there + off:.3f}; the machine was at {there:.3f}")
            total = sum(self.value(twin, places[name]) for name in names)
            if abs(self.value(twin, places["K"]) - total) > PLACE:
                raise InputError("the sum in the record is not that of its coordinates")
        told = TWINS_RECORDED + (1 if self.plan.strategy.approach.find else 0)
        if sum(twin is not self._late and twin is not self._unlucky for twin in self.twins) != told:
            raise InputError("the program stops at a miss or an early contact instead of recording it")
        self._silent, self._dead, self._late = None, None, None
        self._goes(Action.RECORDS)
        self._forget(flag, *places.values())
        self.records += 1

    def _forget(self, *texts: str) -> None:
        """Spoils what has been recorded, so that the next touch cannot live on it."""
        for text in texts:
            for number, name in VARIABLE.findall(text):
                key: int | str = int(number) if number else name
                for twin in self.twins:
                    for store in (twin.shared, *twin.local):
                        if key in store:
                            store[key] = SPOILT

    def _within(self, feed: float, wanted: float) -> None:
        if abs(feed - wanted) > 1e-6:
            raise InputError(f"the feed is {feed:g}; allowed: {wanted:g} mm/min")


def _there(target: Mapping[str, float]) -> Statement:
    """{axis: mm} → the statement of a move that has gone there."""
    place = dict(target)
    return lambda twin: twin.position.update(place)


def numbered(lines: Iterable[str]) -> Iterator[tuple[int, str]]:
    """lines → (line number, line without blanks around it). Raises InputError for one that is longer than any control reads."""
    for number, line in enumerate(lines, 1):
        if len(line) > LONGEST:
            raise InputError(f"line {number} has {len(line)} characters; allowed: at most {LONGEST}, no control reads more")
        yield number, line.strip()


LONGEST = 1000  # characters of a line
SAID = 2000  # characters of what is wrong with a line


def at_line(number: int, line: str, error: InputError) -> InputError:
    """line (0: none of them) and what is wrong with it → the error that says where."""
    where = f"program line {number} {line[:80]!r}" if number else "program"
    return InputError(f"{where}: {printable(str(error), SAID)}. The program is not the plan")
