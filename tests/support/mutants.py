"""Files that nobody has written: what a slip, a bad disk or a stranger makes of a good one, and how a reader is judged.

`spoilt` makes the file. `tried` reads it: it must be read or refused in a sentence, within a second and without gigabytes, and
what was read must have no number that is none. The readers are in `readers.py`.
"""

from __future__ import annotations

import contextlib
import faulthandler
import math
import os
import random
import re
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from time import perf_counter, process_time
from types import FrameType
from typing import Any

import numpy as np

from tango_cnc.records import InputError

SLOW = 1.0  # s of computing for a file of some kB
HANGS = 10.0  # s of computing after which a reader is stopped
WAITS = 20.0  # s of time in which a file is read, also where others compute beside
STUCK = 120.0  # s of time after which a reader that waits, or that no signal reaches, ends the whole campaign with its stack
MUCH = 1 << 30  # bytes of memory that a reader may ask for
EVERY = 50  # files between two renewals of STUCK
# What stands where a word stood, or between two: no number, too much of one, what other programs write, what names other files.
WORDS = ["nan", "NaN", ".nan", ".NAN", "inf", "-inf", ".inf", "Infinity", "1e999", "-1e308", "1e308", "1e-320", "0", "-0.0", "-1"]
WORDS += ["9" * 5000, "0x1F", "0b11", "0o17", "1_000", "12:30:45", "2026-05-01", "1,5", "１２", "null", "~", "true", "no", "", " "]
WORDS += ["x" * 300, "x/" * 3000, "../" * 40, "/dev/zero", "/", ".", "a\0b", "\\ud800", '"\\ud800"', '"\\x00"', "é", "\u2028", "😀"]
WORDS += ["[]", "{}", "[[[", "{a: ", "*a", "&a ", "&a [*a]", "<<: *a", "!!python/object:os.system", "!!binary x", "? ", "---\n"]
WORDS += ["- ", ": ", "\t", "\n", "\r", "\x1a", "#", "'", '"', "|", ">", "%", "@", ",", ";", "{'a': 1}"]
WORDS += ["[" * 3000, "{" * 3000, '{"a":' * 3000]
BYTES = [word.encode() for word in WORDS]
IN_WORD = np.array([bool(re.match(rb"[\w.+-]", bytes([value]))) for value in range(256)], np.int8)


def spoilt(data: bytes, rng: random.Random) -> bytes:
    """file, chance → the same with one to three things wrong."""
    made = bytearray(data)
    for _ in range(rng.randrange(1, 4)):
        at = rng.randrange(len(made) + 1)
        other = rng.randrange(len(made) + 1)
        match rng.randrange(6):
            case 0:
                made[at:at] = rng.choice(BYTES)
            case 1:
                del made[at : at + rng.randrange(1, 30)]
            case 2:
                made[at : at + 1] = bytes([rng.randrange(256)])
            case 3:
                made[at:at] = made[other : other + rng.randrange(1, 60)]
            case _:
                words = _words(made)
                if len(words):
                    start, end = words[rng.choice(range(len(words)))]
                    made[start:end] = rng.choice(BYTES)
    return bytes(made)


def _words(data: bytearray) -> Any:
    """bytes → (n, 2) where words begin and end."""
    inside = np.zeros(len(data) + 2, np.int8)
    inside[1:-1] = IN_WORD[np.frombuffer(data, np.uint8)]
    return np.flatnonzero(np.diff(inside)).reshape(-1, 2)


@dataclass(frozen=True)
class Reader:
    """A kind of file: its name in the folder of a cell, its good text, what reads it there, and how else it is spoilt."""

    name: str
    text: Callable[[Path], bytes]
    read: Callable[[Path], Any]
    spoil: Callable[[bytes, random.Random], bytes] = spoilt  # four of five files; the others are spoilt as every kind
    refuses: tuple[type[Exception], ...] = (InputError,)
    limits: bool = False  # infinity is a number there


def numbers(value: Any) -> Iterator[float]:
    """whatever a reader gave → every float in it."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, np.ndarray):
        yield from (float(v) for v in value.ravel() if isinstance(v, float))
    elif is_dataclass(value):
        for field in fields(value):
            yield from numbers(getattr(value, field.name))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from numbers(key)
            yield from numbers(item)
    elif isinstance(value, list | tuple | set):
        for item in value:
            yield from numbers(item)


class Hangs(BaseException):
    """A reader that computes without end."""


@contextlib.contextmanager
def watched() -> Iterator[None]:
    """Within it a reader that hangs raises Hangs, and one that asks for gigabytes MemoryError. Windows has neither."""
    if sys.platform == "win32":
        yield
        return
    import resource

    def stop(_: int, frame: FrameType | None) -> None:
        raise Hangs

    of_before = signal.signal(signal.SIGVTALRM, stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (_data() + MUCH, hard))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        faulthandler.cancel_dump_traceback_later()
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
        signal.signal(signal.SIGVTALRM, of_before)


def _data() -> int:
    """→ bytes of memory that this process has asked for."""
    text = Path("/proc/self/status").read_text(encoding="ascii") if Path("/proc/self/status").exists() else ""
    found = re.search(r"VmData:\s*(\d+) kB", text)
    return int(found[1]) * 1024 if found else 4 * MUCH


def tried(folder: Path, reader: Reader) -> tuple[bool, str]:
    """folder with a spoilt file → whether it was refused; '' when it was read or refused as it must be, else what went wrong."""
    begun, came = process_time(), perf_counter()
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_VIRTUAL, HANGS)
    refused, wrong = False, ""
    try:
        found = list(numbers(reader.read(folder)))
    except reader.refuses as error:
        refused, wrong = True, _sentence(str(error))
    except (Exception, SystemExit, Hangs) as error:
        wrong = f"{type(error).__name__}: {str(error)[:100]} ({_where(error)})"
    else:
        if any(math.isnan(v) for v in found):
            wrong = "an accepted number that is none"
        elif not reader.limits and any(math.isinf(v) for v in found):
            wrong = "an accepted number that is infinite"
    if not wrong and process_time() - begun > SLOW:
        wrong = f"{process_time() - begun:.0f} s"
    if not wrong and perf_counter() - came > WAITS:
        wrong = f"{perf_counter() - came:.0f} s of waiting"
    return refused, wrong


def _sentence(text: str) -> str:
    """message of a refusal → what is wrong with it, or ''."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return f"a message that cannot be printed: {text[:100]!a}"
    return "" if len(text) <= 3000 else f"a message of {len(text)} characters: {text[:100]!a}"


def _where(error: BaseException) -> str:
    step, at = error.__traceback__, ""
    while step is not None:
        at, step = f"{Path(step.tb_frame.f_code.co_filename).name}:{step.tb_lineno} < {at}"[:160], step.tb_next
    return at


@dataclass(frozen=True)
class Campaign:
    """What spoilt files of one kind have come to."""

    files: int
    refused: int
    seconds: float
    wrong: Mapping[str, tuple[int, bytes]]  # what went wrong: its first seed, the spoilt file


def campaign(reader: Reader, folder: Path, seeds: range) -> Campaign:
    """kind of file, folder of a cell, seeds → what came of it; the good file is read first."""
    file = folder / reader.name
    file.parent.mkdir(parents=True, exist_ok=True)
    good = reader.text(folder)
    _put(file, good)
    reader.read(folder)
    wrong: dict[str, tuple[int, bytes]] = {}
    refusals, begun = 0, perf_counter()
    with watched():
        for seed in seeds:
            if seed % EVERY == 0:
                faulthandler.dump_traceback_later(STUCK, exit=True, file=sys.__stderr__)
            data = mutant(reader, good, seed)
            _put(file, data)
            refused, said = tried(folder, reader)
            refusals += refused
            if said:
                wrong.setdefault(said, (seed, data))
    return Campaign(len(seeds), refusals, perf_counter() - begun, wrong)


def mutant(reader: Reader, good: bytes, seed: int) -> bytes:
    """kind of file, a good one, seed → a spoilt one."""
    rng = random.Random(f"{reader.name} {seed}")
    return reader.spoil(good, rng) if rng.random() < 0.8 else spoilt(good, rng)


def _put(file: Path, data: bytes) -> None:
    handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        os.write(handle, data)
    finally:
        os.close(handle)
