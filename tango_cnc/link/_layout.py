"""Which register means what: a YAML file (`modbus.yaml`, or the user's copy of it), and the numbers in and out of registers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..files.checked import Node, load
from ..records import InputError

PATTERN, ORDER = 0x1234, 0x01020304
STANDARD = Path(__file__).with_name("modbus.yaml")
CONTROL = (
    "command",
    "sequence",
    "acknowledged",
    "status",
    "point",
    "flag",
    "alarm",
    "probe",
    "position",
    "version",
    "pattern",
    "order",
)
STATE = ("command", "sequence", "acknowledged", "status", "point", "flag", "alarm", "probe")
RESIDENT = ("record", "count", "mark", "taken")  # of a control that runs the program of the post and hands its records over
TARGET = ("mask", "number", "feed", "target")
COMMANDS = ("begin", "move", "turn", "probe", "end")
RUN = "run"
STATUSES = ("idle", "busy", "alarm", "door", "emergency_stop", "hold", "battery_low")
WIDE = {"order": 2, "feed": 2, "mark": 3}  # registers of a 32-bit value, and of the twelve digits of a mark
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

    @cached_property
    def block(self) -> tuple[int, int]:
        """→ (address, count) of everything that the control says and of the command it was given, read in one request."""
        return self._range(CONTROL)

    @cached_property
    def resident(self) -> bool:
        """→ whether the control can be told to run the program that it has."""
        return RUN in self.commands and all(name in self.registers for name in RESIDENT)

    @cached_property
    def whole(self) -> tuple[int, int]:
        """→ (address, count) of the block and of what a running program writes beside it."""
        return self._range((*CONTROL, *(name for name in RESIDENT[:-1] if name in self.registers)))

    @cached_property
    def state(self) -> tuple[int, int]:
        """→ (address, count) of the beginning of the block: all but positions and constants."""
        first = self.block[0]
        return first, max(self.registers[name] + 1 for name in STATE) - first

    @cached_property
    def targets(self) -> tuple[int, int]:
        """→ (address, count) of what is written before a command."""
        return self._range(TARGET)

    def _range(self, names: Sequence[str]) -> tuple[int, int]:
        first = min(self.registers[name] for name in names)
        return first, max(self.registers[name] + self.width(name) for name in names) - first

    def width(self, name: str) -> int:
        """name → registers that it takes."""
        return 2 * len(self.axes) if name in ("position", "target") else WIDE.get(name, 1)

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
        return self.numbers(part) if width > 1 and name != "mark" else part


def read_layout(file: str = "") -> Layout:
    """name of a YAML file, nothing for the layout that comes with this program → layout.

    Raises InputError naming file, line and key of what is wrong.
    """
    root = load(Path(file) if file else STANDARD)
    keys = root.fields(("layout", "word_order", "functions", "registers", "axes", "scale", "commands", "statuses"))
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
        _numbers(keys["registers"], (*CONTROL, *TARGET), RESIDENT),
        axes,
        scale,
        _numbers(keys["commands"], COMMANDS, (RUN,)),
        _numbers(keys["statuses"], STATUSES),
    )
    taken: dict[int, str] = {}
    for name, first in layout.registers.items():
        for register in range(first, first + layout.width(name)):
            if register in taken:
                raise keys["registers"].wrong(f"registers that do not overlap: {register} is {taken[register]} and {name}")
            taken[register] = name
    if abs(layout.registers["sequence"] - layout.registers["command"]) != 1:
        raise keys["registers"].wrong("command and sequence side by side, to be written in one request")
    if max(layout.whole[1], layout.targets[1]) > MOST:
        raise keys["registers"].wrong(f"registers that one request can carry: at most {MOST} from the first to the last")
    for name in ("commands", "statuses"):
        codes: Mapping[str, int] = getattr(layout, name)
        if len(set(codes.values())) != len(codes):
            raise keys[name].wrong("a number of its own for each")
    return layout


def _numbers(node: Node, names: Sequence[str], optional: Sequence[str] = ()) -> dict[str, int]:
    return {name: value.integer(0) for name, value in node.fields(names, optional).items()}
