"""What a protocol client is: it talks in bytes and answers in events, and never waits, opens, writes or asks the time.

A file of `protocols/` has a class `Client(task, options)` that inherits the class of that name from here. The session gives the
client the bytes that came (`receive`), the seconds that passed (`elapsed`) and the news that the line is gone (`closed`); it asks
for bytes when the line takes some (`bytes_to_send`). Whatever the events carry is on disk before the client is asked for bytes
again, so that an acknowledgement never precedes the record it acknowledges. These five every client writes; what only some
controls can do has a default here, and a client that can do more overrides it.

    received bytes ──Client──▶ Begun, Touched, …, Ended ──trust──▶ statuses ──journal──▶ disk
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

from ..records import Plan


@dataclass(frozen=True)
class Task:
    """One program to be run: its text, the mark that its start record must carry, and how long each touch may take.

    `patience` is the seconds of silence allowed before each touch and, one more, before the end mark. A program that resumes
    a run counts its touches from 1 again; `original` has their numbers in the run, and the first `again` of them were
    measured before and are repeated to see whether anything has moved in the meantime.
    """

    plan: Plan
    program: str
    mark: str
    letters: tuple[str, ...]  # axis letters that every record carries
    patience: tuple[float, ...]
    original: tuple[int, ...]
    again: int = 0
    start_patience: float = 600.0  # s before the start mark: somebody has to press the button
    quiet: float = 0.0  # s of silence before anything is sent: the control may still execute the program of before
    nonce: int = 1  # of 31 bits, which no other run has, where commands of two programs have to be distinguished
    summed: bool = True  # whether every record ends with K, the sum of its coordinates
    misses: int = 3  # touches in a row without contact after which driver or program stop: a dead probe guards nothing
    counted: bool = True  # whether the program itself counts them, and ends
    due: tuple[float, ...] = ()  # s of silence before each touch by which its record should have come
    run: Plan | None = None  # the plan of all programs of the run; None when this is the only one

    @cached_property
    def numbers(self) -> tuple[int, ...]:
        """→ touch numbers in the order of the program."""
        return tuple(touch.number for touch in self.plan.touches)


@dataclass(frozen=True)
class Identified:
    """The control said what it is."""

    text: str


@dataclass(frozen=True)
class Begun:
    """The start mark of a program: which one, and how many touches it makes."""

    mark: str
    count: int


@dataclass(frozen=True)
class Touched:
    """A complete record of one touch as the control sent it: mm and degrees, not yet trusted."""

    number: int
    flag: int  # 0 no contact, 1 contact, 2 contact before the search
    position: Mapping[str, float]
    text: str


@dataclass(frozen=True)
class Ended:
    """The end mark: the control ran the program to its end and made `count` touches."""

    count: int
    mark: str = ""  # of the program, where the control prints it


@dataclass(frozen=True)
class Refused:
    """Something arrived that is no record; the touch it may have been is measured again by `--resume`."""

    why: str
    text: str


@dataclass(frozen=True)
class Asked:
    """The person at the machine has to do something now."""

    text: str


@dataclass(frozen=True)
class Failed:
    """The conversation cannot go on. `wrong`: with this port it never could, and nothing was sent."""

    why: str
    wrong: bool = False


Event = Identified | Begun | Touched | Ended | Refused | Asked | Failed


class Client(Protocol):
    """Five verbs that every client writes, and what only some can do, with what holds for the others."""

    punches: ClassVar[bool] = False  # the control can punch its program out over the line
    drives: ClassVar[bool] = False  # asks for every motion, so nothing moves on while this computer does not look
    late: ClassVar[bool] = False  # records come long after their touches: what a sensor says then is not of the touch
    explains: ClassVar[bool] = False  # the control says why it has stopped
    brought: bool = False  # the person brings the program to the control, and is told which file before anything begins
    before: str = ""  # what the person has to know before the first byte is sent
    advice: str = ""  # what the person has to do when all is sent; usually: start the program at the control

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → bytes for the line now; empty while the other side is not ready for them."""

    def receive(self, data: bytes) -> Sequence[Event]:
        """bytes from the line, cut anywhere → what they complete."""

    def elapsed(self, seconds: float) -> Sequence[Event]:
        """s since the last call → what the waiting means."""

    def closed(self) -> Sequence[Event]:
        """the line is gone → what that means."""

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option of the protocol: value} → client. Raises InputError for what the protocol cannot carry."""

    @property
    def sent(self) -> tuple[int, int]:
        """→ (bytes sent, bytes in all) of the program."""

    def stop(self) -> bool:
        """The user wants an end → whether the client draws the probe clear first, so that the conversation still goes on."""
        return False

    @classmethod
    def named(cls, options: Mapping[str, str]) -> None:
        """{option: value} → nothing, before anything is written. Raises InputError for files named there that are wrong."""

    @classmethod
    def fits(cls, plan: Plan, options: Mapping[str, str]) -> None:
        """plan of a run, {option: value} → nothing. Raises InputError for a plan that the control cannot be told."""

    @classmethod
    def begins(cls, options: Mapping[str, str]) -> bool:
        """{option: value} → whether a program begins with nobody at the control: started from here, or awaited by the control."""
        return False

    @classmethod
    def hello(cls, options: Mapping[str, str]) -> bytes:
        """{option: value} → bytes that ask the control what it is and move nothing; none where it cannot be asked."""
        return b""

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]] | None:
        """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item.

        None where the protocol has no opinion: the bytes are those of any line.
        """
        return None

    @classmethod
    def busy(cls, data: bytes, options: Mapping[str, str]) -> str:
        """what came after `hello` → why nobody may begin here unattended: a program runs, the probe is on.

        Empty where it is free, or does not say.
        """
        return ""
