"""What the axes do, whatever language told them to: moves with their contacts, the simulated clock, the record of touches."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NoReturn

import numpy as np

from tango_cnc.records import Array

from . import clock, effects, probing, surfaces
from .bystanders import first_strike
from .faults import Faults
from .probing import Rig, gap_along, rows_of, undisturbed
from .roots import bracketed_zero
from .search import first_contact
from .shank import STYLUS, Entry, first_entry
from .world import place

STILL = 1e-9  # mm or rad: less is rounding, not a motion
LATENCY = 0.001  # s between trigger and the beginning of the stop
DECELERATION = 2000.0  # mm/s²
RELEASE = 0.003  # mm beyond the trigger point at which the stylus is free again
BEND = 2.0  # mm that the stylus gives way before it breaks
ASKED = "TOUCH THE STYLUS"  # on the screen: whoever stands there does so in the move that follows
HOLD = "HOLD THE STYLUS ASIDE"  # whoever stands there does so until the program has ended
FAST = 500.0  # mm/min, above which a probe that chatters at the end of a move has no time to
FINGER = 2.0  # s that a finger stays at the stylus
NEAR = 1.0  # mm around the undisturbed contact in which effects may move it

Note = Callable[..., None]
What = int | Entry  # what is met: by the ball, the number of a surface; else which part of the probe enters what


Wiring = Literal[
    "alive", "dead", "other", "inverted", "chatter"
]  # other: the probe is wired to an input that this control does not look at


class MotionStop(Exception):
    """The motion ended where it was not told to: `cause` is collision, overtravel or fault."""

    def __init__(self, cause: str, text: str, axis: str = "", sign: int = 0) -> None:
        super().__init__(text)
        self.cause, self.axis, self.sign = cause, axis, sign


@dataclass(frozen=True)
class Skip:
    """A probing move: whether the probe triggered, where (k,) mm rad the axes were then, whether it was deflected before."""

    hit: bool
    position: Array
    already: bool = False


@dataclass(frozen=True)
class _Pressed:
    """The stylus is deflected by this; `gap` mm is what is geometrically left of a surface."""

    what: What
    gap: float


@dataclass(frozen=True)
class _Contact:
    """One contact as the effects have to know it."""

    row: int
    position: Array
    direction: Array
    move: Array
    time: float
    feed: float


class Motion:
    """The moving machine. Positions are mm and rad in the order of `Machine.names`; `wait` is called with simulated seconds."""

    def __init__(
        self,
        rig: Rig,
        note: Note = lambda event, **data: None,
        wait: Callable[[float], None] = lambda s: None,
        faults: Faults | None = None,
        person: bool = True,
        probe: Wiring = "alive",
        slack: Mapping[str, float] | None = None,
        begins_deflected: bool = False,
        miss_stops: bool = False,
        override: float = 1.0,
        dry_run: float | None = None,
        skip_obeys: bool = False,
        latches: bool = True,
        short_way: tuple[str, ...] = (),
        block_time: float = 0.0,
        stands: Mapping[str, float] | None = None,
    ) -> None:
        self.rig, self.machine = rig, rig.machine
        self.time = 0.0
        self.touches = 0
        self._note, self._wait = note, wait
        self._faults = faults or Faults()
        self._position = probing.home(rig.machine)
        for name, value in (stands or {}).items():  # mm where somebody has left a linear axis
            self._position[rig.machine.column(name)] = value
        self._direction = np.ones(len(rig.machine.names))
        self._move = np.zeros(len(rig.machine.names))
        self._pressed: _Pressed | None = None
        self._stuck = self._bounce = self._reset = False
        self._contacts: list[_Contact] = []
        self._person, self._probe, self._wired = person, probe, probe
        self._slack = {name: math.radians(value) for name, value in (slack or {}).items()}  # a brake holds the axis back, deg
        self._begins_deflected = begins_deflected  # a probing move looks for an edge of the signal: one that is on changes nothing
        self._miss_stops = miss_stops  # a probing move that meets nothing is an alarm
        self._override, self._dry_run = override, dry_run  # of the panel: a factor, mm/min that dry run puts in place of F
        self._skip_obeys = skip_obeys  # whether they act on probing moves: on most controls they do not (M700V p. 547; 6200#7 SKF)
        self._latches = latches  # the position of a contact is stored at the trigger; else it is that after the stop
        self._short_way = short_way  # rotary axes that go to an angle by the nearer way, over 360 deg
        self._block_time = block_time  # s that the control thinks before each motion
        self._aside = False  # somebody holds the stylus
        self._asked, self._held = False, -1.0  # the screen asks for a finger; until when one is at the stylus, s

    def panel(self, override: float = 1.0, dry_run: float | None = None, skip_obeys: bool = False) -> None:
        """Somebody turns the feed override, a factor; `dry_run`: mm/min in place of every F; whether probing moves obey them."""
        self._override, self._dry_run, self._skip_obeys = override, dry_run, skip_obeys

    def freed(self) -> None:
        """The word that opens a brake was carried out: nothing holds a rotary axis back any more."""
        self._slack = {}

    def watches(self, wired: bool) -> None:
        """Whether the input that the control looks at is the one that the probe is wired to."""
        self._probe = self._wired if wired else "other"

    def reads(self, text: str) -> None:
        """What stands on the screen now: a person who is there does what it says."""
        self._asked |= self._person and ASKED in text
        self._aside |= self._person and HOLD in text

    def lets_go(self) -> None:
        """The program has ended: nobody holds the stylus any more."""
        self._aside = False

    @property
    def position(self) -> Array:
        """→ (k,) mm rad, where the axes stand by their own scales."""
        return self._position.copy()

    @property
    def deflected(self) -> bool:
        """→ whether the probe signal is on."""
        on = self._pressed is not None or self._stuck or self._aside or self.time < self._held
        return {"alive": on, "dead": False, "other": False, "inverted": not on, "chatter": on}[self._probe]

    def rapid(self, target: Mapping[str, float], *, straight: bool = True) -> None:
        """{axis: mm rad} → goes there. `straight` False: every axis at its own rapid, the short ways first done.

        Raises MotionStop when the probe trips or an axis would leave its travel.
        """
        end = self._end(target)
        for name in self._slack.keys() & target.keys():
            end[self.machine.column(name)] += self._slack[name]
        for corner in [end] if straight else self._corners(end):
            seconds = float(clock.rapid_time(self.machine, (corner - self._position)[None])[0])
            self._positioning("rapid", corner, seconds)
        self._rolled(target)

    def feed(self, target: Mapping[str, float], feed: float) -> None:
        """{axis: mm rad}, mm/min (deg/min when only rotary axes move) → goes there. Raises MotionStop as `rapid`."""
        end = self._end(target)
        self._positioning("feed", end, self._length(end) / (self._dialled(feed) / 60))
        self._rolled(target)

    def skip(self, target: Mapping[str, float], feed: float, *, elsewhere: bool = False) -> Skip:
        """{axis: mm rad}, mm/min → moves until the probe triggers, at most there. Raises MotionStop outside the travel.

        The move overruns the trigger by latency and deceleration; a probe that is deflected before it starts ends it at once.
        `elsewhere`: the move listens to another input than that of the probe.
        """
        if elsewhere and self._probe != "other":
            wired, self._probe = self._probe, "other"
            try:
                return self.skip(target, feed)
            finally:
                self._probe = wired
        end = self._end(target)
        feed = self._dialled(feed) if self._skip_obeys else feed
        if self._asked and not self.deflected:
            self._asked = False
            return self._fingered(end, feed)
        if (self.deflected and not self._begins_deflected) or self._bounce:
            self._bounce = False
            self._note("skip", result="already deflected", **self._shown())
            return Skip(True, self.position, already=True)
        start, direction = self._position, self._turned(end)
        met = self._meets(end, direction, 0.0)
        length = self._length(end)
        s: float | None = None
        if met is not None and self._probe in ("dead", "other"):
            return self._unnoticed(end, direction, *met, length / (feed / 60))
        if met is not None:
            s, what = met
            if not isinstance(what, Entry):
                s = self._disturbed(start, end, direction, s, what, length / (feed / 60), feed)
            elif what.part != STYLUS:
                self._collide("skip", end, s, what, length / (feed / 60))
        if met is None or s is None:
            self._arrive(end, length / (feed / 60))
            self._note("skip", result="miss", **self._shown())
            if self._miss_stops:
                raise MotionStop("fault", "skip not reached: the probing move met nothing")
            return Skip(self._probe == "chatter" and feed < FAST, self.position)
        trigger = start + s * (end - start)
        speed = feed / 60
        overrun = (speed * LATENCY + speed**2 / (2 * DECELERATION)) / length if length > 0 else 0.0
        stop = start + min(1.0, s + overrun) * (end - start)
        self._arrive(stop, s * length / speed)
        self._press(what, stop, direction)
        self.touches += 1
        self._note("contact", touch=self.touches, surface=self._name(what), at=self._table(trigger), **self._shown())
        fault = self._faults.after_touch(self.touches)
        if fault == "stuck":
            self._stuck = True
        elif fault == "bounce":
            self._bounce = True
        elif fault == "reset":
            self._reset = True
        elif fault is not None:
            raise MotionStop("fault", fault)
        return Skip(True, trigger if self._latches else self.position)

    def _dialled(self, feed: float) -> float:
        """mm/min of a program → what the switches of the panel make of it."""
        return (self._dry_run or feed) * self._override

    def _unnoticed(self, end: Array, direction: Array, s: float, what: What, seconds: float) -> Skip:
        """A probing move with a probe that says nothing: the stylus gives way as far as it can. Raises MotionStop beyond that."""
        if isinstance(what, Entry) or float(self._gaps(what, end[None], direction)[0]) < -BEND:
            self._collide("skip", end, s, what, seconds)
        self._arrive(end, seconds)
        self._press(what, end, direction)
        self._note("bent", surface=self._name(what), depth=-self._pressed.gap if self._pressed else 0.0, **self._shown())
        self._note("skip", result="miss", **self._shown())
        return Skip(False, self.position)

    def _fingered(self, end: Array, feed: float) -> Skip:
        """A probing move during which somebody touches the stylus half way."""
        start, length, speed = self._position, self._length(end), feed / 60
        if self._probe in ("dead", "other"):
            self._arrive(end, length / speed)
            self._note("skip", result="miss", finger=True, **self._shown())
            return Skip(False, self.position)
        trigger = start + 0.5 * (end - start)
        overrun = (speed * LATENCY + speed**2 / (2 * DECELERATION)) / length if length > 0 else 0.0
        self._arrive(start + min(1.0, 0.5 + overrun) * (end - start), 0.5 * length / speed)
        self._held = self.time + FINGER
        self._note("finger", at=self._table(trigger), **self._shown())
        return Skip(True, trigger)

    def dwell(self, seconds: float) -> None:
        """s → the clock goes on."""
        self.time += seconds
        self._wait(seconds)

    def set_position(self, axis: str, value: float) -> None:
        """axis, rad → the scale of a rolling-over axis reads this from now on; nothing moves."""
        self._position = self._position.copy()
        self._position[self.machine.column(axis)] = value

    def _end(self, target: Mapping[str, float]) -> Array:
        end = self._position.copy()
        for name, value in target.items():
            end[self.machine.column(name)] = value
        for axis, value in zip(self.machine.axes, end, strict=True):
            if axis.travel is not None and not axis.travel[0] - 1e-6 <= value <= axis.travel[1] + 1e-6:
                sign = 1 if value > axis.travel[1] else -1
                raise MotionStop("overtravel", f"{axis.name} would leave its travel", axis.name, sign)
        for name in target.keys() & set(self._short_way):
            column = self.machine.column(name)
            end[column] = self._position[column] + math.remainder(end[column] - self._position[column], math.tau)
        return end

    def _rolled(self, target: Mapping[str, float]) -> None:
        """An axis that went the nearer way shows the angle that it was sent to."""
        for name in target.keys() & set(self._short_way):
            self.set_position(name, target[name])

    def _corners(self, end: Array) -> list[Array]:
        """→ the corners of a path on which every axis runs at its own rapid until it has arrived."""
        change = end - self._position
        speed = np.array([axis.rapid or clock.RAPID[axis.kind] for axis in self.machine.axes])
        times = np.abs(change) / speed
        moving = np.unique(times[np.abs(change) > STILL])
        return [np.where(times <= t, end, self._position + np.sign(change) * speed * t) for t in moving]

    def _length(self, end: Array) -> float:
        change = end - self._position
        linear = [self.machine.column(name) for name in self.machine.linear]
        millimetres = float(np.linalg.norm(change[linear]))
        return millimetres if millimetres > STILL else float(np.degrees(np.abs(change).max()))

    def _turned(self, end: Array) -> Array:
        change = end - self._position
        return np.where(np.abs(change) > STILL, np.sign(change), self._direction)

    def _positioning(self, kind: str, end: Array, seconds: float) -> None:
        direction = self._turned(end)
        if self._reset:
            self._reset = False
            self._arrive((self._position + end) / 2, seconds / 2)
            self._note("reset", **self._shown())
            raise MotionStop("fault", "reset")
        met = self._meets(end, direction, 0.0) if self._pressed is None else self._leave(end, direction)
        if met is not None:
            self._collide(kind, end, *met, seconds)
        self._arrive(end, seconds)
        self._note(kind, **self._shown())

    def _meets(self, end: Array, direction: Array, after: float) -> tuple[float, What] | None:
        """→ where on the move from here (s, not before `after`) the probe meets something first, and what."""
        r = self.rig
        ball = first_contact(r, self._position, end, direction, after)
        until = 1.0 if ball is None else ball[0]
        entry = first_entry(r.shank, r.true, self._position, end, direction, after, until)
        struck = first_strike(r.bystanders, r.true, self._position, end, direction, after, until if entry is None else entry.s)
        entry = struck or entry
        return ball if entry is None else (entry.s, entry)

    def _collide(self, kind: str, end: Array, s: float, what: What, seconds: float) -> NoReturn:
        """Stops there, on the record as a collision. Raises MotionStop."""
        stop = self._position + s * (end - self._position)
        direction = self._turned(end)
        self._arrive(stop, s * seconds)
        self._press(what, stop, direction)
        felt = not isinstance(what, Entry) or what.part == STYLUS
        how = f"probe tripped during a move that is not a probing move ({kind}, on" if felt else f"collision ({kind}, of"
        self._note("collision", surface=self._name(what), at=self._table(stop), move=kind, **self._shown())
        raise MotionStop("collision", f"{how} {self._name(what)})")

    def _press(self, what: What, stop: Array, direction: Array) -> None:
        """What holds the stylus deflected from here on."""
        gap = 0.0 if isinstance(what, Entry) else float(self._gaps(what, stop[None], direction)[0])
        self._pressed = _Pressed(what, gap)

    def _leave(self, end: Array, direction: Array) -> tuple[float, What] | None:
        """→ what a move meets that starts with the stylus deflected: it must let go before it meets anything."""
        assert self._pressed is not None
        change, what = end - self._position, self._pressed.what
        finest = min(0.5, 0.001 / max(self._length(end), STILL))
        s = np.concatenate([[0.0], np.geomspace(finest, 1.0, 60)])
        positions = self._position + s[:, None] * change
        if isinstance(what, Entry):
            bent = s * self._length(end) <= BEND
            free = np.array([self._entered(p, direction) is None for p in positions[bent]])
            if not free.any() and not bent.all():
                return float(s[bent][-1]), what
        else:
            gaps = self._gaps(what, positions, direction)
            free = gaps > max(self._pressed.gap, 0.0) + RELEASE
            first = int(np.argmax(free)) if free.any() else len(gaps) - 1
            if gaps[: first + 1].min() < self._pressed.gap - BEND:
                return float(s[int(np.argmin(gaps[: first + 1]))]), what
        if not free.any():
            return None
        self._pressed = None
        return self._meets(end, direction, float(s[int(np.argmax(free))]))

    def _entered(self, position: Array, direction: Array) -> Entry | None:
        """→ what anything is in, standing there."""
        r = self.rig
        within = first_entry(r.shank, r.true, position, position, direction)
        return within or first_strike(r.bystanders, r.true, position, position, direction, 0.0, 1.0)

    def _gaps(self, row: int, positions: Array, direction: Array) -> Array:
        tip = place(self.rig.true, positions, np.broadcast_to(direction, positions.shape)).tip
        return surfaces.gaps(self.rig.surfaces, tip)[:, row]

    def _arrive(self, end: Array, seconds: float) -> None:
        change = end - self._position
        moved = np.abs(change) > STILL
        self._direction = np.where(moved, np.sign(change), self._direction)
        self._move = np.where(moved, change, self._move)
        self._position = end.copy()
        self.dwell(seconds + self._block_time)

    def _disturbed(
        self, start: Array, end: Array, direction: Array, s: float, row: int, seconds: float, feed: float
    ) -> float | None:
        """→ where on the move the probe really triggers, with effects and noise; None when the move ends before."""
        r = self.rig
        if row >= len(r.surfaces.facets) or not (r.effects or r.noise):
            return s
        change = end - start
        move = np.where(np.abs(change) > STILL, s * change, self._move)
        self._contacts.append(_Contact(row, start + s * change, direction, move, self.time + s * seconds, feed))
        disturbance = self._last_disturbance()
        gap = gap_along(r, start[None], end[None], direction[None], np.array([row]), disturbance)
        width = NEAR / max(self._length(end), NEAR)
        low, high = np.array([max(0.0, s - width)]), np.array([min(1.0, s + width)])
        only = np.array([0])
        at_low, at_high = gap(only, low), gap(only, high)
        if at_high[0] > 0:
            return None
        return float(low[0]) if at_low[0] <= 0 else float(bracketed_zero(gap, low, high, at_low, at_high)[0])

    def _last_disturbance(self) -> effects.Disturbance:
        """→ one row: what happens at the latest contact."""
        r, known, count = self.rig, self._contacts, len(self._contacts)
        noise = probing.noise(r, count)[-1:]
        if not r.effects:
            nothing = undisturbed(1)
            return effects.Disturbance(noise, nothing.work, nothing.table, {})
        history = probing.history(
            r,
            np.array([c.row for c in known]),
            np.array([c.position for c in known]),
            np.array([c.direction for c in known]),
            np.array([c.move for c in known]),
            np.array([c.time for c in known]),
            np.ones(count, dtype=np.int64),
            np.array([c.feed for c in known]),
            np.zeros(count),
        )
        last = rows_of(effects.disturbance(r.effects, history, r.seed), np.array([count - 1]))
        assert last.gap is not None
        return effects.Disturbance(last.gap + noise, last.work, last.table, last.errors)

    def _name(self, what: What) -> str:
        if isinstance(what, Entry):
            return f"{what.body} ({what.part})"
        facets, solids = self.rig.surfaces.facets, len(self.rig.surfaces.obstacles)
        beyond = what - len(facets)
        return f"facet {facets[what]}" if beyond < 0 else f"obstacle {beyond + 1}" if beyond < solids else "the table"

    def _table(self, position: Array) -> dict[str, float]:
        """→ {axis: value} with every digit, mm and deg."""
        return {a.name: float(v if a.kind == "linear" else np.degrees(v)) for a, v in zip(self.machine.axes, position, strict=True)}

    def _shown(self) -> dict[str, Any]:
        return {"time_s": round(self.time, 6), "position": self._table(self._position)}
