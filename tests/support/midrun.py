"""Mistakes that begin while a machine is measured: `PYTHONPATH=tests python tests/support/midrun.py FIRST_SEED SEEDS`.

It prints those that are not named first, then the table of docs/measured_plausible.md.

Five machines with errors and facets drawn anew, twelve mistakes each, every size and moment drawn. A mistake counts as named where
the kind, the axis or side, and the touch where it begins (to within 8 touches) are right.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sim_controller.simulate import simulate
from support.coverage import EXAMPLES
from support.estimated import judged
from support.slips import _along
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement, Suspicion
from tango_cnc.records import Array, Cell, Readings, World

MACHINES = ("hu40t", "trunnion", "split", "fork_head", "huron")
NEAR = 8  # touches
Rng = np.random.Generator


@dataclass(frozen=True)
class Wrong:
    """Readings with a mistake, and whether a suspicion says what it is."""

    readings: Readings
    rows: Array  # (n,) bool, those that the mistake changed
    said: Callable[[Suspicion], bool]
    what: str


def usual(size: str, rng: Rng) -> float:
    """name of an error → one of a usual size, mm or rad."""
    if size[3:] in ("b", "1"):
        rotary = size[1] in "ABC"
        return float(rng.normal() * ((6e-6 if rotary else 5e-4) if size[3:] == "b" else 1.5e-5))
    return float(rng.normal() * (0.02 if size[1] in "XYZ" else 2e-5))


def drawn(example: str, seed: int) -> tuple[Cell, Readings]:
    """example, seed → its cell, readings of a machine and a table of its own."""
    cell, world = read_cell(EXAMPLES / example), read_world(EXAMPLES / example / "world.yaml")
    rng = np.random.default_rng([seed, MACHINES.index(example)])
    errors = {name: usual(name, rng) for name in world.errors}
    stylus = {name: float(rng.normal() * 0.01) for name in world.stylus}
    facets = {name: float(rng.normal() * 0.03) for name in world.facets}
    own: World = replace(world, errors=errors, stylus=stylus, facets=facets)
    return cell, simulate(cell.machine, cell.artefact, cell.strategy, own, seed=seed)


def _size(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))) * rng.choice([-1.0, 1.0]))


def _moment(n: int, rng: Rng) -> int:
    return int(rng.integers(round(0.05 * n), round(0.95 * n)))


def _near(s: Suspicion, readings: Readings, rows: Array) -> bool:
    """→ whether the touches of a suspicion begin where the mistake does."""
    begin = int(np.flatnonzero(rows)[0])
    if between := re.search(r"between touches (\d+) and (\d+)", s.change):  # those between do not show it
        before, first = (int(np.searchsorted(readings.touch, int(n))) for n in between.groups())
        return before - NEAR < begin <= first + NEAR
    said = re.search(r"touch(?:es)?(?: from)? (\d+)", s.text)
    number = s.touches[0] if s.touches else int(said[1]) if said else -99
    return abs(int(np.searchsorted(readings.touch, number)) - begin) <= NEAR


def _moves(s: Suspicion, axis: str) -> bool:
    """→ whether a step says that mostly this axis is elsewhere."""
    return s.kind == "step" and re.search(rf"\b{axis} [+-]", s.text) is not None


def _with(readings: Readings, columns: list[int], rows: Array, change: Callable[[Array], Array]) -> Readings:
    position = np.array(readings.position)
    position[np.ix_(rows, columns)] = change(position[np.ix_(rows, columns)])
    return replace(readings, position=position)


def _off(cell: Cell, readings: Readings, rng: Rng, rotary: bool, ends: bool) -> Wrong | None:
    machine, n = cell.machine, len(readings)
    name = str(rng.choice(machine.rotary if rotary else machine.linear))
    size = math.radians(_size(rng, 0.02, 10)) if rotary else _size(rng, 0.05, 50)
    first, end = _moment(n, rng), n
    if ends:
        first, end = sorted((first, _moment(n, rng)))
        if end - first < 6:
            return None
    rows = (np.arange(n) >= first) & (np.arange(n) < end)
    wrong = _with(readings, [machine.column(name)], rows, lambda p: p + size)
    shown = math.degrees(size) if rotary else size

    def said(s: Suspicion) -> bool:
        own = s.kind in ("zero_since", "column_wrong") and s.key == name
        return (own or _moves(s, name)) and _near(s, readings, rows)

    return Wrong(wrong, rows, said, f"{name} {shown:+.4g} rows {first}..{end} of {n}")


def _all_off(cell: Cell, readings: Readings, rng: Rng) -> Wrong | None:
    machine, n = cell.machine, len(readings)
    size, first = np.array([_size(rng, 0.05, 50) for _ in machine.linear]), _moment(n, rng)
    rows = np.arange(n) >= first
    wrong = _with(readings, [machine.column(c) for c in machine.linear], rows, lambda p: p + size)

    def said(s: Suspicion) -> bool:
        return (s.kind == "step" or (s.kind == "zero_since" and len(s.key.split(", ")) == 3)) and _near(s, readings, rows)

    return Wrong(wrong, rows, said, f"{np.round(size, 3).tolist()} from {first} of {n}")


def _columns(cell: Cell, readings: Readings, rng: Rng, how: str) -> Wrong | None:
    machine, n = cell.machine, len(readings)
    first = _moment(n, rng)
    kinds: tuple[str, ...]
    if how == "spindle":
        name, kinds = "S", ("column_wrong",)
        first = 1 if rng.random() < 0.3 else first
        change: Callable[[Array], Array] = np.zeros_like
    elif how == "still":
        name, kinds = str(rng.choice([*machine.linear, *machine.rotary])), ("copied_positions", "constant_column", "column_wrong")
        change = lambda p: np.full_like(p, p[0, 0])  # noqa: E731
    elif how == "inches":
        name, kinds = str(rng.choice(machine.linear)), ("unit_since",)
        change = lambda p: p / 25.4  # noqa: E731
    else:
        name, kinds = str(rng.choice([*machine.linear, *machine.rotary])), ("lost_sign",)
        change = np.abs
    column = machine.column(name)
    wrong = _with(readings, [column], np.arange(n) >= first, change)
    rows = np.abs(wrong.position[:, column] - readings.position[:, column]) > 1e-9
    if rows.sum() < 1:
        return None

    def said(s: Suspicion) -> bool:
        return s.kind in kinds and name in s.key.split(", ") and _near(s, readings, rows)

    return Wrong(wrong, rows, said, f"{name} {how} from {first} of {n}, {rows.sum()} rows from {np.flatnonzero(rows)[0]} changed")


def _late(cell: Cell, readings: Readings, rng: Rng, how: str) -> Wrong | None:
    n, size = len(readings), abs(_size(rng, 0.05, 5))
    deeper = _along(cell, readings, -size).position
    side = ""
    if how == "side":
        way = deeper - readings.position
        axis, sign = str(rng.choice(cell.machine.linear)), float(rng.choice([-1.0, 1.0]))
        rows = way[:, cell.machine.column(axis)] * sign > 0.7 * size
        own = sum(cell.machine.axis(axis).direction)  # the tip goes the other way where this axis carries the table
        sign *= -own if axis in cell.machine.workpiece_branch else own
        side = f"toward {axis}{'+' if sign > 0 else '-'}"
        if rows.sum() < 6:
            return None
    elif how == "since":
        rows = np.arange(n) >= _moment(n, rng)
    else:
        rows = rng.random(n) < rng.uniform(0.1, 0.4)
    wrong = replace(readings, position=np.where(rows[:, None], deeper, readings.position))

    def said(s: Suspicion) -> bool:
        if how == "since":
            return (s.kind == "late_touches" or (s.kind == "step" and " tip " in s.text)) and _near(s, readings, rows)
        return s.kind == "late_touches" and any(one in s.text for one in (side, f"toward {side[-1:]}{side[-2:-1]}"))

    return Wrong(wrong, rows, said, f"{size:.3f} mm, {how} {side}, first {np.flatnonzero(rows)[0]}, {rows.sum()} of {n}")


def _indexation(cell: Cell, readings: Readings, rng: Rng) -> Wrong | None:
    machine, n = cell.machine, len(readings)
    turned = [a for a in machine.rotary if np.ptp(readings.position[:, machine.column(a)]) > 0.3]
    if not turned:
        return None
    name, size = str(rng.choice(turned)), math.radians(_size(rng, 0.03, 2))
    columns = [machine.column(c) for c in (*machine.rotary, "S")]
    places = readings.position[:, columns]
    index = np.cumsum(np.any(np.abs(np.diff(places, axis=0, prepend=places[:1])) > 1e-6, axis=1))
    rows = index == rng.integers(index[-1] + 1)
    wrong = _with(readings, [machine.column(name)], rows, lambda p: p + size)

    def said(s: Suspicion) -> bool:
        last = bool(rows[-1]) and s.kind in ("zero_since", "column_wrong")
        return (s.kind == "indexation" or last) and name in s.key.split(", ") and _near(s, readings, rows)

    first = int(np.flatnonzero(rows)[0])
    return Wrong(wrong, rows, said, f"{name} {math.degrees(size):+.4f}, rows {first} to {first + rows.sum()} of {n}")


MISTAKES: dict[str, Callable[[Cell, Readings, Rng], Wrong | None]] = {
    "a linear axis off from a touch on": lambda c, r, g: _off(c, r, g, False, False),
    "a linear axis off for a while": lambda c, r, g: _off(c, r, g, False, True),
    "all linear axes off from a touch on": _all_off,
    "a rotary axis off from a touch on": lambda c, r, g: _off(c, r, g, True, False),
    "S is 0 from the second or a later touch on": lambda c, r, g: _columns(c, r, g, "spindle"),
    "a column that stands still from a touch on": lambda c, r, g: _columns(c, r, g, "still"),
    "an axis in inches from a touch on": lambda c, r, g: _columns(c, r, g, "inches"),
    "the sign of an axis lost from a touch on": lambda c, r, g: _columns(c, r, g, "sign"),
    "late toward one side of an axis": lambda c, r, g: _late(c, r, g, "side"),
    "late from a touch on": lambda c, r, g: _late(c, r, g, "since"),
    "10 to 40 % of the touches late": lambda c, r, g: _late(c, r, g, "some"),
    "one indexation turned by 0.03 to 2°": _indexation,
}


def spoilt(example: str, mistake: str, seed: int) -> tuple[Cell, Wrong] | None:
    """example, name of a mistake, seed → the cell and its readings with the mistake; None where it has no room."""
    cell, readings = drawn(example, seed)
    wrong = MISTAKES[mistake](cell, readings, np.random.default_rng([seed, MACHINES.index(example), list(MISTAKES).index(mistake)]))
    return None if wrong is None else (cell, wrong)


def trials(seeds: range) -> Iterator[tuple[str, str, int, Wrong, Judgement, int]]:
    """seeds → example, mistake, seed, what was done, what was said, rank of the right answer (0: not there)."""
    for seed in seeds:
        for example in MACHINES:
            for mistake in MISTAKES:
                found = spoilt(example, mistake, seed)
                if found is None:
                    continue
                cell, wrong = found
                said = judged(cell, wrong.readings)
                rank = next((i + 1 for i, s in enumerate(said.suspicions) if wrong.said(s)), 0)
                yield example, mistake, seed, wrong, said, rank


if __name__ == "__main__":
    count, firsts, threes, trusted = Counter[str](), Counter[str](), Counter[str](), 0
    begin = int(sys.argv[1])
    for example, mistake, seed, wrong, said, rank in trials(range(begin, begin + int(sys.argv[2]))):
        count[mistake] += 1
        firsts[mistake] += rank == 1
        threes[mistake] += 1 <= rank <= 3
        trusted += said.verdict == "trustworthy"
        if rank != 1:
            print(f"MISS rank {rank} {example} seed {seed}: {mistake}: {wrong.what}; {said.verdict}", flush=True)
            for s in said.suspicions[:3]:
                print(f"    {s.kind} [{s.key}] {s.text[:420]} first touch {s.touches[:1]} fits {s.fits}")
            for text in said.reasons[:3]:
                print(f"    reason: {text[:300]}")
    for mistake in MISTAKES:
        print(f"| {mistake} | {firsts[mistake]}, {threes[mistake]} of {count[mistake]} |")
    n = count.total()
    shares = f"{100 * firsts.total() / n:.1f}, {100 * threes.total() / n:.1f} %"
    print(f"together {firsts.total()}, {threes.total()} of {n} ({shares}), trustworthy {trusted}")
