"""Which register means what: a YAML file (`modbus.yaml`, or the user's copy of it), and the numbers in and out of registers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path

from ..files.checked import Node, load
from ..files.composed import Pairs
from ..records import InputError

PATTERN, ORDER = 0x1234, 0x01020304
VERSION = 3
STANDARD = Path(__file__).with_name("modbus.yaml")
STATE = ("status", "acknowledged", "begun", "ticket", "tick", "point", "flag", "alarm", "probe", "record")
CONTROL = (*STATE, "position", "count", "mark", "version", "pattern", "order", "echo")  # what the control says
CONFIRM = ("confirmed", "heard", "taken")  # one write
COMPUTER = ("request", *CONFIRM)
REQUEST = ("client", "sequence", "command", "mask", "number", "feed", "target")  # in this order; client and feed of 32 bits
COMMANDS = ("begin", "move", "turn", "probe", "end")
RUN = "run"
STATUSES = ("idle", "busy", "alarm", "door", "emergency_stop", "hold", "battery_low")
TIMES = ("fresh", "silence")
WIDE = {"order": 2, "mark": 3}  # registers of a 32-bit value, and of the twelve digits of a mark
OLD = {  # why a control of an older layout is refused
    1: "could take a command that came late for a new one",
    2: "distinguished two runs by 16 bits, which may be the same by chance",
}
ANEW = "write its program anew by docs/link.md"
FEWEST = 4  # bits by which two commands differ
ALLOWED = {"read": (3, 4), "write": (16,)}
MOST = 120  # registers in one request; the standard allows 125 to be read and 123 to be written


@dataclass(frozen=True)
class Layout:
    """A layout that has been checked: addresses, codes and scales."""

    version: int
    big: bool
    functions: Mapping[str, int]
    registers: Mapping[str, int]
    axes: tuple[str, ...]
    scale: Mapping[str, float]
    commands: Mapping[str, int]
    statuses: Mapping[str, int]

    times: Mapping[str, int]

    @cached_property
    def block(self) -> tuple[int, int]:
        """→ (address, count) of everything that the control says, read in one request."""
        return self._range(CONTROL)

    @cached_property
    def state(self) -> tuple[int, int]:
        """→ (address, count) of the beginning of the block: all but places, program, constants and echo."""
        return self._range(STATE)

    def _range(self, names: Sequence[str]) -> tuple[int, int]:
        first = min(self.registers[name] for name in names)
        return first, max(self.registers[name] + self.width(name) for name in names) - first

    def width(self, name: str) -> int:
        """name → registers that it takes."""
        wide = 2 * len(self.axes)
        return {"position": wide, "request": wide + 8, "echo": wide + 8}.get(name, WIDE.get(name, 1))

    def owner(self, register: int) -> str:
        """register → name of the value that it is part of; its address where it is part of none."""
        names = (name for name, first in self.registers.items() if first <= register < first + self.width(name))
        return next(names, f"register {register}")

    def words(self, values: Sequence[int]) -> list[int]:
        """32-bit whole numbers → two registers each. Raises InputError for one that does not fit."""
        found: list[int] = []
        for value in values:
            if not -(1 << 31) <= value < 1 << 31:
                raise InputError(f"Modbus: found {value} counts; allowed: 32 bits; choose a coarser scale in the layout")
            high, low = value >> 16 & 0xFFFF, value & 0xFFFF
            found += [high, low] if self.big else [low, high]
        return found

    def numbers(self, words: Sequence[int]) -> list[int]:
        """registers, two a value → 32-bit whole numbers with sign."""
        pairs = [(a, b) if self.big else (b, a) for a, b in zip(words[::2], words[1::2], strict=True)]
        return [(high << 16 | low) - (high >> 15 << 32) for high, low in pairs]

    def counts(self, letter: str, value: float) -> int:
        """axis letter, mm or deg → counts."""
        return round(value / self.scale["linear" if letter in "XYZ" else "rotary"])

    def value(self, letter: str, counts: int) -> float:
        """axis letter, counts → mm or deg."""
        return round(counts * self.scale["linear" if letter in "XYZ" else "rotary"], 9)

    def of(self, name: str, words: Sequence[int], start: int) -> list[int]:
        """name, registers read from `start` on → its numbers: one register each, or two for 32 bits."""
        at, width = self.registers[name] - start, self.width(name)
        part = list(words[at : at + width])
        return self.numbers(part) if name in ("position", "order") else part


def read_layout(file: str = "") -> Layout:
    """name of a YAML file, nothing for the layout that comes with this program → layout.

    Raises InputError naming file, line and key of what is wrong.
    """
    root = load(Path(file) if file else STANDARD)
    known = ("layout", "word_order", "functions", "times", "registers", "axes", "scale", "commands", "statuses")
    if not isinstance(root.raw, Pairs):  # not shown: it may be any file of this computer
        raise InputError(
            f"layout: {file} is no layout of registers; allowed: a copy of {STANDARD.name}, which comes with this program"
        )
    version = dict(root.items()).get("layout")
    if version is not None and version.integer(0) != VERSION:
        found = version.integer(0)
        why = f"; a control of version {found} {OLD[found]}: {ANEW}" if found in OLD else ""
        raise version.wrong(f"{VERSION}{why}; copy the layout that comes with this program")
    keys = root.fields(known)
    functions = _numbers(keys["functions"], ("read", "write"))
    for name, code in functions.items():
        if code not in ALLOWED[name]:
            raise keys["functions"].fields(("read", "write"))[name].wrong(" or ".join(map(str, ALLOWED[name])))
    axes = tuple(node.text("XYZABCS") for node in keys["axes"].list())
    scale = {name: node.number(above=0.0) for name, node in keys["scale"].fields(("linear", "rotary", "feed")).items()}
    layout = Layout(
        keys["layout"].integer(0),
        keys["word_order"].text(("big", "little")) == "big",
        functions,
        _numbers(keys["registers"], (*CONTROL, *COMPUTER)),
        axes,
        scale,
        _numbers(keys["commands"], COMMANDS, (RUN,)),
        _numbers(keys["statuses"], STATUSES),
        _numbers(keys["times"], TIMES),
    )
    taken: dict[int, str] = {}
    for name, first in layout.registers.items():
        for register in range(first, first + layout.width(name)):
            if register in taken:
                raise keys["registers"].wrong(f"registers that do not overlap: {register} is {taken[register]} and {name}")
            taken[register] = name
    confirm = [layout.registers[name] for name in CONFIRM]
    if confirm != list(range(confirm[0], confirm[0] + len(confirm))):
        raise keys["registers"].wrong(f"{', '.join(CONFIRM)} side by side in this order, to be written in one request")
    if layout.block[1] > MOST:
        raise keys["registers"].wrong(f"registers that one request can carry: at most {MOST} from the first to the last")
    for name, codes in (("commands", layout.commands), ("statuses", layout.statuses)):
        if len(set(codes.values())) != len(codes):
            raise keys[name].wrong("a number of its own for each")
    for (one, code), (other, another) in combinations({"nothing": 0, **layout.commands}.items(), 2):
        if (code ^ another).bit_count() < FEWEST or another > 0xFFFF:
            raise keys["commands"].wrong(f"codes of 16 bits that differ in {FEWEST} bits or more, from 0 too: {one} and {other}")
    if not 1 <= layout.times["fresh"] <= layout.times["silence"] <= 60:
        raise keys["times"].wrong("1 ≤ fresh ≤ silence ≤ 60")
    return layout


def _numbers(node: Node, names: Sequence[str], optional: Sequence[str] = ()) -> dict[str, int]:
    return {name: value.integer(0) for name, value in node.fields(names, optional).items()}
