"""What a protocol client is: it talks in bytes and answers in events, and never waits, opens, writes or asks the time.

A client is a file of this folder with a class `Client(job, options)`, a table `OPTIONS` of what the port's URL may say to it,
and, where a control can be asked what it is, `hello(options)`, bytes that ask and move nothing, and `told(data, options)`, what
the answer says: whether it can be worked with, and sentences for `tango link-test`. The session gives the client the bytes that
came (`receive`), the seconds that passed (`elapsed`) and the news that the line is gone (`closed`); it asks for bytes when the
line takes some (`bytes_to_send`). Whatever the events carry is on disk before the client is asked for bytes again, so that an
acknowledgement never precedes the record it acknowledges. A client whose program the person brings to the control has an
attribute `brought` that is true, and the person is told which file before anything begins.

    received bytes ──Client──▶ Begun, Touched, …, Ended ──trust──▶ statuses ──journal──▶ disk
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from ..records import Plan


@dataclass(frozen=True)
class Job:
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
    nonce: int = 1  # 16 bits that no other run has, where commands of two programs have to be distinguished
    summed: bool = True  # whether every record ends with K, the sum of its coordinates

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
    """The conversation cannot go on."""

    why: str


Event = Identified | Begun | Touched | Ended | Refused | Asked | Failed


class Client(Protocol):
    """The five verbs of every protocol client."""

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → bytes for the line now; empty while the other side is not ready for them."""

    def receive(self, data: bytes) -> Sequence[Event]:
        """bytes from the line, cut anywhere → what they complete."""

    def elapsed(self, seconds: float) -> Sequence[Event]:
        """s since the last call → what the waiting means."""

    def closed(self) -> Sequence[Event]:
        """the line is gone → what that means."""

    @property
    def sent(self) -> tuple[int, int]:
        """→ (bytes sent, bytes in all) of the program."""
