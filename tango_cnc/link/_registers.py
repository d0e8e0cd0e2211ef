"""Registers asked for and written in words: what does not depend on who makes the moves."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from urllib.parse import unquote

from ._client import Job
from ._dialogue import Dialogue, Stop
from ._layout import ORDER, PATTERN, Layout, read_layout

UNANSWERED = 5  # requests in a row
WRITES = 3  # of one thing, each after a look at what the one before has done
READS = 4  # of the block until two agree
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


class Registers(Dialogue):
    """A dialogue with a control of this layout."""

    def __init__(self, job: Job, layout: Layout) -> None:
        """job, layout → ready to ask."""
        self._job, self._layout = job, layout
        self._given = self._sequence = 0
        self._unanswered = False  # a request since the block was read last: the control may have been switched off and on meanwhile
        super().__init__(job.start_patience)

    def _late(self) -> str:
        return f"done command {self._sequence}" if self._sequence else "come to rest: is a command still open, of a run before?"

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
            self._unanswered = True
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
        code = self._layout.functions["write"]
        reply = (yield f"{code} {address} {' '.join(map(str, words))}").split()
        self._unanswered |= reply[:1] != [str(code)]
        self._refusal(reply)

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

    def _tell(self, name: str) -> Talk:
        """command → the state when it stands in the registers with a new sequence. Raises Stop when they do not take it."""
        self._done()
        self._sequence = self._sequence % 0xFFFF + 1
        self._given += 1
        registers = self._layout.registers
        pair = {registers["command"]: self._layout.commands[name], registers["sequence"]: self._sequence}
        for _ in range(WRITES):
            yield from self._write(min(pair), [pair[address] for address in sorted(pair)])
            block = yield from self._read(self._layout.state)
            self._idle(block)
            if self._said("sequence", block) == self._sequence:
                return block
        raise Stop(f"the control does not take commands: {WRITES} times written, and the registers have not changed")

    def _steady(self, where: tuple[int, int], times: int) -> Talk:
        """(address, count), 1 or 2 → the registers, of two readings that agree when 2; empty when no two in a row do."""
        block = yield from self._read(where)
        for _ in range(READS - 1):
            again = block if times == 1 else (yield from self._read(where))
            if again == block:
                return block
            block = again
        return []

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


def _is_word(text: str) -> bool:
    return text.isdecimal() and int(text) <= 0xFFFF
