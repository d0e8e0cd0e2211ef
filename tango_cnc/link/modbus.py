"""Touch by touch through registers: the PC writes a target and a command, the control's resident program makes the move.

    check ▶ settled ▶ begin ▶ { target written, read back ▶ command and sequence written ▶ acknowledged ▶ read twice } ▶ end

A command counts when its sequence is a new one, so that writing it again after an answer that never came moves nothing twice.
Nothing is written again before it has been read: a write that was not answered may well have been done. The target stands in
the registers, read back, before its sequence is written. A measuring move goes back to where it began before it is
acknowledged: whatever happens to this end, the probe is not left in contact. What the control says counts when two readings
of the whole block agree; half old and half new values (a torn read) do not.

The lines between this client and the transport are requests and answers in words, one a line, codes and numbers in decimal:

    3 0 34      read 34 registers from 0                     3 17 0 …     their values
    16 40 1 2   write 1 and 2 to registers 40 and 41         16 40 2      done
                                                             ! 2          the control refuses with exception 2
                                                             - why        no answer, or not one to this question
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from urllib.parse import unquote

from ..records import InputError, Move, Touch
from ._client import Begun, Ended, Event, Identified, Job, Refused, Touched
from ._dialogue import Dialogue, Stop, low
from ._layout import ORDER, PATTERN, Layout, read_layout

OPTIONS: Mapping[str, tuple[str, ...]] = {"layout": ()}  # a file
UNANSWERED = 5  # requests in a row
WRITES = 3  # of one thing, each after a look at what the one before has done
READS = 4  # of the block until two agree
CLOSE = 0.01  # mm or deg between target and the place that was reached
EXCEPTIONS = {1: "it does not know the function", 2: "no such register", 3: "a value it does not allow", 4: "it failed"}
LATER = (5, 6)  # exceptions that say "ask again"
BAD = {
    "alarm": "it is in alarm",
    "door": "its door is open",
    "emergency_stop": "emergency stop",
    "hold": "it is in feed hold",
    "battery_low": "the battery of the probe is low",
}

Words = list[int]
Talk = Generator[str, str, Words]


def hello(options: Mapping[str, str]) -> bytes:
    """{option: value} → requests that move nothing: who are you (function 43/14), and the block of registers."""
    layout = read_layout(options.get("layout", ""))
    return f"43 0\n{layout.functions['read']} {layout.block[0]} {layout.block[1]}\n".encode("ascii")


def identified(layout: Layout, block: Words) -> str:
    """layout, block of registers → what is known of the device. Raises Stop when these are not the registers of the layout."""
    start = layout.block[0]
    pattern, version, order = (layout.of(name, block, start)[0] for name in ("pattern", "version", "order"))
    if pattern != PATTERN:
        at = layout.registers["pattern"]
        raise Stop(f"register {at} holds {pattern:04X} hex instead of {PATTERN:04X}: another layout, or counted from 1")
    if version != layout.version:
        raise Stop(f"the control has version {version} of the layout, this end {layout.version}")
    if order != ORDER:
        swapped = (order & 0xFFFF) << 16 | order >> 16 & 0xFFFF
        other = "little" if layout.big else "big"
        advice = f"set word_order: {other} in the layout" if swapped == ORDER else "32-bit values are coded otherwise"
        raise Stop(f"word order: found {order & 0xFFFFFFFF:08X} hex instead of {ORDER:08X}: {advice}")
    return f"Modbus, register layout {version}, {'big' if layout.big else 'little'} word order"


def told(data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
    """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
    layout = read_layout(options.get("layout", ""))
    answers = data.decode("latin-1").split("\n")[:-1]
    if not answers:
        return False, ["nothing has been asked yet"]
    names = [unquote(text) for text in answers[0].split()[1:]] if answers[0].startswith("43") else []
    refused = answers[0].startswith("!")
    sentences = [f"the device calls itself {', '.join(names)}"] if names else []
    sentences += ["the device does not say what it is (it refuses function 43/14, as many do)"] if refused else []
    if len(answers) < 2 or answers[1].startswith("-"):
        said = "" if refused or names else ": address, device number, on a serial line baud rate and parity?"
        return False, [*sentences, f"the registers were not answered{said}"]
    words = answers[1].split()
    if words[0] == "!":
        why = EXCEPTIONS.get(int(words[1]), "not a standard one")
        return False, [*sentences, f"it refuses to read the registers of the layout: exception {words[1]} ({why})"]
    block = [int(word) for word in words[1:]]
    try:
        sentences.append(identified(layout, block))
    except Stop as stop:
        return False, [*sentences, str(stop)]
    status = layout.of("status", block, layout.block[0])[0]
    state = next((name for name, code in layout.statuses.items() if code == status), f"unknown state {status}")
    probe = "on" if layout.of("probe", block, layout.block[0])[0] else "off"
    return True, [*sentences, f"its status is {state.replace('_', ' ')}, the probe signal is {probe}"]


class Client(Dialogue):
    """Drives one plan and collects its readings."""

    def __init__(self, job: Job, options: Mapping[str, str]) -> None:
        """job, {option: value of `OPTIONS`} → client. Raises InputError for a layout that cannot carry the plan."""
        self._job, self._layout = job, read_layout(options.get("layout", ""))
        moves = [move for move in job.plan.moves if move.kind != "back"]
        for letter in sorted({name for move in moves for name in move.target}):
            if letter not in self._layout.axes:
                raise InputError(f"layout: axes: found {' '.join(self._layout.axes)}; allowed: all that move, {letter} is missing")
            counts = [self._counts(letter, move.target[letter]) for move in moves if letter in move.target]
            self._layout.words([min(counts), max(counts)])
        self._moves = moves
        self._touches = {touch.number: touch for touch in job.plan.touches}
        self._order = {number: i for i, number in enumerate(job.numbers)}
        self._given = self._sequence = 0
        self._low: int | None = None  # touch at which the probe is down among the bodies of the table
        self._last: Words = []  # the block after the last command
        super().__init__(job.start_patience)

    @property
    def sent(self) -> tuple[int, int]:
        """→ (commands given, commands in all)."""
        return self._given, len(self._moves) + 2

    def _late(self) -> str:
        return f"done command {self._sequence}"

    def _conversation(self) -> Generator[str, str, None]:
        block = yield from self._read(self._layout.block)
        self._events.append(Identified(identified(self._layout, block)))
        block = yield from self._settled()
        self._free(block)
        self._sequence = self._said("acknowledged", block)
        yield from self._command("begin", self._job.start_patience)
        self._events.append(Begun(self._job.mark, len(self._job.numbers)))
        for move in self._moves:
            if self._stopping:
                yield from self._leave()
            self._allowed = self._job.patience[self._order[move.touch]]
            yield from self._make(move)
            self._low = move.touch if low(move, self._touches[move.touch], self._job.plan.machine) else None
        self._allowed = self._job.patience[-1]
        yield from self._command("end", self._allowed)
        self._events.append(Ended(len(self._job.numbers)))

    def _said(self, name: str, block: Words) -> int:
        return self._layout.of(name, block, self._layout.block[0])[0]

    def _read(self, where: tuple[int, int]) -> Talk:
        """(address, count) → the registers; a request without answer is put again, as reading changes nothing."""
        code = self._layout.functions["read"]
        why = ""
        for _ in range(UNANSWERED):
            reply = (yield f"{code} {where[0]} {where[1]}").split()
            if reply[:1] == [str(code)] and len(reply) == where[1] + 1 and all(_is_word(word) for word in reply[1:]):
                return [int(word) for word in reply[1:]]
            why = self._refusal(reply) or why
        raise Stop(f"{UNANSWERED} requests for registers {where[0]}… were not answered{why}")

    def _refusal(self, reply: Sequence[str]) -> str:
        """answer that is none → what is known of the reason. Raises Stop when the control will never do it."""
        if reply[:1] != ["!"] or len(reply) < 2 or not reply[1].isdecimal():
            return f": {' '.join(reply[1:])}" if reply[:1] == ["-"] else ""
        code = int(reply[1])
        if code in LATER:
            return ": it is busy"
        raise Stop(f"the control refuses a request with exception {code} ({EXCEPTIONS.get(code, 'not a standard one')})")

    def _write(self, address: int, words: Words) -> Generator[str, str, None]:
        """Writes once; whether it was done is for the caller to read."""
        reply = yield f"{self._layout.functions['write']} {address} {' '.join(map(str, words))}"
        self._refusal(reply.split())

    def _settled(self) -> Talk:
        """→ the block when nothing moves and no command is open, be it of a run that was cut off."""
        while True:
            block = yield from self._read(self._layout.block)
            if self._idle(block) and self._said("acknowledged", block) == self._said("sequence", block):
                return block

    def _idle(self, block: Words) -> bool:
        """block → whether the control waits for a command. Raises Stop when it cannot take any."""
        status = self._said("status", block)
        name = next((name for name, code in self._layout.statuses.items() if code == status), None)
        if name in BAD or name is None:
            number = self._said("alarm", block)
            state = BAD[name] if name else f"it is in the unknown state {status}"
            raise Stop(f"the control cannot move: {state}{f', number {number}' if number else ''}")
        return name != "busy"

    def _command(self, name: str, patience: float) -> Talk:
        """command → the block when it is done, of a measuring move read twice; empty when no two readings of it agree."""
        self._allowed = patience
        self._done()
        self._sequence = self._sequence % 0xFFFF + 1
        self._given += 1
        registers = self._layout.registers
        pair = {registers["command"]: self._layout.commands[name], registers["sequence"]: self._sequence}
        words = [pair[address] for address in sorted(pair)]
        yield from self._write(min(pair), words)
        writes = 1
        while True:
            block = yield from self._read(self._layout.state)
            idle = self._idle(block)
            if self._said("sequence", block) != self._sequence:
                if writes == WRITES:
                    raise Stop(f"the control does not take commands: {WRITES} times written, and the registers have not changed")
                writes += 1
                yield from self._write(min(pair), words)
            elif idle and self._said("acknowledged", block) == self._sequence:
                break
        self._done()
        block = yield from self._read(self._layout.block)
        for _ in range(READS - 1):
            again = block if name != "probe" else (yield from self._read(self._layout.block))
            if again == block:
                return block
            block = again
        return []

    def _make(self, move: Move) -> Generator[str, str, None]:
        """One move of the plan; a measuring move becomes a record."""
        feed = self._job.plan.strategy.approach.feed if move.kind == "probe" else 0.0
        target = {letter: self._counts(letter, value) for letter, value in move.target.items()}
        axes = self._layout.axes
        words = {
            "mask": [sum(1 << axes.index(letter) for letter in target)],
            "number": [move.touch & 0xFFFF],
            "feed": self._layout.words([round(feed / self._layout.scale["feed"])]),
            "target": self._layout.words([target.get(letter, 0) for letter in axes]),
        }
        first, count = self._layout.targets
        wanted = [0] * count
        for name, part in words.items():
            at = self._layout.registers[name] - first
            wanted[at : at + len(part)] = part
        for _ in range(WRITES):
            yield from self._write(first, wanted)
            if (yield from self._read((first, count))) == wanted:
                break
        else:
            raise Stop("what is written as target does not stand in the registers afterwards: does the layout fit the control?")
        if not self._last:
            self._last = yield from self._settled()
        self._free(self._last)
        name = "probe" if move.kind == "probe" else "turn" if move.kind == "index" else "move"
        block = yield from self._command(name, self._allowed)
        if name == "probe":
            self._events.append(self._record(move.touch, block))
        elif not block:
            raise Stop(f"the registers keep changing after command {self._sequence} is done")
        else:
            self._arrived(target, block)
        self._last = block

    def _record(self, number: int, block: Words) -> Event:
        if not block:
            return Refused(f"touch {number}: {READS} readings of the registers in a row were all different", "")
        place = self._position(block)
        point, flag = self._said("point", block), self._said("flag", block)
        text = f"P{point} H{flag} " + " ".join(f"{letter}{value:.4f}" for letter, value in place.items())
        if point != number & 0xFFFF:
            return Refused(f"the control speaks of touch {point} where touch {number} was made", text)
        if flag not in (0, 1, 2):
            return Refused(f"flag {flag}; it is 0 (no contact), 1 (contact) or 2 (early contact)", text)
        return Touched(number, flag, place, text)

    def _position(self, block: Words) -> dict[str, float]:
        counts = self._layout.of("position", block, self._layout.block[0])
        names = self._job.plan.machine.names
        return {
            letter: self._layout.value(letter, n) for letter, n in zip(self._layout.axes, counts, strict=True) if letter in names
        }

    def _free(self, block: Words) -> None:
        """Raises Stop when the probe signal is on: nobody knows what the probe touches, or whether it would feel anything."""
        if self._said("probe", block) != 0:
            raise Stop("the probe signal is on although nothing is measured: is the probe free and alive?")

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
            yield from self._make(Move("retract", _linear(self._touches[self._low], self._job), self._low))
        yield from self._command("end", self._job.patience[-1])
        raise Stop("stopped by the user; the probe has been drawn clear")

    def _counts(self, letter: str, value: float) -> int:
        return self._layout.counts(letter, value if letter in "XYZ" else math.degrees(value))


def _linear(touch: Touch, job: Job) -> dict[str, float]:
    """touch → where the linear axes stand above it, mm."""
    machine = job.plan.machine
    return {name: touch.over[machine.column(name)] for name in machine.linear}


def _is_word(text: str) -> bool:
    return text.isdecimal() and int(text) <= 0xFFFF
