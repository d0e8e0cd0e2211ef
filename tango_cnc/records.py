"""Every record that crosses a stage; frozen, and without behaviour beyond looking things up.

Units inside the program are mm, rad, s, and mm/min for feeds; files and people see degrees. A position array has one
column per axis in the order of `Machine.names`: X Y Z, then the rotary letters in alphabetical order, then the spindle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .judgement import TableTolerances, Tolerances

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Id = str  # facets and balls: integers and strings in files, text inside

LINEAR, ROTARY = "XYZ", "ABC"
COMPONENTS = "XYZABC"  # of an error: three translations, three rotations (ISO 230-1)


class TangoError(Exception):
    """Something the person at the machine has to know; `exit_code` is what the command line returns."""

    exit_code = 1


class InputError(TangoError):
    """A file or an option is wrong: nothing was written, nothing was moved."""

    exit_code = 2


class LinkError(TangoError):
    """The controller or the line to it failed; what was measured so far is on disk."""

    exit_code = 3


@dataclass(frozen=True)
class Axis:
    """One axis at the zero pose of the machine frame; its body moves along or about `direction` for a positive command."""

    name: str
    kind: Literal["linear", "rotary", "spindle"]
    direction: Vector
    point: Vector = (0.0, 0.0, 0.0)
    travel: tuple[float, float] | None = None  # mm or rad; None: the spindle, or an endless rotary axis
    rapid: float | None = None  # mm/min or rad/min
    acceleration: float | None = None  # m/s² or rad/s²
    clamp_time: float = 0.0  # s


@dataclass(frozen=True)
class Probe:
    """The touch probe: stylus `length` from the spindle reference point to the tip centre, mm."""

    length: float
    tip_radius: float
    repeatability: float  # one standard deviation of a touch, mm
    stylus_radius: float = 1.5  # mm, of the stem
    body_radius: float = 32.0  # mm
    body_length: float = 100.0  # mm, the thick part nearest the spindle nose
    nose_radius: float = 0.0  # mm, of the spindle nose above the body; less than that of the body counts as it
    max_feed: float = 3000.0  # mm/min of measuring that probe and stylus stand: what touch-trigger probes are released for


@dataclass(frozen=True)
class Machine:
    """A serial chain; both branches are read from the foundation outwards (`wCBXfZY(S)t`: X B C and Z Y S)."""

    name: str
    topology: str
    axes: tuple[Axis, ...]  # in the order of `names`
    workpiece_branch: tuple[str, ...]
    tool_branch: tuple[str, ...]
    probe: Probe  # with the stylus that is in the spindle
    tolerances: Tolerances = field(default_factory=Tolerances)
    styli: tuple[Probe, ...] = ()  # the probe with every stylus, the usual one first; empty: there is one
    stylus: int = 1  # which of them `probe` has

    @cached_property
    def names(self) -> tuple[str, ...]:
        """→ axis letters, the columns of every position array."""
        return tuple(axis.name for axis in self.axes)

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """→ letters of the linear axes."""
        return tuple(axis.name for axis in self.axes if axis.kind == "linear")

    @cached_property
    def rotary(self) -> tuple[str, ...]:
        """→ letters of the rotary axes, without the spindle."""
        return tuple(axis.name for axis in self.axes if axis.kind == "rotary")

    @property
    def spindle(self) -> Axis:
        """→ the spindle axis."""
        return self.axis("S")

    def axis(self, name: str) -> Axis:
        """letter → axis. Raises KeyError for a letter that the machine lacks."""
        return next(axis for axis in self.axes if axis.name == name)

    def column(self, name: str) -> int:
        """letter → column of a position array."""
        return self.names.index(name)

    def with_stylus(self, number: int) -> Machine:
        """number of a stylus, from 1 → the machine with that one in the spindle."""
        return self if number == self.stylus else replace(self, probe=self.styli[number - 1], stylus=number)


@dataclass(frozen=True)
class Surface:
    """A curved facet: a cylinder or sphere of `radius` mm, `inside` when the probe touches a bore; `axis` in the table frame."""

    kind: Literal["cylinder", "sphere"]
    radius: float
    axis: Vector | None = None
    inside: bool = False


@dataclass(frozen=True)
class Facet:
    """A small surface of the table: nominal point (mm) and outward unit normal in the table frame."""

    id: Id
    point: Vector
    normal: Vector
    ball: Id | None = None
    uncertainty: float | None = None  # mm, of a calibrated facet's offset
    surface: Surface | None = None


@dataclass(frozen=True)
class Ball:
    """A sphere on the table, nominal centre and radius in mm, table frame."""

    id: Id
    centre: Vector
    radius: float


@dataclass(frozen=True)
class ScaleBar:
    """A calibrated distance between the centres of two balls, mm."""

    balls: tuple[Id, Id]
    length: float
    uncertainty: float


@dataclass(frozen=True)
class Obstacle:
    """A solid that the probe must not hit, table frame: a box, a cylinder, or the hull of `points`, maybe out of a `file`."""

    kind: Literal["box", "cylinder", "hull"]
    low: Vector | None = None
    high: Vector | None = None
    base: Vector | None = None
    axis: Vector | None = None
    radius: float | None = None
    height: float | None = None
    points: tuple[Vector, ...] | None = None
    file: str | None = None  # as written in artefact.yaml, to speak of it

    @property
    def name(self) -> str:
        """→ what it is called in complaints beside its number; empty when there is nothing to call it."""
        return f" ({self.file})" if self.file else ""


@dataclass(frozen=True)
class Artefact:
    """The table as it is nominally known."""

    name: str
    facets: Mapping[Id, Facet]
    balls: Mapping[Id, Ball] = field(default_factory=dict)
    scale_bar: ScaleBar | None = None
    obstacles: tuple[Obstacle, ...] = ()
    tolerances: TableTolerances = field(default_factory=TableTolerances)


@dataclass(frozen=True)
class Find:
    """The first of two touches: at `feed` mm/min from the stand-off; the second begins `retreat` mm before the nominal facet."""

    feed: float
    retreat: float


@dataclass(frozen=True)
class Approach:
    """How a facet is touched: start `standoff` mm before it, search `search` mm past it, at `feed` mm/min; `find`: twice."""

    standoff: float
    search: float
    feed: float
    find: Find | None = None


@dataclass(frozen=True, slots=True)
class Indexation:
    """Rotary and spindle positions (rad) at which the facets are touched in this order, with that stylus of `Machine.styli`."""

    position: Mapping[str, float]
    facets: tuple[Id, ...]
    stylus: int = 1


@dataclass(frozen=True)
class Strategy:
    """Indexations in the order of measurement."""

    name: str
    approach: Approach
    indexations: tuple[Indexation, ...]
    obstructed: str | None = None  # what becomes of touches that a straight stylus cannot make; None: nothing is stated
    before: int = 0  # touches of the whole strategy before these: those of the styli before


@dataclass(frozen=True)
class World:
    """What the simulated machine really is; coefficients in mm and rad."""

    errors: Mapping[str, float] = field(default_factory=dict)
    stylus: Mapping[str, float] = field(default_factory=dict)
    facets: Mapping[Id, float] = field(default_factory=dict)
    noise: float = 0.0
    effects: tuple[Mapping[str, Any], ...] = ()
    seed: int = 0


@dataclass(frozen=True)
class Controller:
    """What `plan` and `run` need of the control; `options` are the post's profile fields."""

    post: str
    port: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


TermItem = str | Mapping[str, Any]


@dataclass(frozen=True)
class Cell:
    """One machine, one artefact and what is done with them."""

    folder: Path
    machine: Machine
    artefact: Artefact
    strategy: Strategy
    terms: tuple[TermItem, ...]
    controller: Controller | None = None


OFF = 1.5  # mm that a program goes off a facet, where nothing can guard it, before it goes back guarded
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

    @property
    def moves(self) -> Iterator[Move]:
        """→ every motion in its order; each names only the axes that move. One at a time, however long the plan is."""
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

    def near(self, touch: Touch) -> tuple[float, ...]:
        """touch of this plan → where its measuring move begins (mm, rad): the stand-off, or nearer where it is touched twice."""
        approach = self.strategy.approach
        part = approach.find.retreat / approach.standoff if approach.find else 1.0
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
            if loaded := self._changes(turn.before, turn.preload, turning):
                yield Move("index", loaded, touch)
            at = turn.preload
        if turned := self._changes(at if turn.preload else turn.before, turn.after, turning):
            yield Move("index", turned, touch)
        if lowered := self._changes(turn.after, turn.via or turn.after):
            yield Move("clear", lowered, touch)

    def _changes(self, at: tuple[float, ...] | None, to: tuple[float, ...], names: Sequence[str] | None = None) -> dict[str, float]:
        pairs = zip(self.machine.names, at or to, to, strict=True)
        moved = (pair for pair in pairs if at is None or not abs(pair[1] - pair[2]) <= 1e-9)  # a NaN is a move, to be refused
        return {name: new for name, _, new in moved if names is None or name in names}


@dataclass(frozen=True)
class Readings:
    """One row a touch, in the order of measurement; `position` and `direction` have the columns of `axes`."""

    axes: tuple[str, ...]
    touch: NDArray[np.int64]  # (n,)
    time: Array  # (n,) s
    facet: tuple[Id, ...]  # n
    position: Array  # (n, k) mm, rad: machine coordinates at the trigger
    direction: Array  # (n, k) −1 0 1: direction of the last motion
    status: tuple[str, ...]  # n: ok, miss, early
    cycle: NDArray[np.int64]  # (n,)
    day: NDArray[np.int64]  # (n,)
    feed: Array | None = None  # (n,) mm/min
    temperatures: Mapping[str, Array] = field(default_factory=dict)  # °C, NaN where it is not known
    segment: NDArray[np.int64] | None = None  # (n,) 1, and one more after each interruption; None: there was none
    stylus: NDArray[np.int64] | None = None  # (n,) number of the stylus, of `Machine.styli`; None: the usual one

    def __len__(self) -> int:
        return len(self.touch)

    def rows(self, keep: NDArray[Any]) -> Readings:
        """(n,) mask or (m,) indices → the readings of those rows, in that order."""
        index = np.arange(len(self))[keep]
        names = ("touch", "time", "position", "direction", "cycle", "day", "feed", "segment", "stylus")
        taken: dict[str, Any] = {n: None if (v := getattr(self, n)) is None else v[index] for n in names}
        taken |= {name: tuple(map(getattr(self, name).__getitem__, index.tolist())) for name in ("facet", "status")}
        return replace(self, **taken, temperatures={name: values[index] for name, values in self.temperatures.items()})

    @property
    def ok(self) -> NDArray[np.bool_]:
        """→ (n,) mask of the touches that made contact where they should."""
        return np.array([status == "ok" for status in self.status], dtype=np.bool_)


@dataclass(frozen=True)
class Parameter:
    """An estimated coefficient with its standard deviation, in `unit` (mm, rad, mm/mm …)."""

    value: float
    unit: str
    std: float


@dataclass(frozen=True)
class Combination:
    """Directions that no touch sees: `weights` over names, and a sentence for people."""

    names: tuple[str, ...]
    weights: tuple[float, ...]
    text: str
