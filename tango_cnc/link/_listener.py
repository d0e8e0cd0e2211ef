"""What the clients of one-way links have alike: a program that runs by itself, its records, and how long it may be silent."""

from __future__ import annotations

from ._punched import CODES
from .client import Asked, Client, Ended, Event, Failed, Refused, Task, Touched
from .words import SUM

MOVES = "It may be moving: press feed hold, and look at the machine first"  # where something runs that is not this run's program
# What to do where records have come and no more do: whoever starts it again there presses start with the ball at the table.
STANDS = (
    "read its screen. Where its program has stopped, do not start it again: reset the control, and move the probe away along the "
    "tool by hand"
)


class Listener(Client):
    """How far the program is, by the records that have come. A client of its own says what a whole line means (`_complete`)."""

    longest = 256  # characters of a line that are kept

    def __init__(self, task: Task) -> None:
        """task → nothing has come yet."""
        self._task = task
        self._letters = (*task.letters, SUM) if task.summed else task.letters
        self._begun = self._over = False
        self._position = 0  # of the next touch in task.numbers
        self._told = -1  # position for which a late record was noticed
        self._missed = 0  # touches in a row, up to the last record, that met nothing
        self._silence = 0.0
        self._line = bytearray()

    def receive(self, data: bytes) -> list[Event]:
        """bytes, cut anywhere → the events that whole lines among them mean; leader and print codes are no characters of a line."""
        events: list[Event] = []
        for byte in data:
            if byte in b"\r\n":
                text = self._line.decode("latin-1").strip()
                self._line.clear()
                events += self._complete(text) if text and not self._over else []
            elif byte not in CODES:
                self._line.append(byte)
                del self._line[: -self.longest]
        return events

    def _complete(self, text: str) -> list[Event]:
        """one line, not empty → what it means."""
        raise NotImplementedError

    def _counted(self, event: Event, text: str) -> list[Event]:
        """a record and the line that it was read from → events; it comes before the start mark, counts a touch, or is the end."""
        if not self._begun:
            return self._fail(f"a record came before the start mark: {text!r}. Was another program running? {MOVES}")
        if isinstance(event, Touched) and event.number in self._task.numbers:
            self._position = max(self._position, self._task.numbers.index(event.number) + 1)
            self._missed = 0 if event.flag else self._missed + 1
        if isinstance(event, Ended):
            if event.mark not in ("", self._task.mark):
                return [Refused(f"the end mark of another program, {event.mark}; this one is {self._task.mark}", text)]
            self._over = True
        return [event]

    def _waited(self, seconds: float) -> float | None:
        """s since the last call → s of silence that were allowed and are over; None while they are not, and behind the end."""
        if self._over:
            return None
        self._silence += seconds
        allowed = self._task.patience[self._position] if self._begun else self._task.start_patience
        return allowed if self._silence > allowed else None

    @property
    def _ended(self) -> str:
        """→ why the program may have ended by itself: a sentence without its end. '' where the records do not say so.

        The touch after which it ends is not on record: the alarm comes first.
        """
        row = self._task.misses - 1
        if not self._task.counted or not 0 < row <= self._missed or self._position >= len(self._task.numbers):
            return ""
        names = ", ".join(touch.facet for touch in self._task.plan.touches[self._position - row : self._position])
        last = f"touch (facet {names})" if row == 1 else f"{row} touches (facets {names})"
        return (
            f"the last {last} met nothing. After {self._task.misses} in a row that meet nothing the program ends with the alarm "
            "NO CONTACT, and sends no more"
        )

    def _noticed(self) -> list[Event]:
        """→ what the person reads when a record is late after touches that met nothing, once for each such touch."""
        if self._told == self._position or not self._begun or self._position >= len(self._task.due):
            return []
        if self._silence <= self._task.due[self._position] or not (why := self._ended):
            return []
        self._told = self._position
        return [
            Asked(f"{why}. Nothing has come for {self._silence:.0f} s: does the control show that alarm? Then press Ctrl-C here")
        ]

    def _fail(self, why: str, wrong: bool = False) -> list[Event]:
        self._over = True
        return [Failed(why, wrong)]
