"""grbl 1.1, grblHAL, FluidNC: one line in flight, each waited for; the plan goes out move by move, the status is asked meanwhile.

    $I $$ $G $# ? ▶ { G38.3 guarded moves · G0 rotary axes · G38.3 measuring, $# once more, G1 off the facet } per touch

The facts are of the sources of grbl and grblHAL: a probing move ends in `[PRB:…:1]` or `:0`, then `ok`; the flag decides, as
some report the contact before when they miss. Its numbers are machine coordinates, in inches when `$13` says so, whatever G21
says. A probe that is on when a search begins is ALARM:4 without `[PRB]`. CR LF would be answered twice, so lines end with LF;
an `ok` that answers nothing is found by the `[PRB]` that is missing before it and by the place that is asked for after
every move. Positioning is a probing move as well, so that it stops when the probe trips. Targets are work coordinates:
machine minus work offset, G92 and tool length as the control lists them. The line has no check sums, and a control has obeyed
a line with a lost digit before anybody can know. Therefore the target of every move is confirmed by the control before it moves
(`_grbl_targets.py`); the place is compared after every move, and where it is not the right one nothing more is sent. What
`targets=plain` has instead: what moves the linear axes is stopped by the probe, except the move off a facet, which is short and
relative, as `$G` has confirmed before; the body of the probe is guarded by nothing.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence

from ...gate import HOLD, PROVING, TOUCH, gate, served
from ...records import OFF, Axis, InputError, LacksSettingError, Move, Plan, Touch
from .. import _grbl
from .. import _grbl_targets as targets
from .._dialogue import Stop, Talk, low
from .._grbl_control import Control, Lines
from ..client import Asked, Begun, Ended, Event, Refused, Task, Touched

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "feed": (),  # mm/min of guarded moves
    "targets": ("confirmed", "plain"),  # whether the control says a target before it moves there
    "orient": ("refuse", "m19"),  # plans that turn the spindle; M19 R is not known of every build
}
SCHEMES: Mapping[str, str] = {"grbl+serial": "serial", "grbl+socket": "socket"}
FEED = 2000.0
HIGHEST = 60_000.0  # mm/min, where the machine states no rapid
POLL = 0.25  # s between two ?, while a line is being executed
CLOSE = 0.01  # mm or deg between target and the place that was reached
SAME = 0.0015  # mm: the control shows three places
ASIDE, TURNED = 0.5, 0.1  # mm beside the line of a measuring move, deg beside its angles: somewhere else
GENTLE = 60.0  # mm/min of the only move of a program, which a person makes possible by hand
LETS_GO = 20  # s for the hand that has touched the stylus
ENDLESS = (-math.inf, math.inf)


class Client(Control):
    """Drives one plan and collects its readings."""

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client. Raises InputError for a plan that the control cannot be told."""
        self._served = list(served(task.plan, "facet" if PROVING in task.program else "none"))
        self._moves = [move for move, _ in self._served]
        self._plain = options.get("targets", "confirmed") == "plain"
        self._orient = options.get("orient", "refuse") == "m19"
        run = task.run or task.plan  # a part may have one angle, and another than the part before
        self.fits(run, options)
        try:
            self._feed = float(options.get("feed", FEED))
        except ValueError:
            self._feed = 0.0
        self._feed = min(self._feed, GENTLE if task.plan.only is not None else math.inf)  # beside a hand
        fastest = max((axis.rapid or math.inf for axis in task.plan.machine.axes if axis.kind == "linear"), default=math.inf)
        if "feed" in options and not 0 < self._feed <= min(fastest, HIGHEST):
            raise InputError(
                f"grbl: feed: found {options['feed']!r}; allowed: mm/min above 0, at most {min(fastest, HIGHEST):g}, the "
                "fastest that a linear axis moves"
            )
        self._clamps = _grbl.clamps(task.program)
        if not self._plain:
            for number in self._clamps.values():
                targets.switch(number)
        self._touches = {touch.number: touch for touch in task.plan.touches}
        self._order = {number: i for i, number in enumerate(task.numbers)}
        self._at: dict[str, float] = {}
        self._travel = {axis.name: _ends(axis) for axis in task.plan.machine.axes}  # mm or deg
        self._goal: dict[str, float] = {}  # where each axis was sent to, by the scales of the machine
        self._set: dict[str, float] = {}  # parameters as the control has confirmed them
        self._searching = False  # whether the last motion was a search
        self._since, self._misses = 0.0, 0
        self._low = self._pressed = False
        super().__init__(task)

    @classmethod
    def fits(cls, plan: Plan, options: Mapping[str, str]) -> None:
        """plan of a run, {option: value of `OPTIONS`} → nothing. Raises InputError for a plan that turns the spindle unasked."""
        turns = len({touch.standoff[plan.machine.column("S")] for touch in plan.touches}) > 1
        if turns and options.get("orient", "refuse") != "m19":
            raise LacksSettingError(_grbl.TURNS, "orient=m19")

    @classmethod
    def hello(cls, options: Mapping[str, str]) -> bytes:
        """{option: value} → bytes that ask the control what it is and move nothing."""
        return _grbl.hello(options)

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
        """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
        return _grbl.told(data, options)

    @classmethod
    def busy(cls, data: bytes, options: Mapping[str, str]) -> str:
        """what came after `hello` → why nobody may begin here unattended; empty where it stands idle."""
        return _grbl.busy(data, options)

    @property
    def sent(self) -> tuple[int, int]:
        """→ (moves asked for, moves in all)."""
        return self._given, len(self._moves)

    def elapsed(self, seconds: float) -> list[Event]:
        """s since the last call → Failed when a line takes too long; asks for the status now and then."""
        events = super().elapsed(seconds)
        self._since += seconds
        if self._given and self._asked and not self._out and not self._over and self._since >= POLL:
            self._out, self._since = b"?", 0.0
        return events

    def _late(self) -> str:
        return f"acknowledged move {self._given} of {len(self._moves)}" if self._given else "answered"

    def _conversation(self) -> Talk:
        yield from self._look()
        if self._task.plan.only is not None:
            yield from self._say(f"({HOLD})")
        yield from self._report()
        if not self._plain:
            yield from self._able()
        yield from self._modes("G21 G90 G94 M5", self._plain)
        yield from self._where(start=True)
        self._ready = True
        self._goal = dict(self._at)
        yield from self._clear()
        self._events.append(Begun(self._task.mark, len(self._task.numbers)))
        before = gate(self._task.plan).before if TOUCH in self._task.program else -1  # one without the gate asks for no finger
        for number, (move, touch) in enumerate(self._served):
            if self._stopping:
                yield from self._leave()
            if number == before:
                yield from self._prove()
            self._allowed = self._task.patience[self._order[move.touch]]
            self._given += 1
            yield from self._make(move)
            self._low = low(move, touch, self._task.plan.machine)
        self._events.append(Ended(len(self._task.numbers)))

    def _prove(self) -> Talk:
        """A slow search up during which somebody touches the stylus, then back. Raises Stop when nobody has been noticed."""
        up = gate(self._task.plan)
        way = f"along {up.along}" if up.along else "up"
        self._events.append(Asked(f"{TOUCH} NOW: the probe moves {way} slowly for 20 s and has to notice it"))
        yield from self._say(f"({TOUCH})")
        flag, place = self._contact((yield from self._go(targets.SEARCH, self._linear(up.end), up.feed)))
        if not flag:
            raise Stop(
                "the stylus was not touched, or the probe did not notice it: is it on, its battery good, its cable at the input "
                "of the probe? Nothing has come near the table. Start again and touch it, or state gate: none"
            )
        self._at = place
        for _ in range(LETS_GO):
            fields = yield from self._report()
            if "P" not in fields.get("Pn", ""):
                break
            yield from self._say("G4P[1.]")
        flag, place = self._contact((yield from self._go(targets.SEARCH, self._linear(up.start), self._feed)))
        if flag:
            raise Stop(f"the stylus was touched once more on the way back, at {_shown(place)}: let go of it")
        yield from self._where()

    def _noticed(self, target: Mapping[str, float], touch: Touch) -> Talk:
        """The short search to the facet that proves the probe. Raises Stop when it meets nothing."""
        flag, place = self._contact((yield from self._go(targets.SEARCH, target, self._task.plan.strategy.approach.feed)))
        if not flag:
            raise Stop(
                f"the probe did not notice facet {touch.facet}: is it on, its battery good, its cable at the input of the probe, "
                "the table where it was? Nothing has been driven more than 0.5 mm against the table"
            )
        self._at, self._pressed = place, True
        yield from self._report()

    def _clear(self) -> Talk:
        """Where a run was cut off beside a facet the probe goes back as it came; straight up there may be an edge above it."""
        for touch in self._task.plan.touches:
            below = self._stands_between(touch.standoff, touch.end)
            if below or self._stands_between(touch.over, touch.standoff):
                if below:
                    yield from self._make(Move("back", self._linear(touch.standoff), touch.number))
                yield from self._make(Move("retract", self._linear(touch.over), touch.number))
                return

    def _report(self) -> Generator[str, str, dict[str, str]]:
        """Asks where the axes stand, until they do → the fields of the answer."""
        while True:
            answer = yield "?"
            while not answer.startswith("<"):
                if answer.startswith(("ALARM:", "error:")) or answer.lower().startswith("grbl"):
                    raise Stop(f"the control says {answer}")
                answer = yield ""
            fields = self._state(answer)
            if "MPos" not in fields:
                raise Stop("the control reports work positions: set $10=1, so that it reports machine positions")
            if fields["state"] == "Idle":
                self._at = self._numbers(fields["MPos"])
                return fields

    def _where(self, start: bool = False) -> Generator[str, str, None]:
        """Where the axes stand. Raises Stop when the probe signal is on.

        At the start it is asked twice, as a target may come of it, and the probe may be on because a run was cut off in contact:
        where a touch of this plan stands, it is drawn off.
        """
        fields = yield from self._report()
        if start:
            first = self._at
            fields = yield from self._report()
            if self._at != first:
                raise Stop(f"asked twice where it stands, it says {_shown(first)} and {_shown(self._at)}: the line is disturbed")
        if "P" not in fields.get("Pn", ""):
            return
        touch = next((touch for touch in self._task.plan.touches if start and self._on_its_line(touch)), None)
        if touch is not None:
            yield from self._off(touch)
        else:
            raise Stop("the probe signal is on although nothing is measured: is the probe free and alive?")

    def _make(self, move: Move) -> Generator[str, str, None]:
        target = {name: value if name in "XYZ" else math.degrees(value) for name, value in move.target.items()}
        angle = target.pop("S", None)
        if not self._orient:
            angle = None
        approach = self._task.plan.strategy.approach
        if move.kind == "probe":
            lines = yield from self._go(targets.SEARCH, target, approach.feed)
            yield from self._record(self._touches[move.touch], lines)
            return
        if move.kind == "prove":
            yield from self._noticed(target, self._touches[move.touch])
            return
        if move.kind == "find" and approach.find:
            self._pressed = bool(self._contact((yield from self._go(targets.SEARCH, target, approach.find.feed)))[0])
            yield from self._report()
            self._beside(self._touches[move.touch])
            return
        anyway = angle is not None or (move.kind == "index" and self._clamps)  # a run that was cut off may have left a clamp open
        if not anyway and not any(abs(self._aim(name, value) - self._at[name]) > SAME for name, value in target.items()):
            return
        if self._pressed:
            yield from self._off(self._touches[move.touch])
        if move.kind == "index":
            yield from self._index(target, angle)
        else:
            flag, place = self._contact((yield from self._go(targets.SEARCH, target, self._feed)))
            if flag:
                raise Stop(f"the probe tripped on the way to touch {move.touch}, at {_shown(place)}")
        yield from self._where()
        for name in target:
            if abs(self._at[name] - self._goal[name]) > CLOSE:
                raise Stop(
                    f"{name} stands at {self._at[name]:.4f} after it was sent to {self._goal[name]:.4f}: the control has ended the "
                    "move by itself, and has met nothing"
                )

    def _index(self, target: Mapping[str, float], angle: float | None) -> Talk:
        """{rotary axis: deg}, angle of the spindle → turned: together, or where there are clamps each between its words."""
        if not self._clamps:
            yield from self._go(targets.RAPID, target, self._feed, angle)
            return
        if angle is not None:
            yield from self._go(targets.RAPID, {}, self._feed, angle)
        for name in (name for name in self._task.plan.machine.rotary if name in target):
            yield from self._switch("UNCLAMP", name)
            yield from self._go(targets.RAPID, {name: target[name]}, self._feed)
            yield from self._switch("CLAMP", name)

    def _switch(self, key: str, axis: str) -> Talk:
        """CLAMP or UNCLAMP, axis letter → its word said to the control, if there is one."""
        number = self._clamps.get((key, axis))
        if number is None:
            return
        if self._plain:
            yield from self._say(f"M{number}")
            return
        for _ in range(2):  # one that has become another letter drops the word without a trace
            yield from self._go(targets.RAPID, {}, self._feed, word=targets.switch(number))

    def _go(
        self, code: float, target: Mapping[str, float], feed: float, angle: float | None = None, word: float | None = None
    ) -> Lines:
        """code of the motion, {axis: mm or deg}, mm/min, angle of the spindle, value of M → moved; what the control answers."""
        self._goal |= target
        if self._plain:
            return (yield from self._go_plainly(code, target, feed, angle))
        self._goal = {name: self._aim(name, self._goal[name]) for name in self._axes}
        values = {name: round(self._goal[name] - self._offset[name], 4) for name in self._axes}
        values |= {"F": targets.apart(feed), "G": code}
        if angle is not None:
            values |= {"M": targets.ORIENT, "R": targets.apart(angle % 360)}
        elif word is not None:
            values |= {"M": word}
        yield from self._confirm(values)
        lines = yield from self._say(targets.motion(tuple(values), self._searching))
        self._searching = code == targets.SEARCH
        if not self._searching:
            yield from self._say(targets.WAIT)
        return lines

    def _aim(self, axis: str, value: float) -> float:
        """axis, mm or deg by the scales of the machine → where it is sent for that."""
        if self._plain:
            return value
        off, (low, high) = self._offset[axis], self._travel.get(axis, ENDLESS)
        least = targets.WHOLE if axis in "XYZ" else targets.TURNED
        return targets.apart(value - off, least, (low - off, high - off)) + off

    def _go_plainly(self, code: float, target: Mapping[str, float], feed: float, angle: float | None) -> Lines:
        if angle is not None:
            yield from self._say(f"M19 R{angle % 360:.3f}")
            if not target:
                return []
        words = " ".join(f"{name}{value - self._offset[name]:.4f}" for name, value in target.items())
        if code == targets.SEARCH:
            return (yield from self._say(f"G38.3 {words} F{feed:g}"))
        lines = yield from self._say(f"G0 {words}")
        yield from self._say("G4 P0.01")
        return lines

    def _confirm(self, values: Mapping[str, float]) -> Generator[str, str, None]:
        """{letter: number} → set, and said by the control as it was meant. Raises Stop when it says anything else."""
        for line in targets.assignments({name: value for name, value in values.items() if self._set.get(name) != value}):
            yield from self._say(line)
        lines = yield from self._say(targets.question(tuple(values)))
        if not targets.confirmed(list(values.values()), lines):
            meant = " ".join(f"{name}{value:.4f}" for name, value in values.items())
            raise Stop(
                f"the control was sent {meant}, and says {' '.join(lines) or 'nothing'} before it moves: the line is disturbed"
            )
        self._set |= values

    def _able(self) -> Generator[str, str, None]:
        """Raises Stop when this control cannot confirm targets."""
        try:
            yield from self._confirm({"F": targets.apart(self._feed), "G": targets.SEARCH})
        except Stop as reason:
            raise Stop(targets.CANNOT.format(reason)) from None

    def _contact(self, lines: Sequence[str]) -> tuple[int, dict[str, float]]:
        """lines of an answer → flag and place of its one `[PRB:…]`. Raises Stop when there is none: an ok that answers nothing."""
        found = [line for line in lines if line.startswith("[PRB:")]
        values, _, flag = found[0].strip("[]")[4:].rpartition(":") if len(found) == 1 else ("", "", "")
        if flag not in ("0", "1"):
            raise Stop(
                f"a probing move was answered with {' '.join([*lines, 'ok'])!r}, without one [PRB:…]: an ok too many, "
                "or lost, or a grblHAL whose $10 lacks the 128 that reports probe coordinates"
            )
        return int(flag), self._numbers(values)

    def _record(self, touch: Touch, lines: list[str]) -> Generator[str, str, None]:
        flag, place = self._contact(lines)
        again, same = self._contact([line for line in (yield from self._say("$#")) if line.startswith("[PRB:")])
        text = f"P{touch.number} H{flag} {_shown(place)}"
        if again != flag or (flag and any(abs(same[name] - place[name]) > 1e-9 for name in place)):
            self._events.append(Refused(f"asked once more, the control says H{again} {_shown(same)}", text))
            yield from self._where(start=True)  # flag and place are of no use, where it stands is
            self._pressed = False
            return
        if flag and not self._plain:
            fed = yield from self._say(targets.FED)
            if not targets.confirmed([targets.apart(self._task.plan.strategy.approach.feed)], fed):
                raise Stop(
                    f"touch {touch.number} was made at another feed, the control says {' '.join(fed)}: the line is disturbed"
                )
        machine = self._task.plan.machine
        self._pressed, self._at = flag == 1, place
        if flag == 0:  # what a miss shows is the contact before on some controls: where it stands counts
            yield from self._where()
            away = max(abs(self._at[name] - self._goal[name]) for name in machine.linear)
            if away > CLOSE:
                raise Stop(f"touch {touch.number} met nothing and ends at {_shown(self._at)}, {away:.3f} mm from where it was sent")
        named = {name: self._at[name] for name in (*machine.linear, *machine.rotary)}
        self._events.append(Touched(touch.number, flag, named, text))
        if flag:
            self._beside(touch)
        self._misses = 0 if flag else self._misses + 1
        if self._misses >= self._task.misses:
            raise Stop(f"{self._misses} touches in a row without contact: is the probe alive?")

    def _beside(self, touch: Touch) -> None:
        """Raises Stop when the axes stand anywhere else than on the measuring move of the touch."""
        if not self._on_its_line(touch):
            raise Stop(f"{_shown(self._at)} is not on the line of the measuring move of touch {touch.number}: look at the machine")

    def _on_its_line(self, touch: Touch) -> bool:
        """touch → whether the axes stand somewhere on its measuring move."""
        return self._stands_between(touch.standoff, touch.end)

    def _linear(self, place: Sequence[float]) -> dict[str, float]:
        machine = self._task.plan.machine
        return {name: place[machine.column(name)] for name in machine.linear}

    def _stands_between(self, start: Sequence[float], end: Sequence[float]) -> bool:
        """two places of the plan (k,) mm rad → whether the axes stand on the straight way between, at the angles of its end."""
        machine = self._task.plan.machine
        a, b = (list(self._linear(place).values()) for place in (start, end))
        here = [self._at[name] for name in machine.linear]
        length = math.dist(a, b)
        if length < SAME:
            return False
        way = sum((h - p) * (q - p) for h, p, q in zip(here, a, b, strict=True)) / length
        foot = [p + way / length * (q - p) for p, q in zip(a, b, strict=True)]
        angles = [self._at[name] - math.degrees(end[machine.column(name)]) for name in machine.rotary]
        turned = max((abs(math.remainder(angle, 360.0)) for angle in angles), default=0.0)
        return math.dist(here, foot) <= ASIDE and -ASIDE <= way <= length + ASIDE and turned <= TURNED

    def _off(self, touch: Touch) -> Generator[str, str, None]:
        """The probe touches → it is drawn off the way it came, so far that it is free. Raises Stop when its signal stays on."""
        machine = self._task.plan.machine
        columns = [machine.column(name) for name in machine.linear]
        away = [touch.standoff[i] - touch.contact[i] for i in columns]
        steps = {name: OFF * value / math.hypot(*away) for name, value in zip(machine.linear, away, strict=True)}
        if self._plain:
            yield from self._modes("G21 G91", True)
            words = " ".join(f"{name}{value:.2f}" for name, value in steps.items() if abs(value) >= 0.005)
            yield from self._say(f"G1 {words} F{self._feed:g}")
            yield from self._say("G4 P0.01")
            yield from self._modes("G90", True)
        else:
            self._goal = {**self._at, **{name: self._goal[name] for name in machine.rotary if name in self._goal}}
            yield from self._go(targets.FEED, {name: self._at[name] + step for name, step in steps.items()}, self._feed)
        self._pressed = False
        yield from self._where()

    def _leave(self) -> Generator[str, str, None]:
        """Draws the probe clear when it is down at a facet, and ends the conversation."""
        if self._low:
            last = self._moves[self._given - 1]
            touch = self._touches[last.touch]
            if last.kind in ("find", "near", "probe"):
                yield from self._make(Move("back", self._linear(touch.standoff), last.touch))
            yield from self._make(Move("retract", self._linear(touch.over), last.touch))
        raise Stop("stopped by the user; the probe has been drawn clear")


def _shown(place: Mapping[str, float]) -> str:
    return " ".join(f"{name}{value:.4f}" for name, value in place.items())


def _ends(axis: Axis) -> tuple[float, float]:
    """axis → the ends of its travel, mm or deg."""
    low, high = axis.travel or ENDLESS
    return (low, high) if axis.kind == "linear" else (math.degrees(low), math.degrees(high))
