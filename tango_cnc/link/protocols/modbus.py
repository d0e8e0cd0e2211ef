"""Touch by touch through registers: the PC asks for a move, the control echoes it, the PC confirms, the control makes it.

    check ▶ settled ▶ { request written ▶ echoed under a ticket ▶ ticket confirmed ▶ begun ▶ acknowledged ▶ read twice } ▶ end

What acts is the echo, never the request, and only when its ticket is confirmed while it is fresh. A request or a confirmation
that a gateway delivers late, twice or in another order therefore moves nothing: its sequence or its ticket has passed.
Nothing is written again before it has been read: a write that was not answered may well have been done. A measuring move goes
back to where it began before it is acknowledged: whatever happens to this end, the probe is not left in contact. What the
control says counts when two readings of the whole block agree; half old and half new values (a torn read) do not.
While something moves, this end writes the control's own tick back to it. The control stops when that grows old.

The lines between this client and the transport are requests and answers in words, one a line, codes and numbers in decimal:

    3 0 34      read 34 registers from 0                     3 17 0 …     their values
    16 60 1 2   write 1 and 2 to registers 60 and 61         16 60 2      done
                                                             ! 2          the control refuses with exception 2
                                                             - why        no answer, or not one to this question
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from typing import Any

from ...records import InputError, Move
from .. import _registers
from .._dialogue import Stop, low
from .._registers import CLOSE, READS, WORD, WRITES, Registers, Talk, Words, identified
from ..client import Begun, Ended, Event, Identified, Refused, Task, Touched
from ..layout import RUN, read_layout

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "layout": (),  # a file
    "run": ("touches", "program"),  # each move is asked for; or the control runs the program of the post
}
SCHEMES: Mapping[str, str] = {"modbus+tcp": "tcp", "modbus+rtu": "rtu"}
END = 0xFFFF  # point of the end mark


class Client(Registers):
    """Drives one plan, or lets the control run its program, and collects the readings."""

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client. Raises InputError for a layout that cannot carry the plan."""
        self._task, self._layout = task, read_layout(options.get("layout", ""))
        self._program = self.brought = options.get("run", "touches") == "program"  # then it comes to the control by other ways
        if self._program and RUN not in self._layout.commands:
            raise InputError(f"run=program: the layout has no command {RUN!r}")
        by_itself = "off" if task.plan.strategy.approach.find else "back"  # a measuring move goes back to where it began
        moves = [move for move in task.plan.moves if move.kind != by_itself]
        for letter in sorted({name for move in moves for name in move.target}):
            if letter not in self._layout.axes:
                raise InputError(f"layout: axes: found {' '.join(self._layout.axes)}; allowed: all that move, {letter} is missing")
            counts = [self._counts(letter, move.target[letter]) for move in moves if letter in move.target]
            self._layout.words([min(counts), max(counts)])
        self._moves = moves
        self._touches = {touch.number: touch for touch in task.plan.touches}
        self._order = {number: i for i, number in enumerate(task.numbers)}
        self._low: int | None = None  # touch at which the probe is down among the bodies of the table
        super().__init__(task, self._layout)

    @classmethod
    def named(cls, options: Mapping[str, str]) -> None:
        """{option: value} → nothing. Raises InputError naming file, line and key where the layout is wrong."""
        read_layout(options.get("layout", ""))

    @classmethod
    def begins(cls, options: Mapping[str, str]) -> bool:
        """{option: value} → True: each move is asked for from here, or the program is."""
        return True

    @classmethod
    def hello(cls, options: Mapping[str, str]) -> bytes:
        """{option: value} → bytes that ask the control what it is and move nothing."""
        return _registers.hello(options)

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
        """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
        return _registers.told(data, options)

    @classmethod
    def busy(cls, data: bytes, options: Mapping[str, str]) -> str:
        """what came after `hello` → why nobody may begin here unattended; empty where it is idle and its probe off."""
        return _registers.busy(data, options)

    @property
    def sent(self) -> tuple[int, int]:
        """→ (commands given, commands in all)."""
        return self._given, len(self._task.numbers) + 2 if self._program else len(self._moves) + 2

    def _conversation(self) -> Generator[str, str, None]:
        block = yield from self._read(self._layout.block)
        self._events.append(Identified(identified(self._layout, block)))
        block = yield from self._settled()
        self._free(block)
        self._sequence, self._taken = self._said("acknowledged", block), self._said("record", block)
        yield from self._follow() if self._program else self._drive()

    def _drive(self) -> Generator[str, str, None]:
        """Move by move: the control's resident program makes each of them."""
        yield from self._command("begin", self._task.start_patience)
        self._events.append(Begun(self._task.mark, len(self._task.numbers)))
        for move in self._moves:
            if self._stopping:
                yield from self._leave()
            self._allowed = self._task.patience[self._order[move.touch]]
            yield from self._make(move)
            self._low = move.touch if low(move, self._touches[move.touch], self._task.plan.machine) else None
        self._allowed = self._task.patience[-1]
        yield from self._goodbye((yield from self._command("end", self._allowed)) or self._last)
        self._events.append(Ended(len(self._task.numbers)))

    def _command(self, name: str, patience: float, **more: Any) -> Talk:
        """command → the block when it is done, of a measuring move read twice; empty when no two readings of it agree."""
        self._allowed = patience
        yield from self._tell(name, **more)
        while not self._finished(block := (yield from self._read(self._layout.state))):
            yield from self._attend(block)
        self._done()
        for _ in range(READS):  # a late answer is of before
            block = yield from self._steady(self._layout.block, 1 + (name == "probe"))
            if block and self._undisturbed(block):
                return block
        return []

    def _follow(self) -> Generator[str, str, None]:
        """Record by record: the control runs the program of the post and waits after each until it has been taken.

        The first record is the start mark: nothing moves before that has been taken, and it is taken only when it is the one
        of this program. Point 0 is the start mark, `END` the end mark. Records are counted on from run to run, so that the
        word for one that was taken yesterday takes none of today.
        """
        yield from self._tell(RUN)
        while True:
            block = yield from self._read(self._layout.block)
            ended, number = self._finished(block), self._said("record", block)
            if number == self._taken:
                if ended:
                    raise Stop("the program has ended before its end mark")
                yield from self._attend(block)
                continue
            if number != (self._taken + 1) % WORD:
                raise Stop(
                    f"record {number} came where record {(self._taken + 1) % WORD} was due: somebody else takes them, or the "
                    "program ran before"
                )
            block = yield from self._steady(self._layout.block, 2)
            if not block:
                raise Stop(f"record {number} has not been taken, and {self._changing()}")
            if self._stopping:
                raise Stop("stopped by the user; the control waits for its last record to be taken and moves no further: reset it")
            self._handed_over(block)
            self._given += 1
            self._done()
            self._allowed = self._task.patience[min(self._given - 2, len(self._task.patience) - 1)]
            self._heard = self._said("tick", block)
            yield from self._take(number)  # goes out when what the record said is on disk
            if self._said("point", block) == END:
                yield from self._over_there()
                self._events.append(Ended(self._said("count", block)))
                return

    def _over_there(self) -> Generator[str, str, None]:
        """The program has handed its last record over: it needs nobody for what little is left of it."""
        for _ in range(READS):
            block = yield from self._read(self._layout.state)
            if self._said("acknowledged", block) == self._sequence:
                yield from self._goodbye(block)
                return

    def _handed_over(self, block: Words) -> None:
        """One record → its event. Raises Stop for the start mark of another program."""
        point, count = self._said("point", block), self._said("count", block)
        mark = "".join(f"{word:04X}" for word in self._layout.of("mark", block, self._layout.block[0]))
        if (mark, count) != (self._task.mark.rjust(12, "0"), len(self._task.numbers)):
            ours = f"{self._task.mark} with {len(self._task.numbers)} touches"
            raise Stop(
                f"the control runs program {mark} with {count} touches, this run is {ours}: bring the new program to the control"
            )
        if point == 0:
            self._events.append(Begun(self._task.mark, count))
        elif point != END:
            place, flag = self._position(block), self._said("flag", block)
            text = f"P{point} H{flag} " + " ".join(f"{letter}{value:.4f}" for letter, value in place.items())
            known = flag in (0, 1, 2)
            self._events.append(Touched(point, flag, place, text) if known else Refused(f"flag {flag}; it is 0, 1 or 2", text))

    def _take(self, number: int) -> Generator[str, str, None]:
        """Writes that a record has been taken, until it stands there."""
        self._taken = number
        registers = self._layout.registers
        for _ in range(WRITES):
            yield from self._write(registers["confirmed"], [self._ticket, self._heard, number])
            if (yield from self._read((registers["taken"], 1))) == [number]:
                return
        raise Stop("what was written to taken is not in the registers afterwards: does the layout fit the control?")

    def _make(self, move: Move) -> Generator[str, str, None]:
        """One move of the plan; a measuring move becomes a record."""
        approach = self._task.plan.strategy.approach
        feed = approach.feed if move.kind == "probe" else approach.find.feed if move.kind == "find" and approach.find else 0.0
        target = {letter: self._counts(letter, value) for letter, value in move.target.items()}
        axes = self._layout.axes
        name = "probe" if move.kind in ("find", "probe") else "turn" if move.kind == "index" else "move"
        block = yield from self._command(
            name,
            self._allowed,
            mask=sum(1 << axes.index(letter) for letter in target),
            number=move.touch,
            feed=feed,
            target=[target.get(letter, 0) for letter in axes],
        )
        if move.kind == "probe":
            self._events.append(self._record(move.touch, block))
        elif not block:
            raise Stop(f"command {self._sequence}: {self._changing()}")
        elif move.kind != "find":
            self._arrived(target, block)
        self._last = block

    def _record(self, number: int, block: Words) -> Event:
        if not block:
            return Refused(f"touch {number}: {self._changing()}", "")
        place = self._position(block)
        point, flag = self._said("point", block), self._said("flag", block)
        text = f"P{point} H{flag} " + " ".join(f"{letter}{value:.4f}" for letter, value in place.items())
        if point != number & 0xFFFF:
            return Refused(f"the control speaks of touch {point} where touch {number} was made", text)
        if flag not in (0, 1, 2):
            return Refused(f"flag {flag}; it is 0 (no contact), 1 (contact) or 2 (early contact)", text)
        return Touched(number, flag, place, text)

    def _arrived(self, target: Mapping[str, int], block: Words) -> None:
        """Raises Stop when the axes do not stand where they were sent."""
        place = self._position(block)
        for letter, counts in target.items():
            wanted = self._layout.value(letter, counts)
            away = place[letter] - wanted
            if abs(away if letter in "XYZ" else math.remainder(away, 360.0)) > CLOSE:
                raise Stop(f"{letter} stands at {place[letter]:.4f} after it was sent to {wanted:.4f}")

    def _leave(self) -> Generator[str, str, None]:
        """Draws the probe clear when it is down at a facet, and ends the conversation."""
        if self._low is not None:
            if self._task.plan.strategy.approach.find:
                yield from self._make(Move("back", _linear(self._touches[self._low].standoff, self._task), self._low))
            yield from self._make(Move("retract", _linear(self._touches[self._low].over, self._task), self._low))
        yield from self._goodbye((yield from self._command("end", self._task.patience[-1])) or self._last)
        raise Stop("stopped by the user; the probe has been drawn clear")

    def _counts(self, letter: str, value: float) -> int:
        return self._layout.counts(letter, value if letter in "XYZ" else math.degrees(value))


def _linear(place: tuple[float, ...], task: Task) -> dict[str, float]:
    """place of the plan (mm, rad) → where the linear axes stand there, mm."""
    machine = task.plan.machine
    return {name: place[machine.column(name)] for name in machine.linear}
