"""One simulated machine with its control, from switching on to switching off, and the ledger of what truly happened."""

from __future__ import annotations

import dataclasses
import importlib
import json
import math
import pkgutil
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from functools import cache
from pathlib import Path
from typing import Any, TextIO, get_args, get_origin, get_type_hints

from tango_cnc.nearest import suggestion
from tango_cnc.records import InputError, Machine

from . import languages as languages
from .faults import Faults
from .languages import Alarm
from .motion import Motion
from .probing import Rig

LONGEST = 1000  # characters of a block
BUFFER = 4096  # bytes of program that the control takes in ahead of execution


@dataclass(frozen=True)
class Setup:
    """What `python -m sim_controller` is told: language, its settings, mode, pace, faults."""

    family: str = "macro_b"
    settings: Mapping[str, str] = dataclasses.field(default_factory=dict)
    streamed: bool = False
    speed: float = math.inf  # simulated seconds per real second
    faults: Faults = Faults()  # noqa: RUF009  frozen
    library: tuple[str, ...] = ()  # lines of programs that the control has stored
    buffer: int = BUFFER
    counted: bool = False  # TV check: a block of an odd number of characters is an alarm
    override: tuple[float, ...] = (1.0,)  # feed override of the panel, a factor: for each program in turn; the last one stays
    dry_run: float | None = None  # mm/min that dry run puts in place of every F
    goes_on: bool = False  # a probing move that begins with the probe deflected is carried out: it looks for an edge of the signal
    skip_obeys: bool = False  # whether probing moves obey override and dry run


class Ledger:
    """JSON lines, one an event, flushed at once; without a file it is only counted."""

    def __init__(self, file: Path | None) -> None:
        self._out: TextIO | None = file.open("w", encoding="utf-8") if file else None
        self._lock = threading.Lock()
        self._began = time.monotonic()

    def note(self, event: str, **data: Any) -> None:
        """event, what there is to say of it → one line."""
        if self._out is None:
            return
        with self._lock:
            self._out.write(json.dumps({"event": event, "real_s": round(time.monotonic() - self._began, 4), **data}) + "\n")
            self._out.flush()

    def close(self) -> None:
        """Closes the file."""
        if self._out is not None:
            self._out.close()


class Session:
    """What a protocol works with: it makes the control, runs tapes on it and writes the ledger."""

    def __init__(self, rig: Rig, setup: Setup, note: Callable[..., None] = lambda event, **data: None) -> None:
        self._rig, self._setup, self._put_down = rig, setup, note
        self.lost: list[str] = []  # what the program wanted of the control in vain, and the control is silent about
        self.family, self._language = setup.family, language(setup.family)
        self._profile = profile(self._language, rig.machine, setup.settings)
        self.buffer, self.counted = setup.buffer, setup.counted
        self.resident: Callable[[Motion, Callable[[bytes], None]], None] | None = None  # what a command starts
        self.device: Any = None  # of a protocol whose control outlives a connection
        self._moving: Motion | None = None
        self._programs = 0  # that have been run
        self.serial = False  # the line is one of characters, not of packets

    def note(self, event: str, **data: Any) -> None:
        """event, what there is to say of it → the ledger; what is lost is remembered."""
        if event == "lost":
            self.lost.append(f"{data['text']} ({data['why']})")
        if event == "stop" and data.get("message"):  # what the control shows until somebody presses cycle start
            self.show(f"stopped, on the screen: {data['message']}")
        self._put_down(event, **data)

    def motion(self) -> Motion:
        """→ the machine of a control that has just been switched on, at its reference position."""
        motion = self._moving = Motion(self._rig, self.note, self._wait, self._setup.faults, begins_deflected=self._setup.goes_on)
        self._dialled(motion)
        self.note("power", state="on", home=motion.position.tolist())
        return motion

    def control(self, punch: Callable[[bytes], None], motion: Motion | None = None, program: Path | None = None) -> Any:
        """where its output goes, a machine, file of a program beside which lies what it needs → a control that has just been
        switched on. Without a machine it stands at its reference position.
        """
        library = (*self._setup.library, *(self.beside(program) if program is not None else ()))
        return self._language.Control(motion or self.motion(), self._profile, punch, self.note, library)

    def beside(self, program: Path) -> tuple[str, ...]:
        """file of a program → lines of the files in its folder that the control has to have besides, each after its name; none
        of those that are stored already.
        """
        text, found = program.read_text(encoding="ascii", errors="replace"), list[str]()
        for file in sorted(program.parent.iterdir()):
            if self._language.CONTROLS.beside.fullmatch(file.name):
                asked = re.search(rf"\S*\\{re.escape(file.name)}", text)  # with the folder of the control, where it names one
                name = asked[0] if asked else file.name
                found += [] if name in self._setup.library else [name, *file.read_text(encoding="utf-8").splitlines()]
        return tuple(found)

    def keep(self, program: Path) -> None:
        """file of a program → the control has it, and a protocol may have it started; it is read then, as it is then."""

        def started(motion: Motion, punch: Callable[[bytes], None]) -> None:
            self.run(self.control(punch, motion, program), tape(program))

        self.resident = started

    def run(self, control: Any, lines: Iterator[str]) -> None:
        """control, lines of one tape → executed. Raises Alarm and Silence."""
        self.note("program", state="reading" if self._setup.streamed else "storing")
        if self._moving is not None:
            self._dialled(self._moving)
        self._programs += 1
        taken = (_taken(line) for line in lines)
        try:
            control.run(taken if self._setup.streamed else list(taken), self._setup.streamed)
        except (RecursionError, OverflowError) as error:
            raise Alarm("SYSTEM", "brackets too deep, or a number too large, for this control", str(error)) from None
        finally:
            if self._moving is not None:
                self._moving.lets_go()
        self.note("program", state="ended")

    def _dialled(self, motion: Motion) -> None:
        """machine → the panel stands as it should for the program that comes next."""
        override = self._setup.override[min(self._programs, len(self._setup.override) - 1)]
        motion.panel(override, self._setup.dry_run, self._setup.skip_obeys)

    def received(self, count: int) -> None:
        """bytes that came."""
        if count:
            self.note("input", bytes=count)

    def show(self, text: str) -> None:
        """What stands on the control's screen, for whoever watches stderr."""
        print(text, file=sys.stderr, flush=True)

    def _wait(self, seconds: float) -> None:
        if math.isfinite(self._setup.speed) and self._setup.speed > 0:
            time.sleep(seconds / self._setup.speed)


@cache
def families() -> tuple[str, ...]:
    """→ languages that can be interpreted: the files of `languages/`."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(languages.__path__) if not m.name.startswith("_")))


def tape(program: Path) -> Iterator[str]:
    """file of a program → its lines without the %. Raises Alarm for characters that no control has."""
    try:
        text = program.read_text(encoding="ascii")
    except UnicodeDecodeError as error:
        raise Alarm("SYSTEM", "a character that this control does not have", str(error)) from None
    yield from (line for line in text.splitlines() if line.strip() != "%")


def _taken(line: str) -> str:
    if len(line) > LONGEST:
        raise Alarm("SYSTEM", "a block too long for this control", f"{len(line)} characters, at most {LONGEST}")
    return line


def language(family: str) -> Any:
    """name → its module. Raises InputError for one that there is no file for."""
    if family not in families():
        raise InputError(f"--language: found {family!r}; allowed: {', '.join(families())}.{suggestion(family, families())}")
    return importlib.import_module(f"{languages.__name__}.{family}")


def profile(module: Any, machine: Machine, settings: Mapping[str, str]) -> Any:
    """language, machine, {field: text} → its profile. Raises InputError for unknown fields and values."""
    known = {field.name for field in dataclasses.fields(module.Profile)}
    hints = get_type_hints(module.Profile)
    values: dict[str, Any] = {}
    for name, text in settings.items():
        if name not in known:
            raise InputError(f"--set: found {name!r}; allowed: {', '.join(sorted(known))}.{suggestion(name, known)}")
        values[name] = _setting(name, text, hints[name])
    for name in values.get("axes", ()) + values.get("rollover", ()) + tuple(values.get("g54", ())):
        if name not in (*machine.linear, *machine.rotary):
            raise InputError(f"--set: found axis {name!r}; allowed: {' '.join((*machine.linear, *machine.rotary))}")
    return dataclasses.replace(module.default_profile(machine), **values)


def _setting(name: str, text: str, kind: Any) -> Any:
    def wrong(allowed: str) -> InputError:
        return InputError(f"--set {name}: found {text!r}; allowed: {allowed}")

    if kind is bool:
        if text not in ("true", "false"):
            raise wrong("true or false")
        return text == "true"
    if kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            raise wrong("a whole number" if kind is int else "a number") from None
        if not math.isfinite(number):
            raise wrong("a finite number")
        return number
    if kind is Decimal:
        try:
            value = Decimal(text)
        except InvalidOperation:
            raise wrong("a number") from None
        if not value.is_finite() or value <= 0:
            raise wrong("a number greater than 0")
        return value
    if kind is str:
        return text
    if get_origin(kind) is tuple:
        return tuple(text.replace(",", " ").split())
    if get_args(kind) and all(isinstance(a, str) for a in get_args(kind)):
        if text not in get_args(kind):
            raise wrong(", ".join(get_args(kind)))
        return text
    key = get_args(kind)[0]
    try:
        pairs = (item.split(":") for item in text.replace(",", " ").split())
        return {key(k): float(v) for k, v in pairs}
    except ValueError:
        raise wrong("number:number pairs, e.g. 1:187.4" if key is int else "name:number pairs, e.g. X:12.5,Y:-3") from None
