"""A plan: touches, turns between them, and every motion in its order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from .cell import Artefact, Machine, Strategy
from .numbers import Id

OFF = 1.5  # mm that a program goes off a facet, where nothing can guard it, before it goes back guarded
STEP = math.radians(170)  # at most, of an axis that takes the nearer way: less than half a turn
LEAST = 0.3  # mm of a motion: RS274/NGC, and Mach3 with it, takes no search that begins nearer than 0.254 mm to its target
MoveKind = Literal["retract", "clear", "index", "approach", "find", "off", "near", "probe", "back", "prove"]


@dataclass(frozen=True, slots=True)
class Touch:
    """One touch of a plan: axis positions (mm, rad; columns of `Machine.names`) of stand-off, contact and search end.

    `over` is the stand-off backed off along the tool to where nothing on the table reaches at this indexation. `enter` and
    `leave` are between both: as high as the way from the touch before, and to the touch after it, needs; None is as high as `over`.
    """

    number: int  # its place in the strategy, from 1, whether or not those before it are in the plan
    facet: Id
    indexation: int
    standoff: tuple[float, ...]
    contact: tuple[float, ...]
    end: tuple[float, ...]
    over: tuple[float, ...]
    enter: tuple[float, ...] | None = None
    leave: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Turn:
    """Where rotary axes and spindle turn before touch `touch`: clear of all that they sweep; linear axes stand still.

    `before` and `after` differ in rotary columns only; `via` leads on to the first touch where the way is not free. `first` moves
    alone where the machine may stand anywhere. `preload`: a stop near `after` (linear: `before`) for the sense of the last motion.
    """

    touch: int
    before: tuple[float, ...]
    after: tuple[float, ...]
    via: tuple[float, ...] | None = None
    first: str | None = None
    preload: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Move:
    """One motion: the axes that move and where to (mm, rad); `touch` is the number it serves; `probe` is the measuring move."""

    kind: MoveKind
    target: Mapping[str, float]
    touch: int


@dataclass(frozen=True)
class Plan:
    """What is to be measured and how to get there: data, to be printed, posted, checked, drawn or run.

    `turns` are sorted by touch; the last one is the parting retract, with a touch number one past the last.
    """

    machine: Machine
    artefact: Artefact
    strategy: Strategy
    touches: Sequence[Touch]  # out of the planner: `plan.touches.Planned`
    turns: Sequence[Turn]  # out of the planner: `plan.turns.Turned`
    left_out: Mapping[int, str] = field(default_factory=dict)  # touches of the strategy that it does not make: number → why not
    doubtful: tuple[str, ...] = ()  # touches of the plan that a straight stylus can hardly make, in words
    start: tuple[str, ...] = ()  # what a person has to see to before it begins, in words
    met: Mapping[int, float] = field(default_factory=dict)  # touch → mm behind (+) its contact where a run has found its facet
    met_in: str = ""  # the readings of that run
    only: Move | None = None  # the one motion of a program that touches and records nothing; its touches and turns are not made

    @property
    def moves(self) -> Iterator[Move]:
        """→ every motion in its order; each names only the axes that move. One at a time, however long the plan is.

        A retract or a way over of less than `LEAST` is made with the next linear motion: some controls take none so short. Before
        the first touch all are made, because the move that proves the probe begins at the place of the plan.
        """
        if self.only is not None:
            yield self.only
            return
        at: dict[str, float] = {}
        late: Mapping[str, float] = {}  # what was left out and has to be made up for
        linear, begin = frozenset(self.machine.linear), self.touches[0].number if self.touches else 0
        for move in self._each():
            if move.target.keys() <= linear:
                if late:
                    move = replace(move, target={**late, **move.target})
                known = move.kind in ("retract", "clear") and len(at) == len(linear) and move.touch != begin
                if known and math.dist(tuple(move.target.values()), [at[name] for name in move.target]) < LEAST:
                    late = move.target
                    continue
                at.update(move.target)
                late = {}
            yield move

    def _each(self) -> Iterator[Move]:
        """→ every motion to a place of the plan, however short."""
        turns = iter(self.turns)
        turn = next(turns, None)
        at: tuple[float, ...] | None = None
        found = 3 if self.strategy.approach.find else 0  # moves of a double touch more
        for touch in self.touches:
            if turn is not None and turn.touch == touch.number:
                yield from self._turn(turn, at, touch.number)
                at = turn.via or turn.after
                turn = next(turns, None)
            for kind, target in (
                ("clear", touch.enter or touch.over),
                ("approach", touch.standoff),
                *(("find", touch.end), ("off", touch.standoff), ("near", self.near(touch)))[:found],
                ("probe", touch.end),
                ("back", touch.standoff),
                ("retract", touch.leave or touch.over),
            ):
                if changes := self._changes(at, target):
                    yield Move(kind, changes, touch.number)  # type: ignore[arg-type]
                at = target
        last = self.touches[-1].number
        if turn is not None and turn.touch == last + 1:
            yield from self._turn(turn, at, last)

    @property
    def nearer(self) -> float:
        """→ mm that the measuring move of two begins nearer than the stand-off: nothing where that is less than `LEAST`."""
        approach = self.strategy.approach
        nearer = approach.standoff - approach.find.retreat if approach.find else 0.0
        return nearer if nearer >= LEAST else 0.0

    def near(self, touch: Touch) -> tuple[float, ...]:
        """touch of this plan → where its measuring move begins (mm, rad): the stand-off, or nearer where it is touched twice."""
        part = 1.0 - self.nearer / self.strategy.approach.standoff
        return tuple(c + part * (s - c) for s, c in zip(touch.standoff, touch.contact, strict=True)) if part < 1 else touch.standoff

    @property
    def served(self) -> Iterator[tuple[Move, Touch]]:
        """→ every motion in its order, with the touch that it serves."""
        touches = iter(self.touches)
        touch = next(touches)
        for move in self.moves:
            while touch.number != move.touch:
                touch = next(touches)
            yield move, touch

    def _turn(self, turn: Turn, at: tuple[float, ...] | None, touch: int) -> Iterator[Move]:
        turning = (*self.machine.rotary, "S")
        if turn.first is not None:
            at = turn.preload or turn.before
            linear = self._changes(None, at, self.machine.linear)
            yield Move("retract", {turn.first: linear.pop(turn.first)}, touch)
            yield Move("clear", linear, touch)
            if loaded := self._changes(at, turn.before, self.machine.linear):
                yield Move("clear", loaded, touch)
            yield Move("index", self._changes(None, at, turning), touch)
        elif linear := self._changes(at, turn.before, self.machine.linear):
            yield Move("retract", linear, touch)
        if turn.first is None and turn.preload is not None:
            yield from self._turned(turn.before, turn.preload, touch)
            at = turn.preload
        yield from self._turned(at if turn.preload and at else turn.before, turn.after, touch)
        if lowered := self._changes(turn.after, turn.via or turn.after):
            yield Move("clear", lowered, touch)

    def _turned(self, at: tuple[float, ...], to: tuple[float, ...], touch: int) -> Iterator[Move]:
        """Rotary axes and spindle go there; an axis that takes the nearer way goes in steps of less than half a turn."""
        for name in self.machine.rotary:
            column = self.machine.column(name)
            steps = math.ceil(abs(to[column] - at[column]) / STEP) if self.machine.axes[column].nearer else 1
            for part in range(1, steps):
                yield Move("index", {name: at[column] + part / steps * (to[column] - at[column])}, touch)
        if turned := self._changes(at, to, (*self.machine.rotary, "S")):
            yield Move("index", turned, touch)

    def _changes(self, at: tuple[float, ...] | None, to: tuple[float, ...], names: Sequence[str] | None = None) -> dict[str, float]:
        known = self.machine.names
        if at is None:
            return {name: new for name, new in zip(known, to, strict=True) if names is None or name in names}
        moved = zip(known, at, to, strict=True)
        return {  # a NaN is a move, to be refused
            name: new for name, old, new in moved if not abs(old - new) <= 1e-9 and (names is None or name in names)
        }
