"""What may go wrong in a session, on purpose: with the machine at a known touch (`--fault NAME=TOUCH`), with the bytes on the
line by a seeded chance (`--line-fault NAME=CHANCE`, `--line-seed N`)."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tango_cnc.nearest import suggestion
from tango_cnc.records import InputError

from .lines import Line

KINDS: Mapping[str, str] = {
    "stop-after": "the control falls silent in the middle of the program after that many touches (power cut)",
    "probe-stuck-after": "the probe signal stays on after that many touches",
    "alarm-after": "the machine raises an alarm after that many touches (servo, lubrication)",
    "door-after": "the door is opened after that many touches",
    "estop-after": "somebody presses emergency stop after that many touches",
    "battery-low-after": "the probe reports a low battery after that many touches",
    "reset-after": "the control is reset in the middle of the motion that follows that many touches",
    "bounce-after": "the probe signal is on once more when the search begins that follows that many touches",
}
WORDS: Mapping[str, str] = {
    "stop-after": "silence",
    "probe-stuck-after": "stuck",
    "alarm-after": "alarm",
    "door-after": "door",
    "estop-after": "estop",
    "battery-low-after": "battery",
    "reset-after": "reset",
    "bounce-after": "bounce",
}
LINE_KINDS: Mapping[str, str] = {
    "drop": "a byte is lost",
    "flip": "a bit of a byte is turned over",
    "double": "a byte comes twice",
    "delay": "everything from this byte on comes late",
    "late": "everything from this byte on comes so late that nobody waits for the answer any more",
    "split": "the bytes from here on come in a piece of their own",
    "merge": "what is sent here comes together with what is sent next",
    "other": "a byte has become any other one",
}
LATE = {"delay": 0.3, "late": 1.5}  # s
BLOCK = 4096  # bytes whose fate is drawn at once


@dataclass(frozen=True)
class Faults:
    """Fault name → number of touches after which it happens."""

    after: Mapping[str, int] = field(default_factory=dict)

    def after_touch(self, touch: int) -> str | None:
        """touches made so far → the word of `WORDS` for what happens now, or None."""
        return next((WORDS[name] for name, after in self.after.items() if after == touch), None)


class Disturbance:
    """Bytes → what arrives of them, by chance; the same seed and the same bytes give the same faults."""

    def __init__(self, chances: Mapping[str, float], seed: int) -> None:
        self._chances = np.array([chances.get(kind, 0.0) for kind in LINE_KINDS])
        self._random = np.random.default_rng([seed, 0xFA17])
        self._others = np.random.default_rng([seed, 0x07E4])  # of its own, so that a seed means what it meant without them
        self._kept = b""
        self._ahead: deque[tuple[int, list[str]]] = deque()  # bytes that something will happen to, counted from the first
        self._seen = self._drawn = 0
        self.happened: dict[str, int] = {}

    def __call__(self, data: bytes) -> list[tuple[float, bytes]]:
        """bytes → (s later than they should, bytes) of every piece that arrives."""
        hits = self._hits(len(data))
        if not hits and not self._kept:
            return [(0.0, data)] if data else []
        pieces: list[tuple[float, bytearray]] = [(0.0, bytearray(self._kept))]
        self._kept = b""
        keep, at = False, 0
        for i, now in hits:
            pieces[-1][1].extend(data[at:i])
            byte, at = data[i], i + 1
            for kind in now:
                self.happened[kind] = self.happened.get(kind, 0) + 1
            if begins := [LATE.get(kind, 0.0) for kind in now if kind in ("delay", "late", "split")]:
                pieces.append((max(begins), bytearray()))
            keep |= "merge" in now
            if "drop" in now:
                continue
            turned = byte ^ 1 << int(self._random.integers(8)) if "flip" in now else byte
            turned = (turned + int(self._others.integers(1, 256))) % 256 if "other" in now else turned
            pieces[-1][1].extend([turned, turned] if "double" in now else [turned])
        pieces[-1][1].extend(data[at:])
        if keep and not any(late for late, _ in pieces):
            self._kept = b"".join(bytes(piece) for _, piece in pieces)
            return []
        return [(late, bytes(piece)) for late, piece in pieces if piece]

    def _hits(self, count: int) -> list[tuple[int, list[str]]]:
        """→ (index, what happens to it) of the bytes among the next `count` that something happens to."""
        while self._drawn < self._seen + count:
            hits = self._random.random((BLOCK, len(LINE_KINDS) - 1)) < self._chances[:-1]
            hits = np.column_stack([hits, self._others.random(BLOCK) < self._chances[-1]])
            for row in np.flatnonzero(hits.any(axis=1)).tolist():
                self._ahead.append((self._drawn + row, [kind for kind, hit in zip(LINE_KINDS, hits[row], strict=True) if hit]))
            self._drawn += BLOCK
        found = []
        while self._ahead and self._ahead[0][0] < self._seen + count:
            i, now = self._ahead.popleft()
            found.append((i - self._seen, now))
        self._seen += count
        return found

    def rest(self) -> bytes:
        """→ what was kept back to come with the next bytes, when there are none."""
        rest, self._kept = self._kept, b""
        return rest


class FaultyLine:
    """A line whose bytes are disturbed in both directions; what happens to them goes into the ledger."""

    def __init__(self, line: Line, chances: Mapping[str, float], seed: int, note: Callable[..., None]) -> None:
        self._line, self._note = line, note
        self._out, self._in = Disturbance(chances, 2 * seed), Disturbance(chances, 2 * seed + 1)

    def receive(self, timeout: float) -> bytes:
        """s → what has come. Raises Closed."""
        data = self._line.receive(timeout)
        return b"".join(self._late(self._in, data))

    def send(self, data: bytes) -> None:
        """bytes → what is left of them is sent. Raises Closed."""
        for piece in self._late(self._out, data):
            self._line.send(piece)

    def close(self) -> None:
        """Hangs up."""
        self._line.close()

    def _late(self, disturbance: Disturbance, data: bytes) -> Iterable[bytes]:
        if not data:
            yield disturbance.rest()
        before = dict(disturbance.happened)
        pieces = disturbance(data)
        for kind, count in disturbance.happened.items():
            if count > before.get(kind, 0):
                self._note("line fault", kind=kind, to="control" if disturbance is self._in else "computer")
        for late, piece in pieces:
            time.sleep(late)
            yield piece


def faults(texts: Iterable[str]) -> Faults:
    """['stop-after=40', …] → faults. Raises InputError for an unknown name or no whole number."""
    after: dict[str, int] = {}
    for text in texts:
        name, value = _named(text, "--fault", KINDS, "N")
        if not value.isdecimal() or int(value) < 1:
            raise InputError(f"--fault {name}: found {value!r}; allowed: a whole number of touches from 1, e.g. {name}=40")
        after[name] = int(value)
    return Faults(after)


def line_faults(texts: Iterable[str]) -> dict[str, float]:
    """['flip=0.001', …] → {name: chance for every byte}. Raises InputError for an unknown name or no chance."""
    chances: dict[str, float] = {}
    for text in texts:
        name, value = _named(text, "--line-fault", LINE_KINDS, "CHANCE")
        try:
            chances[name] = float(value)
        except ValueError:
            chances[name] = -1.0
        if not 0 <= chances[name] <= 1:
            raise InputError(f"--line-fault {name}: found {value!r}; allowed: a chance for every byte, 0 to 1, e.g. {name}=0.001")
    return chances


def _named(text: str, option: str, known: Iterable[str], unit: str) -> tuple[str, str]:
    name, _, value = text.partition("=")
    if name not in known:
        raise InputError(f"{option}: found {name!r}; allowed: {', '.join(f'{k}={unit}' for k in known)}.{suggestion(name, known)}")
    return name, value
