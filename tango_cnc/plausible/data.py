"""What the readings themselves give away: touches that are missing, made twice, made elsewhere or all alike, clocks, roundings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from ..judgement import Verdict
from ..kinematics import chain, spindle_axis, tip
from ..records import Array, Cell, Readings
from .copies import copied, last_digit

NEEDED = 0.9  # share of the planned touches without which a result is doubtful
ENOUGH = 0.6  # share below which commands end with 1: about half of the plan
HARDLY = 0.25  # share below which a machine is hardly measured
AWAY = -0.02  # least cosine between normal and spindle: other facets face away, and plans leave them out
TURNED = 0.1  # degrees between the rotary positions of strategy and readings that are the same position
FEW = 8  # numbers that a sentence names
EXACT = 2e-5  # mm from the nominal contact: nearer than any probe repeats
COARSE = 0.01  # mm: positions that are all whole multiples of it were rounded, or come from a display


class Remark(NamedTuple):
    """A sentence on the readings, and the best verdict that it leaves."""

    verdict: Verdict
    text: str
    touches: tuple[int, ...] = ()
    kind: str = ""  # of a mistake with the readings; empty: a symptom, for which the mistake has to be looked for
    key: str = ""  # column of the readings
    change: str = ""
    incomplete: bool = False
    file: str = "readings"  # in which the mistake is: readings, machine, artefact, strategy
    sure: bool = False  # it explains the result, whatever else is tried
    moves: tuple[str, ...] = ()  # coefficients that it makes untrusted


def remarks(cell: Cell, readings: Readings, left_out: Collection[int] = ()) -> Iterator[Remark]:
    """cell, readings, touches that the plan left out → what is wrong with the readings themselves."""
    yield from _missing(cell, readings, left_out)
    yield from _twice(readings)
    pasted = list(_pasted(cell, readings))
    yield from pasted or _echoed(readings)
    yield from _clock(readings)
    yield from _rounded(readings)
    yield from _alike(readings)
    yield from _nominal(cell, readings)
    yield from _another_strategy(cell, readings)


def listed(numbers: tuple[int, ...] | list[int]) -> str:
    """touch numbers → the first of them for a sentence."""
    return ", ".join(map(str, numbers[:FEW])) + (f" and {len(numbers) - FEW} more" if len(numbers) > FEW else "")


def planned(cell: Cell) -> tuple[list[str], Array, Array]:
    """cell → facet of every touch of its strategy, rotary positions (n, k) rad, whether a straight stylus can make it (n,)."""
    machine = cell.machine
    facets = [f for i in cell.strategy.indexations for f in i.facets]
    at = [[i.position.get(name, 0.0) for name in machine.names] for i in cell.strategy.indexations for _ in i.facets]
    position = np.array(at).reshape(-1, len(machine.names))
    normal = np.array([cell.artefact.facets[f].normal for f in facets])
    up = spindle_axis(chain(machine), position)
    return facets, position, np.einsum("ij,ij->i", normal, up) >= AWAY


def _missing(cell: Cell, readings: Readings, left_out: Collection[int]) -> Iterator[Remark]:
    facets, _, possible = planned(cell)
    everything = set((np.flatnonzero(possible) + 1).tolist()) - set(left_out)
    passes = sorted(set(zip(readings.day.tolist(), readings.cycle.tolist(), strict=True)))
    made = set(
        zip(
            readings.day[readings.ok].tolist(),
            readings.cycle[readings.ok].tolist(),
            readings.touch[readings.ok].tolist(),
            strict=True,
        )
    )
    lacking = [(d, c, t) for d, c in passes for t in sorted(everything) if (d, c, t) not in made]
    expected = len(everything) * len(passes)
    share = 1 - len(lacking) / expected if expected else 1.0
    if lacking:
        numbers = tuple(t for _, _, t in lacking)
        gone = len({t for t in numbers} - set(readings.touch.tolist()))
        text = (
            f"{len(lacking)} of {expected} planned touches are missing or made no proper contact ({listed(numbers)}"
            f"{f'; {gone} of them are not in the file' if gone else ''})"
        )
        if share < NEEDED:
            hint = "go on with 'tango run --resume', or measure again" if gone else "look for what kept them from contact"
            verdict: Verdict = "implausible" if share < HARDLY else "doubtful"
            there = f"{expected - len(lacking)} are there; " if share < ENOUGH else ""
            told = f"{text}: {there}{hint}"
            yield Remark(verdict, told, numbers, "missing_touches", "touch", hint, incomplete=share < ENOUGH)
        else:
            yield Remark("trustworthy", text, numbers)
    if beyond := sorted({int(t) for t in readings.touch if not 1 <= t <= len(facets)}):
        yield Remark(
            "doubtful",
            f"touches {listed(beyond)} are in the readings and not in the strategy, which has {len(facets)}: the readings are of "
            "another program, or strategy.yaml was changed after it",
            tuple(beyond),
            "another_program",
            "touch",
            "take the strategy.yaml that the program was made from",
        )


def _twice(readings: Readings) -> Iterator[Remark]:
    keys = zip(readings.touch.tolist(), readings.cycle.tolist(), readings.day.tolist(), strict=True)
    many = sorted({key[0] for key, n in Counter(keys).items() if n > 1})
    if many:
        yield Remark(
            "doubtful",
            f"touches {listed(many)} are in the readings more than once with the same cycle and day: keep one row of each, or "
            "number the repetitions in the column 'cycle'",
            tuple(many),
            "repeated_touches",
            "touch",
            "keep one row of each",
        )


def _echoed(readings: Readings) -> Iterator[Remark]:
    rows, count = np.unique(readings.position[readings.ok], axis=0, return_counts=True)
    if len(rows) and not coarse(readings) and count.max() > 2 and count.sum() - len(rows) > 0.05 * count.sum():
        yield Remark(
            "doubtful",
            f"{int(count[count > 1].sum())} touches have exactly the position of another one: no machine repeats every digit; the "
            "readings were copied, or the control reports where it was sent and not where the probe tripped",
            (),
            "copied_positions",
            "X, Y, Z",
            "record the position that the control latches at the trigger",
        )


def _pasted(cell: Cell, readings: Readings) -> Iterator[Remark]:
    found = list(copied(cell.machine, readings))
    if not found:
        return
    (day, cycle), (first_day, first), shifted = found[0]
    days = len({d for pair in found for d, _ in pair[:2]}) > 1
    one = f"day {day}, cycle {cycle}," if days else f"cycle {cycle}"
    other = f"cycle {first} of day {first_day}" if days else f"cycle {first}"
    more = f"; so do {len(found) - 1} more" if len(found) > 1 else ""
    how = "digit for digit but for a shift of all touches" if shifted else "digit for digit"
    change = f"delete the rows of {one.rstrip(',')}, and measure them"
    yield Remark(
        "implausible",
        f"{one} repeats {other} {how}{more}: no probe does, so these rows were copied and not measured. What cycles scatter by "
        f"would come out far too small; {change}",
        (),
        "copied_positions",
        "cycle" if not days else "day",
        change,
        sure=True,
    )


def _clock(readings: Readings) -> Iterator[Remark]:
    back = [
        int(readings.touch[i + 1]) for i in np.flatnonzero(np.diff(readings.time) < 0) if readings.day[i + 1] == readings.day[i]
    ]
    if back:
        yield Remark(
            "doubtful",
            f"time runs backward at touch {listed(back)}: rows stand in another order than they were measured, or a clock was set; "
            "drift and backlash are then taken for something else",
            tuple(back),
            "time_order",
            "time_s",
            "put the rows into the order of measurement",
        )


def coarse(readings: Readings) -> float:
    """readings → mm, of which every position is a whole multiple as displays show it; 0 where there are more digits."""
    values = readings.position[readings.ok][:, [i for i, name in enumerate(readings.axes) if name in "XYZ"]]
    digit = last_digit(values) if len(values) >= 10 else 0.0
    return digit if digit >= COARSE else 0.0


def _rounded(readings: Readings) -> Iterator[Remark]:
    if digit := coarse(readings):
        yield Remark(
            "doubtful",
            f"every position is a whole multiple of {digit:g} mm: the readings were rounded, or come from a display; record "
            "all digits that the control has",
            (),
            "rounded_positions",
            "X, Y, Z",
            "record all digits that the control has",
        )


def _alike(readings: Readings) -> Iterator[Remark]:
    used = readings.position[readings.ok]
    if len(used) < 4:
        return
    for i, name in enumerate(readings.axes):
        if name in "XYZ" and np.ptp(used[:, i]) < 1e-9:
            text = f"{name} is the same in all touches: the column {name} of readings.csv holds no measured position"
            yield Remark("implausible", text, (), "constant_column", name, f"see what the control writes for {name}")


def _another_strategy(cell: Cell, readings: Readings) -> Iterator[Remark]:
    facets, position, _ = planned(cell)
    machine = cell.machine
    inside = (readings.touch >= 1) & (readings.touch <= len(facets))
    rows = np.flatnonzero(inside)
    place = readings.touch[rows] - 1
    names = (*machine.rotary, "S")
    turning = [machine.column(name) for name in names]
    made, meant = readings.position[rows][:, turning], position[place][:, turning]

    def apart(one: Array, two: Array) -> Array:
        return np.asarray(np.abs((one - two + np.pi) % (2 * np.pi) - np.pi) > np.radians(TURNED))

    off = apart(made, meant)
    elsewhere = [int(readings.touch[r]) for r in rows[off.any(axis=1)]]
    columns = [name for name, wrong in zip(names, off.T, strict=True) if wrong.any()]
    counted = [n for n, wrong, other in zip(names, off.T, apart(made, -meant).T, strict=True) if wrong.any() and not other.any()]
    backward = f". {counted[0]} has the other sign everywhere: it counts the other way" if counted else ""
    other = [int(readings.touch[r]) for r, p in zip(rows, place, strict=True) if readings.facet[r] != facets[p]]
    for wrong, what, key, more in (
        (other, "name another facet than strategy.yaml has", "facet", ""),
        (elsewhere, f"have other positions of {', '.join(columns)} than strategy.yaml", ", ".join(columns), backward),
    ):
        if wrong:
            change = (
                "see whether the column has the sign of the control"
                if more
                else "take the strategy.yaml that the program was made from"
            )
            yield Remark(
                "doubtful",
                f"{len(wrong)} of {len(readings)} touches {what} ({listed(wrong)}): the readings are of another program, or "
                f"strategy.yaml was changed after it{more}",
                tuple(wrong),
                "another_program",
                key,
                change,
            )


def _nominal(cell: Cell, readings: Readings) -> Iterator[Remark]:
    """No machine trips its probe where the drawing says: then the control reports where it was sent."""
    used = readings.rows(readings.ok)
    if len(used) < 4:
        return
    facets = [cell.artefact.facets[f] for f in used.facet]
    radius = cell.machine.probe.tip_radius
    contact = np.array([np.array(f.point) + radius * np.array(f.normal) for f in facets])
    away = np.linalg.norm(tip(chain(cell.machine), used.position) - contact, axis=1)
    if np.median(away) < EXACT:
        yield Remark(
            "implausible",
            "the touches were made exactly where the drawing says: the control reports where it was sent",
            (),
            "copied_positions",
            ", ".join(cell.machine.linear),
            "record the position that the control latches at the trigger (docs/link.md)",
        )
