"""Nights of a simulated machine into a history: no controller, no waiting, one seed. What people see before they have a machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from ..files import readings_text
from ..files.nightly import Nightly
from ..history import History
from ..nightly import Delivery, Measured, Ports, PreflightPoint, night
from ..nightly.parts import part_of
from ..plan import plan
from ..records import Cell, Readings
from ..records import World as Truth
from ..texts import say
from ._cell_nights import nights_of

WANDER = {"mm": 3e-4, "rad": 6e-7, "mm/mm": 2e-7}  # what a sound machine does in a day
STANDARD = 20.0  # °C


@dataclass(frozen=True)
class Event:
    """From night `night` (1, 2 …) on: these errors are larger (mm, rad), the hall is warmer (K), or drift goes on (a day)."""

    night: int
    errors: Mapping[str, float] = field(default_factory=dict)
    table: tuple[float, float, float] | None = None  # mm
    warmer: float = 0.0
    drift: Mapping[str, float] = field(default_factory=dict)
    stylus: Mapping[str, float] = field(default_factory=dict)  # mm: another one


@dataclass(frozen=True)
class Story:
    """What happens to a machine: how its errors follow its temperature (a K), how fast it wanders, and events."""

    events: tuple[Event, ...] = ()
    warm: Mapping[str, float] = field(default_factory=dict)
    wander: float = 1.0  # times `WANDER`


THIRTY = Story(
    (
        Event(1, drift={"EA0B": 4e-8}),
        Event(12, {"EX0C": 0.020}),
        Event(20, warmer=6.0),
    ),
    {"EX0C": 0.8e-3, "EZZ1": 4e-6, "EYY1": 3e-6, "EX0S": 0.6e-3},
)


KNOCKED = ("EX0", "EY0")  # errors that a knock changes: where an axis of rotation is


def story_of(names: Sequence[str], rotary: Sequence[str]) -> Story:
    """errors that the nights follow, rotary axes → `THIRTY` for this machine: only errors that it has.

    Without EX0C the knock moves another axis of rotation; a machine without one is bent out of square by 20 µrad.
    """
    lasting = sorted((n for n in names if n[:3] in KNOCKED and n[3:] in rotary), key=lambda n: (n != "EX0C", n[3:] != "C", n))
    bent = next((n for n in names if n[1] in "ABC" and n[2:] in ("0X", "0Y", "0Z")), None)
    hit = {lasting[0]: 0.020} if lasting else {bent: 2e-5} if bent else {}
    return Story(
        tuple(
            replace(e, errors=hit if e.errors else {}, drift={n: rate for n, rate in e.drift.items() if n in names})
            for e in THIRTY.events
        ),
        {n: k for n, k in THIRTY.warm.items() if n in names},
    )


@dataclass
class Time:
    """A clock that shows what it is set to."""

    moment: datetime

    def now(self) -> datetime:
        """→ now."""
        return self.moment


@dataclass
class Folder:
    """A disk that is never full and never fails; what is written is kept where somebody wants it."""

    keep: Callable[[str, str, str], None]

    def free_mb(self) -> float:
        """→ room."""
        return 1e5

    def begin(self, stamp: str, text: str) -> None:
        """Nothing is cut off here."""

    def unfinished(self) -> Sequence[tuple[str, str]]:
        """→ nothing."""
        return ()

    def ended(self, stamp: str) -> None:
        """Nothing to take away."""

    def write(self, stamp: str, name: str, text: str) -> None:
        """Hands the file on."""
        self.keep(stamp, name, text)

    def read(self, stamp: str, name: str) -> str | None:
        """→ nothing: every night is kept."""
        return None

    def post(self, stamp: str, text: str) -> None:
        """Nobody waits for a message here."""

    def unsent(self) -> Sequence[tuple[str, str]]:
        """→ nothing."""
        return ()

    def sent(self, stamp: str) -> None:
        """Nothing to take out."""


@dataclass
class _Machine:
    """A simulated machine: the simulator's own mathematics, without a controller in between."""

    cell: Cell
    truth: Truth
    rng: np.random.Generator
    seconds: Callable[[int, int], float]
    temperature: float = STANDARD
    clock: Time | None = None  # goes on while it measures

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """→ all is well."""
        return (
            PreflightPoint("control", True, say("preflight.simulated.simulated_idle")),
            PreflightPoint("probe", True, say("preflight.simulated.simulated_not_triggered")),
        )

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """→ what the true machine reads."""
        from sim_controller.simulate import simulate

        strategy, numbers = part_of(self.cell.strategy, touches)
        seed = int(self.rng.integers(2**31))
        read = simulate(self.cell.machine, self.cell.artefact, strategy, self.truth, seed=seed)
        warm = self.temperature + 0.2 * np.linspace(0, 1, len(read)) + self.rng.normal(0, 0.05)
        read = replace(read, touch=np.array(numbers), temperatures={"bed": np.round(warm, 3)})
        read = _decimals(read)
        seconds = self.seconds(len(read), len(strategy.indexations))
        if self.clock is not None:
            self.clock.moment += timedelta(seconds=round(seconds))
        return Measured(read, readings_text(read), len(read), seconds, simulated=True, asked=tuple(touches))


def _decimals(read: Readings) -> Readings:
    """readings → as a file holds them: six decimals of mm and of degrees."""
    linear = np.array([name in "XYZ" for name in read.axes])
    scale = np.where(linear, 1.0, 180 / np.pi)
    return replace(read, position=np.round(read.position * scale, 6) / scale, time=np.round(read.time, 6))


class Nobody:
    """Mail that arrives."""

    def send(self, subject: str, text: str, but: Sequence[str] = ()) -> Sequence[Delivery]:
        """→ delivered."""
        return (Delivery("nobody", True),)


def nights(
    cell: Cell,
    truth: Truth,
    history: History,
    count: int = 30,
    seed: int = 0,
    story: Story | None = None,
    settings: Nightly | None = None,
    first: datetime | None = None,
    keep: Callable[[str, str, str], None] = lambda stamp, name, text: None,
    always_full: bool = False,
) -> Iterator[tuple[dict[str, Any], Truth]]:
    """cell, true machine, history, how many nights, seed, story or None: the usual one → record and truth of every night added.

    `keep` takes the files of the nights: stamp, name, text.
    """
    settings = settings or Nightly(diagnose=False, full_every_days=1e-9 if always_full else 30.0)
    made = plan(cell)
    analysis = nights_of(cell, settings, made, deep=False)
    rng = np.random.default_rng(seed)
    units = dict(zip(analysis.followed.names, analysis.followed.units, strict=True))
    if story is None:
        story = story_of(analysis.followed.names, cell.machine.rotary)
    errors = dict(truth.errors)
    moment = first or datetime(2026, 10, 1, 2, 0, tzinfo=UTC)
    times = analysis.times
    machine = _Machine(cell, truth, rng, lambda n, turns: n * times.touch + turns * times.turn)
    mean = STANDARD
    for number in range(1, count + 1):
        for name in errors:
            errors[name] += (
                rng.normal() * story.wander * WANDER.get(units.get(name, ""), 0.0) * (0.3 if name.endswith("b") else 1.0)
            )
        facets, stylus = dict(machine.truth.facets), dict(machine.truth.stylus)
        for event in story.events:
            for name, drift in event.drift.items():
                errors[name] = errors.get(name, 0.0) + (drift if number >= event.night else 0.0)
            if event.night != number:
                continue
            for name, size in event.errors.items():
                errors[name] = errors.get(name, 0.0) + size
            stylus |= {name: stylus.get(name, 0.0) + size for name, size in event.stylus.items()}
            mean += event.warmer
            if event.table is not None:
                facets = {i: facets.get(i, 0.0) + float(np.dot(event.table, f.normal)) for i, f in cell.artefact.facets.items()}
        machine.temperature = mean + rng.normal(0, 0.3)
        change = machine.temperature - STANDARD
        now = {name: value + story.warm.get(name, 0.0) * change for name, value in errors.items()}
        machine.truth = replace(truth, errors=now, facets=facets, stylus=stylus)
        clock = Time(moment + timedelta(days=number - 1, minutes=float(rng.uniform(0, 5))))
        machine.clock = clock
        world = Ports(clock, Folder(keep), machine, Nobody(), history.as_of(clock.now), analysis, nullcontext())
        yield night(cell.machine.name, str(cell.folder), settings, world), machine.truth
