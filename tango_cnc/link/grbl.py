"""grbl 1.1, grblHAL, FluidNC: one line in flight, each waited for; the plan goes out move by move, the status is asked meanwhile.

    $I $$ $G $# ? ▶ { G38.3 guarded moves · G0 rotary axes · G38.3 measuring, $# once more, G91 G1 off the facet } per touch

The facts are of the sources of grbl and grblHAL: a probing move ends in `[PRB:…:1]` or `:0`, then `ok`; the flag decides, as
some report the contact before when they miss. Its numbers are machine coordinates, in inches when `$13` says so, whatever G21
says. A probe that is on when a search begins is ALARM:4 without `[PRB]`. CR LF would be answered twice, so lines end with LF;
an `ok` that answers nothing is found by the `[PRB]` that is missing before it and by the place that is asked for after
every move. Positioning is a probing move as well, so that it stops when the probe trips. Targets are work coordinates:
machine minus work offset, G92 and tool length as the control lists them. The line has no check sums, and a control has obeyed
a line with a lost digit before anybody can know. Therefore no line can do harm with one character wrong: what moves the
linear axes is stopped by the probe, except the move off a facet, which is short and relative, as `$G` has confirmed before;
the place is compared after every move, and where it is not the right one nothing more is sent.
"""

from __future__ import annotations

import math
import re
from collections.abc import Generator, Mapping, Sequence

from ..records import InputError, Move, Touch
from ._client import Begun, Ended, Event, Identified, Job, Refused, Touched
from ._dialogue import Dialogue, Stop, Talk, low
from ._grbl import ALARMS, ERRORS
from ._grbl import hello as hello
from ._grbl import told as told

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "feed": (),  # mm/min of guarded moves
    "orient": ("refuse", "m19"),  # plans that turn the spindle; M19 R is not known of every build
}
FEED = 2000.0
POLL = 0.25  # s between two ?, while a line is being executed
CLOSE = 0.01  # mm or deg between target and the place that was reached
SAME = 0.0015  # mm: the control shows three places
OFF = 1.5  # mm of the move off a facet: with a wrong sign the stylus still gives way
ASIDE, TURNED = 0.5, 0.1  # mm beside the line of a measuring move, deg beside its angles: somewhere else
MISSES = 3  # touches in a row without contact: a probe that is dead guards nothing
INCH = 25.4
LETTERS = "XYZABC"
FRAMES = re.compile(r"\bG5[4-9](?:\.[1-3])?\b")
Lines = Generator[str, str, list[str]]


class Client(Dialogue):
    """Drives one plan and collects its readings."""

    def __init__(self, job: Job, options: Mapping[str, str]) -> None:
        """job, {option: value of `OPTIONS`} → client. Raises InputError for a plan that the control cannot be told."""
        self._job, self._moves = job, list(job.plan.moves)
        self._orient = options.get("orient", "refuse") == "m19"
        if not self._orient and len({touch.standoff[job.plan.machine.column("S")] for touch in job.plan.touches}) > 1:
            raise InputError("grbl: found a plan that turns the spindle; allowed: one angle S, or orient=m19 in the port's URL")
        try:
            self._feed = float(options.get("feed", FEED))
        except ValueError:
            self._feed = 0.0
        if not 0 < self._feed < math.inf:
            raise InputError(f"grbl: feed: found {options['feed']!r}; allowed: mm/min greater than 0")
        self._touches = {touch.number: touch for touch in job.plan.touches}
        self._order = {number: i for i, number in enumerate(job.numbers)}
        self._axes: tuple[str, ...] = ("X", "Y", "Z")
        self._unit = 1.0
        self._offset: dict[str, float] = {}
        self._at: dict[str, float] = {}
        self._given, self._since, self._misses = 0, 0.0, 0
        self._low = self._pressed = False
        super().__init__(job.start_patience)

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
        yield from self._where(start=True)
        yield from self._modes("G21 G90 G94")
        yield from self._clear()
        self._events.append(Begun(self._job.mark, len(self._job.numbers)))
        for move in self._moves:
            if self._stopping:
                yield from self._leave()
            self._allowed = self._job.patience[self._order[move.touch]]
            self._given += 1
            yield from self._make(move)
            self._low = low(move, self._touches[move.touch], self._job.plan.machine)
        self._events.append(Ended(len(self._job.numbers)))

    def _clear(self) -> Talk:
        """Where a run was cut off beside a facet the probe goes back as it came; straight up there may be an edge above it."""
        for touch in self._job.plan.touches:
            below = self._stands_between(touch.standoff, touch.end)
            if below or self._stands_between(touch.over, touch.standoff):
                if below:
                    yield from self._make(Move("back", self._linear(touch.standoff), touch.number))
                yield from self._make(Move("retract", self._linear(touch.over), touch.number))
                return

    def _look(self) -> Talk:
        """Who is there, with which axes, units and offsets; raises Stop when it cannot do the plan."""
        who = yield from self._say("$I")  # what a run that was cut off left in the control's buffer is no line any more with $
        for line in who:
            if found := re.fullmatch(r"\[AXS:\d+:([A-Z]+)\]", line):
                self._axes = tuple(found[1])
        settings = yield from self._twice("$$")
        if "$13=1" in settings:
            self._unit = INCH
        modes = " ".join((yield from self._say("$G")))
        frame = FRAMES.search(modes)
        if frame is None:
            raise Stop(f"the control does not say which work offset is active: {modes!r}")
        listed = yield from self._twice("$#")
        if not any(line.startswith("[AXS:") for line in who):  # grbl 1.1 and FluidNC do not name their axes: they are in this order
            count = next((line.count(",") + 1 for line in listed if line.startswith(f"[{frame[0]}:")), len(self._axes))
            self._axes = tuple(LETTERS[:count])
        missing = [name for name in (*self._job.plan.machine.linear, *self._job.plan.machine.rotary) if name not in self._axes]
        if missing:
            raise Stop(f"the control has the axes {' '.join(self._axes)}; the plan moves {' '.join(missing)} as well")
        self._offset = dict.fromkeys(self._axes, 0.0)
        for line in listed:
            name, _, rest = line.strip("[]").partition(":")
            if name in (frame[0], "G92"):
                self._add(self._numbers(rest))
            elif name == "TLO":
                values = rest.split(",")
                self._add(self._numbers(rest) if len(values) > 1 else {"Z": float(values[0]) * self._unit})
        self._events.append(Identified(f"{' '.join(who)} {'inches' if self._unit != 1 else 'mm'}, {frame[0]}"))

    def _twice(self, line: str) -> Lines:
        """question → its answer. Raises Stop when the second one is another: a digit of it would shift every target."""
        first = yield from self._say(line)
        if (yield from self._say(line)) != first:
            raise Stop(f"asked twice, {line} is answered differently: the line is disturbed")
        return first

    def _modes(self, line: str) -> Lines:
        """modal words → set, and confirmed by the control. Raises Stop when it says otherwise."""
        yield from self._say(line)
        said = yield from self._say("$G")
        words = " ".join(said).strip("[]").split(":")[-1].split()
        if not set(line.split()) <= set(words):
            raise Stop(f"the control was told {line} and says {' '.join(said)}")
        return said

    def _add(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self._offset[name] += value

    def _numbers(self, text: str) -> dict[str, float]:
        """'1.000,2.000,…' → {axis: mm or deg}. Raises Stop for anything else."""
        try:
            values = [float(number) for number in text.split(",")]
            pairs = dict(zip(self._axes, values, strict=True))
        except ValueError:
            raise Stop(f"found {text!r} where {len(self._axes)} numbers were due: the line is disturbed") from None
        return {name: value * (self._unit if name in "XYZ" else 1.0) for name, value in pairs.items()}

    def _say(self, line: str) -> Lines:
        """one line → what came before its ok. Raises Stop for errors, alarms, resets, an open door."""
        found: list[str] = []
        answer = yield line
        while answer != "ok":
            if answer.startswith("error:"):
                raise Stop(f"the control refuses {line!r}: {answer} ({ERRORS.get(answer[6:], 'see its list of errors')})")
            if answer.startswith("ALARM:"):
                raise Stop(f"the control is in alarm: {answer} ({ALARMS.get(answer[6:], 'see its list of alarms')})")
            if answer.lower().startswith("grbl"):
                if self._given:
                    raise Stop(f"the control has been reset: {answer}")
                found, answer = [], (yield line)
                continue
            if answer.startswith("<"):
                self._state(answer)
            elif answer:
                found.append(answer)
            answer = yield ""
        self._done()
        return found

    def _state(self, report: str) -> dict[str, str]:
        """'<Idle|MPos:…|…>' → its fields. Raises Stop in a state that lets nothing move."""
        state, *fields = report.strip("<>").split("|")
        word = state.partition(":")[0]
        if word in ("Alarm", "Door", "Sleep", "Hold", "Check", "Tool"):
            raise Stop(f"the control cannot move: its state is {state}")
        return {"state": word} | {name: rest for name, _, rest in (field.partition(":") for field in fields)}

    def _where(self, start: bool = False) -> Generator[str, str, None]:
        """Asks where the axes stand, until they do. Raises Stop when the probe signal is on.

        At the start it may be on because a run was cut off in contact: where a touch of this plan stands, the probe is drawn off.
        """
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
                break
        self._at = self._numbers(fields["MPos"])
        if "P" not in fields.get("Pn", ""):
            return
        touch = next((touch for touch in self._job.plan.touches if start and self._on_its_line(touch)), None)
        if touch is not None:
            yield from self._off(touch)
        else:
            raise Stop("the probe signal is on although nothing is measured: is the probe free and alive?")

    def _make(self, move: Move) -> Generator[str, str, None]:
        target = {name: value if name in "XYZ" else math.degrees(value) for name, value in move.target.items()}
        angle = target.pop("S", None)
        if angle is not None and self._orient:
            yield from self._say(f"M19 R{angle % 360:.3f}")
        away = {name: value for name, value in target.items() if abs(value - self._at[name]) > SAME}
        words = " ".join(f"{name}{value - self._offset[name]:.4f}" for name, value in target.items())
        if move.kind == "probe":
            lines = yield from self._say(f"G38.3 {words} F{self._job.plan.strategy.approach.feed:g}")
            yield from self._record(self._touches[move.touch], lines)
            return
        if not away:
            return
        if self._pressed:
            yield from self._off(self._touches[move.touch])
        if move.kind == "index":
            yield from self._say(f"G0 {words}")
            yield from self._say("G4 P0.01")
        else:
            flag, place = self._contact((yield from self._say(f"G38.3 {words} F{self._feed:g}")))
            if flag:
                raise Stop(f"the probe tripped on the way to touch {move.touch}, at {_shown(place)}")
        yield from self._where()
        for name, value in target.items():
            if abs(self._at[name] - value) > CLOSE:
                raise Stop(f"{name} stands at {self._at[name]:.4f} after it was sent to {value:.4f}")

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
        machine = self._job.plan.machine
        self._pressed, self._at = flag == 1, place
        if flag == 0:  # what a miss shows is the contact before on some controls: where it stands counts
            yield from self._where()
            away = max(abs(self._at[name] - touch.end[machine.column(name)]) for name in machine.linear)
            if away > CLOSE:
                raise Stop(f"touch {touch.number} met nothing and ends at {_shown(self._at)}, {away:.3f} mm from where it was sent")
        named = {name: self._at[name] for name in (*machine.linear, *machine.rotary)}
        self._events.append(Touched(touch.number, flag, named, text))
        if flag and not self._on_its_line(touch):
            raise Stop(f"{_shown(place)} is not on the line of the measuring move of touch {touch.number}: look at the machine")
        self._misses = 0 if flag else self._misses + 1
        if self._misses >= MISSES:
            raise Stop(f"{MISSES} touches in a row without contact: is the probe alive?")

    def _on_its_line(self, touch: Touch) -> bool:
        """touch → whether the axes stand somewhere on its measuring move."""
        return self._stands_between(touch.standoff, touch.end)

    def _linear(self, place: Sequence[float]) -> dict[str, float]:
        machine = self._job.plan.machine
        return {name: place[machine.column(name)] for name in machine.linear}

    def _stands_between(self, start: Sequence[float], end: Sequence[float]) -> bool:
        """two places of the plan (k,) mm rad → whether the axes stand on the straight way between, at the angles of its end."""
        machine = self._job.plan.machine
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
        machine = self._job.plan.machine
        columns = [machine.column(name) for name in machine.linear]
        away = [touch.standoff[i] - touch.contact[i] for i in columns]
        steps = {name: OFF * value / math.hypot(*away) for name, value in zip(machine.linear, away, strict=True)}
        yield from self._modes("G21 G91")
        words = " ".join(f"{name}{value:.2f}" for name, value in steps.items() if abs(value) >= 0.005)
        yield from self._say(f"G1 {words} F{self._feed:g}")
        yield from self._say("G4 P0.01")
        yield from self._modes("G90")
        self._pressed = False
        yield from self._where()

    def _leave(self) -> Generator[str, str, None]:
        """Draws the probe clear when it is down at a facet, and ends the conversation."""
        if self._low:
            last = self._moves[self._given - 1]
            touch = self._touches[last.touch]
            if last.kind == "probe":
                yield from self._make(Move("back", self._linear(touch.standoff), last.touch))
            yield from self._make(Move("retract", self._linear(touch.over), last.touch))
        raise Stop("stopped by the user; the probe has been drawn clear")


def _shown(place: Mapping[str, float]) -> str:
    return " ".join(f"{name}{value:.4f}" for name, value in place.items())
