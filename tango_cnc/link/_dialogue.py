"""Question and answer, line by line: what the clients share that drive a plan move by move instead of sending a program.

The conversation is a generator: it yields what is to be sent (nothing: it only wants the next line), is sent each line that
comes, and puts down events on its way. `Stop` ends it with words for the person at the machine.
"""

from __future__ import annotations

import math
from collections.abc import Generator

from ..records import Machine, Move, Touch
from .client import Client, Event, Failed

LINE_LIMIT = 1024  # characters kept of a line that does not end
Talk = Generator[str, str, None]


def low(move: Move, touch: Touch, machine: Machine) -> bool:
    """move that has been made, its touch → whether the probe is now lower than where nothing of the table reaches."""
    if move.kind in ("approach", "find", "off", "near", "probe", "back", "prove"):
        return True
    place = {"retract": touch.leave, "clear": touch.enter}.get(move.kind)
    if place is None or any(place[machine.column(n)] != v for n, v in move.target.items()):
        return False
    return (
        math.dist(place, touch.standoff) < math.dist(touch.over, touch.standoff) - 1e-9
    )  # the last one goes up to where axes turn


class Stop(Exception):
    """The conversation cannot go on."""


class Dialogue(Client):
    """Four of the five verbs of a client, for a subclass that has a `_conversation` and says how much is `sent`."""

    drives = True  # every motion is asked for; where a program runs by itself, what it said meanwhile can still be read

    def __init__(self, patience: float) -> None:
        """s → ready to talk; `_allowed` is how long the other side may take from one `_done` to the next."""
        self._out = self._line = b""  # what is still to be sent; of a line, what has come
        self._events: list[Event] = []
        self._talk = self._conversation()
        self._started = self._over = self._asked = self._stopping = False
        self._silence, self._allowed = 0.0, patience

    def _conversation(self) -> Talk:
        raise NotImplementedError

    def _late(self) -> str:
        """→ what the other side has not done within `_allowed`."""
        raise NotImplementedError

    def _done(self) -> None:
        """The other side has done something: its silence begins anew."""
        self._silence = 0.0

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → the next piece of the request; empty while an answer is waited for."""
        if not self._started and not self._over:
            self._started = True
            self._advance(None)
        piece, self._out = self._out[:limit], self._out[limit:]
        return piece

    def receive(self, data: bytes) -> list[Event]:
        """bytes from the transport, cut anywhere → the events they complete."""
        *ended, rest = data.split(b"\n")
        for part in ended:
            text = (self._line + part)[-LINE_LIMIT:].decode("latin-1").strip("\r\0 ")
            self._line = b""
            if self._asked and not self._over and self._wanted(text):
                self._advance(text)
        self._line = (self._line + rest)[-LINE_LIMIT:]
        events, self._events = self._events, []
        return events

    def _wanted(self, text: str) -> bool:
        """line → whether it can be an answer: only when the question has gone out completely."""
        return not self._out

    def elapsed(self, seconds: float) -> list[Event]:
        """s since the last call → Failed when the other side takes longer than it may."""
        if self._over:
            return []
        self._silence += seconds
        if self._silence <= self._allowed:
            return []
        return self._fail(f"the control has not {self._late()} within {self._allowed:.0f} s")

    def closed(self) -> list[Event]:
        """the line is gone → what that means."""
        return [] if self._over else self._fail("the line was lost")

    def stop(self) -> bool:
        """The user wants an end → True: the move that is being made is waited for, then the probe is drawn clear."""
        self._stopping = True
        return True

    def _fail(self, why: str) -> list[Event]:
        self._over, self._out = True, b""
        return [Failed(why)]

    def _advance(self, text: str | None) -> None:
        self._asked = False
        try:
            request = next(self._talk) if text is None else self._talk.send(text)
            end = "" if request in ("", "?") else "\n"  # a line end after ? would be an empty line with an answer of its own
            self._out += f"{request}{end}".encode("ascii")
            self._asked = True
        except StopIteration:
            self._over = True
        except Stop as stop:
            self._events += self._fail(str(stop))
