"""A cell: its machine, artefact, strategy and control, and what the simulated machine really is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from ..judgement import TableTolerances, Tolerances
from .numbers import Id, Vector


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
    nearer: bool = False  # the control turns it to an angle by the nearer way, over 360 deg or not, whatever the numbers say

    @property
    def limits(self) -> tuple[float, float]:
        """→ lowest and highest place, mm or rad; nothing limits an axis without travel."""
        return self.travel or (-math.inf, math.inf)


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
    overhead: float = 0.0  # s that the control needs for each touch beside its moves
    obstacles: tuple[Obstacle, ...] = ()  # on bodies other than the table: each says `on` which

    @property
    def carried(self) -> tuple[str, ...]:
        """→ rotary axes that another rotary axis carries: a table on its cradle, a head on its fork."""
        rotary = [[name for name in branch if name in self.rotary] for branch in (self.workpiece_branch, self.tool_branch)]
        return tuple(name for branch in rotary for name in branch[1:])

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
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, Axis]:
        return {axis.name: axis for axis in reversed(self.axes)}

    def column(self, name: str) -> int:
        """letter → column of a position array."""
        return self.names.index(name)

    def carriers(self, name: str) -> tuple[str, ...]:
        """letter of an axis, or f for the foundation → axes from the foundation outwards that move the body of that axis."""
        branch = self.workpiece_branch if name in self.workpiece_branch else self.tool_branch
        return branch[: branch.index(name) + 1] if name in branch else ()

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
    """A solid that nothing must hit: a box, a cylinder, or the hull of `points`, maybe out of a `file`.

    One of artefact.yaml is in the table frame and on the table; one of machine.yaml is in the machine frame with all axes at zero,
    and moves with the body of the axis that it is `on` (f: the foundation, which stands still).
    """

    kind: Literal["box", "cylinder", "hull"]
    low: Vector | None = None
    high: Vector | None = None
    base: Vector | None = None
    axis: Vector | None = None
    radius: float | None = None
    height: float | None = None
    points: tuple[Vector, ...] | None = None
    file: str | None = None  # as it is written, to speak of it
    title: str | None = None  # what its file calls it
    on: str | None = None  # axis letter or f; None: on the table

    @property
    def name(self) -> str:
        """→ what it is called in complaints beside its number; empty when there is nothing to call it."""
        said = [word for word in (self.title or self.file, f"on {self.on}" if self.on else None) if word]
        return f" ({', '.join(said)})" if said else ""


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
