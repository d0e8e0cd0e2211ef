"""What a night needs of the world around it. Everything that can fail, wait or be cut off is one of these.

`tango nightly` gives it a real clock, disk, control and mail; the tests give it simulated ones that follow one seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol

from ..history import Decision, Knowledge, Night
from ..loaded import Event
from ..records import LinkError, Readings


class Busy(LinkError):
    """Another program is at work in the folder of the cell; `by` names it: nothing was begun, nothing was disturbed."""

    def __init__(self, text: str, by: str) -> None:
        super().__init__(text)
        self.by = by


@dataclass(frozen=True)
class PreflightPoint:
    """One point of a preflight: what was found, and what to do about it."""

    check: str
    passed: bool
    found: str
    do: str = ""
    moving: bool = False  # the control may still execute a program: somebody looks at the machine before anything else

    def as_json(self) -> dict[str, Any]:
        """→ the point as a record has it."""
        return {"check": self.check, "passed": self.passed, "found": self.found, "do": self.do}


@dataclass(frozen=True)
class Measured:
    """What came of a run: readings, their text, how many touches were planned, s the machine moved, and why it stopped."""

    readings: Readings | None
    text: str | None
    planned: int
    seconds: float
    why: str = ""  # empty: every touch was made
    hashes: tuple[tuple[str, str], ...] = ()
    asked: tuple[int, ...] = ()  # numbers of the touches that were asked for; empty: the whole strategy
    simulated: bool = False  # by no machine
    trouble: str = ""  # what the disk has refused, though every touch was made
    strange: Mapping[str, str] | None = None  # {sensor: what it said that is no temperature in °C}


@dataclass(frozen=True)
class Delivery:
    """One message that was sent, or why not."""

    to: str
    sent: bool
    why: str = ""


class Clock(Protocol):
    """The time."""

    def now(self) -> datetime:
        """→ now, with the local zone."""


class Disk(Protocol):
    """The folder of the cell."""

    def free_mb(self) -> float:
        """→ room."""

    def begin(self, stamp: str, text: str) -> None:
        """Marks a night as begun, in a way that survives a power cut. Raises OSError."""

    def unfinished(self) -> Sequence[tuple[str, str]]:
        """→ (stamp, text) of nights that were begun and never ended."""

    def ended(self, stamp: str) -> None:
        """Takes the mark away."""

    def write(self, stamp: str, name: str, text: str) -> None:
        """A file of a night, whole or not at all. Raises OSError."""

    def read(self, stamp: str, name: str) -> str | None:
        """→ text of a file of a night, None where there is none."""

    def post(self, stamp: str, text: str) -> None:
        """Keeps a message on disk until it is sent. Raises OSError."""

    def unsent(self) -> Sequence[tuple[str, str]]:
        """→ (stamp, text) of messages that were not sent, oldest first."""

    def sent(self, stamp: str) -> None:
        """Marks a message as sent: it is sent no more."""


class Control(Protocol):
    """The machine."""

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """kind of night, touches of the strategy (empty: all) → control, probe, this very program, place. Nothing moves."""

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """kind of night, touches of the strategy (empty: all) → what came of it. Moves the machine. Raises LinkError."""


class Mail(Protocol):
    """The people who get the message of a night."""

    def send(self, subject: str, text: str, but: Sequence[str] = ()) -> Sequence[Delivery]:
        """subject, text, names of those who have it → what was delivered, one a receiver. Raises nothing."""


class Past(Protocol):
    """The history, as far as a night needs it."""

    def of_now(self) -> Past:
        """→ the same, for reading as it is at one moment."""

    def machines(self) -> tuple[str, ...]:
        """→ names."""

    def nights(self, machine: str | None = None, last: int | None = None) -> tuple[Night, ...]:
        """machine, how many → newest first."""

    def records(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """machine, how many → tango-night/1, newest first."""

    def knows(self, machine: str) -> bool:
        """→ whether it has this machine."""

    def ahead(self, machine: str) -> tuple[Night, ...]:
        """machine → its nights that lie in the future by the clock, newest first: the clock is wrong, or was."""

    def records_of(self, entries: Sequence[int]) -> dict[int, Any]:
        """numbers of entries → {number: record of that night}."""

    def readings_of(self, entries: Sequence[int]) -> dict[int, str]:
        """numbers of entries → {number: text of its readings}, where there are any."""

    def latest_knowledge(self, machine: str) -> tuple[Night, Knowledge] | None:
        """machine → what was known after its last measured night."""

    def decisions(self, machine: str) -> tuple[Decision, ...]:
        """machine → what was decided, oldest first."""

    def alarmed(self, machine: str, last: int | None = None) -> tuple[Any, ...]:
        """machine, how many → its nights with alarms, newest first."""

    def newest_hashes(self) -> dict[str, tuple[int, str]]:
        """→ {machine: (number of entries, hash of the newest)}."""

    def night(self, entry: int) -> Any:
        """entry → the night whole."""

    def add_night(self, record: Any, readings: str | None = None, knowledge: Knowledge | None = None) -> int:
        """record, readings, unknowns → entry; on disk when it returns."""


class Analysis(Protocol):
    """Readings → what they say."""

    def choice(self, past: Past, day: float) -> tuple[str, str, tuple[int, ...]]:
        """history, day → kind of night, why, touches."""

    def analysed(
        self, past: Past, day: float, kind: str, measured: Measured
    ) -> tuple[dict[str, Any], Knowledge | None, dict[str, str]]:
        """history, day, kind, readings → members of the record, all unknowns, files. Raises TangoError."""


@dataclass(frozen=True)
class Ports:
    """All of them, and the lock of the cell; entering it raises Busy, or LinkError where the folder cannot be locked."""

    clock: Clock
    disk: Disk
    control: Control
    mail: Mail
    past: Past
    analysis: Analysis
    lock: AbstractContextManager[None]
    happened: Sequence[Event] = ()  # to compensations, oldest first
    ending: Callable[[], None] = lambda: None  # called when a night has its result: what is kept and told is kept and told whole
    noticed: Sequence[str] = ()  # sentences about the history that the message says, too
