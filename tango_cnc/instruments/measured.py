"""What an instrument showed, out of a CSV file, against what was predicted."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path as File

import numpy as np
from scipy import special

from ..files.checked import complaint, read_text, rows_of
from ..iso230.signed import OnPart
from ..records import Array
from .chance import RARE, distance, slip
from .path import Path
from .predict import Predicted

COVERAGE = 0.95
LARGEST = 1e5  # µm
SENSES = {"+": 1.0, "1": 1.0, "+1": 1.0, "-": -1.0, "-1": -1.0, "−": -1.0}


@dataclass(frozen=True)
class InstrumentReadings:
    """Readings of an instrument, means of the runs at a command and sense: commands mm or rad, readings µm."""

    command: Array  # (n,)
    sense: Array  # (n,)
    reading: Array  # (q, n)
    runs: int  # the least at any command and sense


@dataclass(frozen=True)
class Agreement:
    """One figure measured and predicted, µm; `normalized` is E_n of ISO 17043: beyond ±1 they differ."""

    name: str
    measured: float
    predicted: OnPart
    normalized: float | None  # None where the figure is withheld

    @property
    def verdict(self) -> str:
        """→ agrees, differs, or not known."""
        return "not known" if self.normalized is None else "agrees" if abs(self.normalized) <= 1 else "differs"


@dataclass(frozen=True)
class Compared:
    """All readings and figures of a test, µm."""

    figures: tuple[Agreement, ...]
    difference: Array  # (q, n) measured minus predicted, without what setting up takes out
    rms: float
    expected: float  # rms that prediction and instrument allow for
    inside: float  # share of readings within their own 95 % interval
    chance: float  # share of true files that are as far off or farther
    slip: str = ""  # a unit or a sign that explains a difference

    @property
    def far(self) -> bool:
        """→ whether the readings are farther from the prediction than chance makes a true file once in a hundred."""
        return self.chance < RARE


def read_measured(file: File, channels: tuple[str, ...], turns: bool) -> InstrumentReadings:
    """CSV file, channels, whether the command is an angle → what was measured.

    Columns: `angle_deg` or `position_mm`, `direction` (+ or −), and `<channel>_um` for each channel. Raises InputError by line.
    """
    first = "angle_deg" if turns else "position_mm"
    wanted = (first, "direction", *(f"{c}_um" for c in channels))
    lines = [line for line in enumerate(read_text(file).splitlines(), 1) if line[1].strip() and not line[1].startswith("#")]
    if not lines:
        raise complaint(file, None, "", "no line", f"write the columns {', '.join(wanted)}")
    comma = ";" if ";" in lines[0][1] else ","
    head = [w.strip() for w in rows_of(file, [lines[0][1]], comma, lines[0][0])[0]]
    missing = [w for w in wanted if w not in head]
    if missing:
        raise complaint(file, lines[0][0], "header", ", ".join(head), f"the columns {', '.join(wanted)}; {missing[0]} is missing")
    place = [head.index(w) for w in wanted]
    groups: dict[tuple[float, float], list[list[float]]] = defaultdict(list)
    for number, line in lines[1:]:
        words = [w.strip() for w in rows_of(file, [line], comma, number)[0]]
        if len(words) < len(head):
            raise complaint(file, number, "", f"{len(words)} words", f"allowed: {len(head)}, as in the header")
        row = [words[i] for i in place]
        if row[1] not in SENSES:
            raise complaint(file, number, "direction", repr(row[1]), "+ or -: the sense in which the command was reached")
        values = [
            _number(file, number, w, word, comma) for w, word in zip((wanted[0], *wanted[2:]), (row[0], *row[2:]), strict=True)
        ]
        command = math.radians(values[0]) if turns else values[0]
        groups[round(command, 9), SENSES[row[1]]].append(values[1:])
    if len(groups) < 3 + len(channels):
        raise complaint(file, None, first, f"{len(groups)} different commands", f"allowed: {3 + len(channels)} or more")
    keys = sorted(groups, key=lambda k: (-k[1], k[0]))
    reading = np.array([np.mean(groups[k], axis=0) for k in keys]).T
    command, sense = np.array(keys).T
    return InstrumentReadings(command, sense, reading, min(len(v) for v in groups.values()))


def _number(file: File, line: int, column: str, word: str, comma: str) -> float:
    try:
        value = float(word.replace(",", ".") if comma == ";" else word)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST:
        raise complaint(file, line, column, repr(word), f"a number, −{LARGEST:g} … {LARGEST:g}")
    return value


def compare(told: Predicted, measured: InstrumentReadings, expanded: float = 0.0) -> Compared:
    """what was predicted at the commands of the file, what was measured, U (k = 2) of one reading (µm) → how they agree."""
    path: Path = told.path
    q, n = path.ways.shape[:2]
    found = told.free @ measured.reading.reshape(q * n)
    difference = found.reshape(q, n) - told.value
    own = (expanded / 2) ** 2 * np.diag(told.free @ told.free.T)
    std = np.sqrt(told.std.reshape(q * n) ** 2 + own).reshape(q, n)
    wide = float(special.ndtri(0.5 + COVERAGE / 2))
    figures = []
    for row, figure in zip(told.rows, told.figures, strict=True):
        values = row.weights @ found
        size = float(np.ptp(values)) if len(values) > 1 else float(values[0])
        figures.append(Agreement(row.name, size, figure, _normalized(size, figure, row.weights @ told.free, expanded)))
    inside = float(np.mean(np.abs(difference) <= wide * std + 1e-9))
    rms, allowed = float(np.sqrt(np.mean(difference**2))), float(np.sqrt(np.mean(std**2)))
    beyond = distance(told, expanded)
    chance = beyond.chance(difference.reshape(q * n))
    return Compared(tuple(figures), difference, rms, allowed, inside, chance, slip(told, measured.reading, beyond))


def _normalized(size: float, figure: OnPart, weights: Array, expanded: float) -> float | None:
    if figure.value is None or figure.interval is None:
        return None
    # a range has two ends; each carries the uncertainty of a reading
    each = float(np.max(np.sum(weights**2, axis=1))) ** 0.5
    own = expanded * each * (2**0.5 if len(weights) > 1 else 1.0)
    off = size - figure.value
    side = figure.interval[1] - figure.value if off > 0 else figure.value - figure.interval[0]
    total = math.hypot(side, own)
    return 0.0 if off == 0 else off / total if total > 0 else math.copysign(math.inf, off)
