"""Registers asked for and written in words: what does not depend on who makes the moves."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from urllib.parse import unquote

from ._dialogue import Dialogue, Stop
from .client import Task
from .layout import ANEW, OLD, ORDER, PATTERN, Layout, read_layout

UNANSWERED = 5  # requests in a row
WRITES = 3  # of one thing, each after a look at what the one before has done
READS = 4  # of the block until two agree
LOOKS = 4  # for what has to be there at once, before it is asked for again
WORD = 0x10000
CLOSE = 0.01  # mm or deg between two places that are the same
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
        old = f". It {OLD[version]}: {ANEW}" if version in OLD else ""
        raise Stop(f"the control has version {version} of the layout, this end has version {layout.version}{old}")
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
    state, probe = _state(layout, block)
    return True, [*sentences, f"its status is {state}, the probe signal is {'on' if probe else 'off'}"]


def busy(data: bytes, options: Mapping[str, str]) -> str:
    """what came after `hello` → why nobody may begin here unattended; empty where it is idle and its probe off."""
    layout = read_layout(options.get("layout", ""))
    answers = data.decode("latin-1").split("\n")[:-1]
    if len(answers) < 2 or answers[1][:1] in ("-", "!"):
        return ""
    state, probe = _state(layout, [int(word) for word in answers[1].split()[1:]])
    if state != "idle":
        return f"its status is {state}, not idle"
    return "the probe signal is on" if probe else ""


def _state(layout: Layout, block: Words) -> tuple[str, bool]:
    """layout, registers of its block → name of the status, whether the probe signal is on."""
    status = layout.of("status", block, layout.block[0])[0]
    state = next((name for name, code in layout.statuses.items() if code == status), f"unknown state {status}")
    return state.replace("_", " "), bool(layout.of("probe", block, layout.block[0])[0])


class Registers(Dialogue):
    """A dialogue with a control of this layout.

    A command is asked for, echoed, confirmed and done: nothing acts but the request that stands in the echo, and only when its
    ticket, which the control has just made up, is confirmed. A request that comes late is echoed under a ticket that nobody
    confirms; a confirmation that comes late bears a ticket that is none any more.
    """

    def __init__(self, task: Task, layout: Layout) -> None:
        """task, layout → ready to ask."""
        self._task, self._layout = task, layout
        self._given = self._sequence = 0
        self._ticket = -1  # of the last command of this end that was begun
        self._heard = -1  # tick that the control has been told
        self._taken = 0
        self._last: Words = []  # the block after the last command
        self._odd = 0  # looks in a row at a control that speaks of other commands than those of this end
        self._restless: set[int] = set()  # registers in which two readings in a row differed, where no two agreed
        super().__init__(task.start_patience)

    def _late(self) -> str:
        return f"done command {self._sequence}" if self._given else "come to rest: is a command still open, of a run before?"

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
        raise Stop(
            f"{UNANSWERED} requests for registers {where[0]}… were not answered{why}. Is the control switched on, and is no other "
            "program connected to it?"
        )

    def _refusal(self, reply: Sequence[str]) -> str:
        """answer that is none → what is known of the reason. Raises Stop when the control will never do it."""
        if reply[:1] != ["!"] or len(reply) < 2 or not reply[1].isdecimal():
            said = " ".join(reply[1:])
            return f": {said}" if reply[:1] == ["-"] and said != "no answer" else ""
        code = int(reply[1])
        if code in LATER:
            return ": it is busy"
        raise Stop(f"the control refuses a request with exception {code} ({EXCEPTIONS.get(code, 'not a standard one')})")

    def _write(self, address: int, words: Words) -> Generator[str, str, None]:
        """Writes once; whether it was done is for the caller to read."""
        code = self._layout.functions["write"]
        self._refusal((yield f"{code} {address} {' '.join(map(str, words))}").split())

    def _attend(self, block: Words) -> Generator[str, str, None]:
        """Tells the control that this end is there: the tick that it counted last. What was confirmed and taken is repeated."""
        if (tick := self._said("tick", block)) != self._heard:
            self._heard = tick
            yield from self._write(self._layout.registers["confirmed"], [max(self._ticket, 0), tick, self._taken])

    def _silent(self, block: Words, heard: int) -> bool:
        return (self._said("tick", block) - heard) % WORD > self._layout.times["silence"]

    def _settled(self) -> Talk:
        """→ the block when nothing moves, no command is open and nobody else talks to the control.

        A run that was cut off leaves a `heard` that grows old. One that changes is of another program, which is alive.
        """
        at = (self._layout.registers["heard"], 1)
        first: int | None = None
        while True:
            heard = (yield from self._read(at))[0]
            first = heard if first is None else first
            if heard != first:
                raise Stop("another program drives this control: end it there first")
            block = yield from self._read(self._layout.block)
            if self._idle(block) and self._silent(block, heard):
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

    def _tell(
        self, name: str, mask: int = 0, number: int = 0, feed: float = 0.0, target: Sequence[int] = ()
    ) -> Generator[str, str, None]:
        """command, what it needs (mm/min; counts) → it has begun. Raises Stop when the control does not take it.

        Between the echo and the confirmation the control is looked at once more: it has to be free, to stand where the last
        command left it, and to have heard of no other one since.
        """
        self._done()
        layout, sequence = self._layout, (self._sequence + 1) % WORD
        goal = layout.words([*target, *(0 for _ in layout.axes[len(target) :])])
        wanted = [*layout.words([self._task.nonce]), sequence, layout.commands[name], mask, number & 0xFFFF]
        wanted += [*layout.words([round(feed / layout.scale["feed"])]), *goal]
        self._given += 1
        for _ in range(WRITES):
            yield from self._write(layout.registers["request"], wanted)
            block = yield from self._echoed(wanted)
            if not block:
                continue
            self._ready(block)
            ticket, self._heard = self._said("ticket", block), self._said("tick", block)
            for _ in range(WRITES):
                yield from self._write(layout.registers["confirmed"], [ticket, self._heard, self._taken])
                for _ in range(LOOKS):
                    block = yield from self._read(layout.state)
                    if self._said("begun", block) == ticket:
                        self._sequence, self._ticket = sequence, ticket
                        return
                    self._idle(block)
                    self._undisturbed(block)
                self._heard = self._said("tick", block)
                if self._said("ticket", block) != ticket:
                    break  # it has grown old, or another request came between
        raise Stop(
            f"the control does not take commands: {WRITES} times asked for, and not begun. Does its program fit the layout? "
            "Does another program write to it as well?"
        )

    def _echoed(self, wanted: Words) -> Talk:
        """request → the block when the control has taken exactly that and would begin it; empty when it has not."""
        for _ in range(LOOKS):
            block = yield from self._read(self._layout.block)
            idle = self._idle(block)
            if self._undisturbed(block) and idle and self._layout.of("echo", block, self._layout.block[0]) == wanted:
                return block
        return []

    def _undisturbed(self, block: Words) -> bool:
        """block → whether the last command that the control began is one of this end, and done.

        Raises Stop when several looks in a row say otherwise; one of them may be a late answer.
        """
        found = self._said("begun", block), self._said("acknowledged", block)
        ours = self._ticket < 0 or found == (self._ticket, self._sequence)
        self._odd = 0 if ours else self._odd + 1
        if self._odd > LOOKS:
            raise Stop(
                f"the control began ticket {found[0]} and has done command {found[1]}, where {self._ticket} and {self._sequence} "
                "were the last ones of this end: it has been switched off and on, or another program drives it as well"
            )
        return ours

    def _ready(self, block: Words) -> None:
        """Raises Stop unless the control is as the last command has left it, free for the next one."""
        self._free(block)
        if not self._last:
            return
        before, now = self._position(self._last), self._position(block)
        away = [letter for letter, value in now.items() if abs(value - before[letter]) > CLOSE]
        if away:
            raise Stop(f"{' '.join(away)} moved since the last command was done, and nothing had been asked for")

    def _finished(self, block: Words) -> bool:
        """state → whether the command that was begun last is done. Raises Stop when it never will be."""
        idle, done = self._idle(block), self._said("acknowledged", block) == self._sequence
        if self._said("begun", block) == self._ticket and idle and done:
            self._odd = 0
            return True
        self._odd = self._odd + 1 if idle or self._said("begun", block) != self._ticket else 0
        if self._odd > LOOKS:
            raise Stop(
                f"the control has begun command {self._sequence}, has not done it and waits for another one: it has been reset, "
                "switched off and on, or another program drives it as well"
            )
        return False

    def _goodbye(self, block: Words) -> Generator[str, str, None]:
        """Tells the control that nobody listens any more: the next run need not wait until that shows."""
        gone = (self._said("tick", block) + WORD // 2) % WORD
        yield from self._write(self._layout.registers["confirmed"], [max(self._ticket, 0), gone, self._taken])

    def _steady(self, where: tuple[int, int], times: int) -> Talk:
        """(address, count), 1 or 2 → the registers, of two readings that agree when 2; empty when no two in a row do."""
        block = yield from self._read(where)
        self._restless = set()
        for _ in range(READS - 1):
            again = block if times == 1 else (yield from self._read(where))
            if self._but_tick(again) == self._but_tick(block):
                return again
            self._restless |= {where[0] + i for i, (old, new) in enumerate(zip(block, again, strict=True)) if old != new}
            block = again
        return []

    def _changing(self) -> str:
        """→ why the readings of the registers after a command did not count, and what the control's program has to do."""
        if not self._restless:
            return f"{READS} readings in a row speak of another command than the one that is done"
        changing = ", ".join(sorted({self._layout.owner(register) for register in self._restless} - {"tick"}))
        return (
            f"no two of {READS} readings of the registers in a row agree, as these go on changing: {changing}. The control's "
            "program has to put all values into the registers before it acknowledges, and leave them alone until the next command"
        )

    def _but_tick(self, block: Words) -> Words:
        at = self._layout.registers["tick"] - self._layout.block[0]
        return [*block[:at], *block[at + 1 :]]

    def _position(self, block: Words) -> dict[str, float]:
        counts = self._layout.of("position", block, self._layout.block[0])
        names = self._task.plan.machine.names
        return {
            letter: self._layout.value(letter, n) for letter, n in zip(self._layout.axes, counts, strict=True) if letter in names
        }

    def _free(self, block: Words) -> None:
        """Raises Stop when the probe signal is on: nobody knows what the probe touches, or whether it would feel anything."""
        if self._said("probe", block) != 0:
            raise Stop("the probe signal is on although nothing is measured: is the probe free and alive?")


def _is_word(text: str) -> bool:
    return text.isdecimal() and len(text) <= 5 and int(text) <= 0xFFFF
