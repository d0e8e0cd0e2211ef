"""Whose numbers these are: what in numbers of a control, or in a record, speaks of another machine than that of machine.yaml.

A file of another machine has other axes, tables beyond the travel or with other points, pivots elsewhere, numbers that count other
increments, or numbers of another kind of control. Where a machine cannot be both, the numbers are refused. What may be so on one
machine, too, is a doubt, for a person to look at.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ..records import InputError, Machine
from .hidden import ZERO, Present
from .space import Held, Limits
from .targets import Request, load, names, options

MOST_MM, MOST_DEG = 1.0, 1.0  # that a number of a table or a direction takes away on any machine: more is another unit, or another
ON_GRID = 1e-3  # of an increment: what decimal numbers leave
TABLE = re.compile(r"(?P<table>.+) at (?P<axis>[A-Z]) (?P<at>[-+.\de]+) (?P<unit>mm|deg)(?:, moving (?:up|down))?")
LETTER = re.compile(r"(?<![A-Za-z\d_.])([A-CU-Z])(?![A-Za-z\d_.])|\bE[A-CU-Z]0?([A-CU-Z])(?:\d|b)?\b")
NEAR = 0.1  # mm, degrees: a point of a table that far from where it would be put today is the same point
MUCH_MM, MUCH_DEG = 0.2, 0.1  # that a number of a table or a direction takes away on few machines
ALONE = 3.0  # times what all other rows of a table span: a row farther from them than that stands alone
ROWS = 5  # of a table that are compared with each other, at least
CONTROL_OF = "read back from the control of the machine {machine!r}"


def axes_of(machine: Machine) -> tuple[str, ...]:
    """machine → letters of its axes without the spindle."""
    return (*machine.linear, *machine.rotary)


def travel_of(machine: Machine, axis: str) -> tuple[float, float] | None:
    """machine, axis → its travel in mm or degrees; None where nobody knows it. A rotary axis of a turn or more has none."""
    travel = machine.axis(axis).travel
    scale = 1.0 if axis in machine.linear else 180 / math.pi
    if travel is None or (axis in machine.rotary and (travel[1] - travel[0]) * scale > 360 - 1e-6):
        return None
    return travel[0] * scale, travel[1] * scale


def letters(text: str) -> list[str]:
    """place of a control → letters of axes in it."""
    return [one or other for one, other in LETTER.findall(text)]


def beyond(machine: Machine, axis: str, ends: Iterable[float]) -> str:
    """machine, axis, places in mm or degrees → which of them is farthest beyond its travel; '' where none is."""
    travel = travel_of(machine, axis)
    if travel is None:
        return ""
    low, high = travel
    off, at = max((max(low - at, at - high), at) for at in ends)
    unit = "mm" if axis in machine.linear else "deg"
    return f"{axis} {at:g} {unit}, beyond the travel of {axis}, {low:g} to {high:g} {unit}" if off > 1e-3 else ""


def of_record(record: Mapping[str, Any], machine: Machine, then: Machine | None = None) -> str:
    """record of a compensation, machine of a cell, the machine that it was made for → what in it is of another one; '' for nothing.

    Travels may change, but nothing was touched beyond those of today. An axis may be measured anew, but not by millimeters.
    """
    if (own := record.get("machine", machine.name)) != machine.name:
        return f"a compensation for the machine {own!r}, and the cell is of {machine.name!r}"
    here = f"the machine {machine.name!r} of the cell"
    if (kind := record.get("topology", machine.topology)) != machine.topology:
        return f"a compensation for a machine of the topology {kind}, and {here} is {machine.topology}"
    volume = record.get("volume", {})
    if more := [axis for axis in volume if axis not in axes_of(machine)]:
        return f"a compensation with axis {' '.join(more)}, and {here} has {' '.join(axes_of(machine))}"
    for axis, ends in volume.items():
        if out := beyond(machine, axis, ends):
            return f"a compensation with tables up to {out} of {here}"
    for axis in machine.rotary if then is not None else ():
        assert then is not None
        was, now = then.axis(axis), machine.axis(axis)
        turn = math.degrees(math.asin(min(1.0, float(np.linalg.norm(np.cross(was.direction, now.direction))))))
        if turn > MOST_DEG or np.dot(was.direction, now.direction) < 0:
            return f"a compensation whose machine.yaml has the direction of {axis} {turn:.3g} deg from where {here} has it"
        far = float(np.linalg.norm(np.cross(np.subtract(was.point, now.point), now.direction)))
        if far > ZERO:
            return f"a compensation whose machine.yaml has the center of {axis} {far:.3g} mm from where {here} has it"
    return ""


def unknown(place: str, given: Iterable[str], held: Sequence[Held], request: Request, target: str) -> str:
    """place that a target does not store, all places given, what it stores, job, target → why it is of another machine or control;
    '' where nothing says so."""
    machine = request.machine
    strange = [letter for letter in letters(place) if letter not in axes_of(machine)]
    if strange:
        return f"axis {strange[0]}, which the machine {machine.name!r} does not have: its axes are {' '.join(axes_of(machine))}"
    found = TABLE.fullmatch(place)
    if found is not None:
        with suppress(ValueError):
            if out := beyond(machine, found["axis"], [float(found["at"])]):
                return f"a point at {out} of the machine {machine.name!r}"
        own = sorted({h.place for h in held if h.table == found["table"] and h.at is not None}, key=_at)
        theirs = sorted({p for p in given if (m := TABLE.fullmatch(p)) is not None and m["table"] == found["table"]}, key=_at)
        if own:
            return f"{_points(theirs)}, and with this volume and these settings the table has {_points(own)}"
    other = [name for name in names() if name != target and _stores(name, place, request)]
    return f"a place that {' and '.join(other)} stores, and not {target}" if other else ""


def _at(place: str) -> float:
    found = TABLE.fullmatch(place)
    with suppress(ValueError):
        return float(found["at"]) if found is not None else math.nan
    return math.nan


def _points(places: Sequence[str]) -> str:
    at = sorted({_at(p) for p in places})
    found = TABLE.fullmatch(places[0])
    assert found is not None
    count = "1 point" if len(at) == 1 else f"{len(at)} points"
    ends = f"at {found['axis']} {at[0]:g}" if len(at) == 1 else f"from {found['axis']} {at[0]:g} to {at[-1]:g}"
    return f"{count} {ends} {found['unit']}"


def _stores(name: str, place: str, request: Request) -> bool:
    """target, place, job for another target → whether that target stores it, with the settings that it has by itself."""
    module, table = load(name), TABLE.fullmatch(place)
    with suppress(InputError):
        job = Request(request.machine, request.limits, options(module, ()), request.coefficients)
        module.check(job)
        held = module.held(job)
        return any(h.place == place or (table is not None and h.table == table["table"] and h.at is not None) for h in held)
    return False


def size(h: Held, number: float, limits: Limits, machine: Machine) -> tuple[float, str, float]:
    """entry, the control's number, volume, machine → what it takes away at most over it, mm or deg, and what is possible."""
    value, turns = abs(h.value(number)), h.kind == "angle"
    if h.kind == "ratio":
        longest = max(high - low for name, (low, high) in limits.items() if name in machine.linear)
        value *= longest if h.reach is None else h.reach
        turns = h.unit.startswith("rad")
    if turns and h.unit == "1":  # a component of a direction
        value = math.asin(min(value, 1.0))
    return (math.degrees(value), "deg", MOST_DEG) if turns else (value, "mm", MOST_MM)


def matched(there: Present, held: Sequence[Held]) -> Present:
    """what a control shall hold, what its target stores → the same numbers. A point within `NEAR` of a point of today's table
    gets that point's name: each run ends its volume a little elsewhere.
    """
    own: dict[tuple[str, ...], list[tuple[float, str]]] = {}
    for h in held:
        if (found := TABLE.fullmatch(h.place)) is not None:
            own.setdefault(_column(found), []).append((float(found["at"]), h.place))
    known = {h.place for h in held}
    names: dict[str, str] = {}
    for place in there.numbers:
        with suppress(ValueError):
            if place not in known and (found := TABLE.fullmatch(place)) is not None and (rows := own.get(_column(found))):
                far, name = min((abs(at - float(found["at"])), name) for at, name in rows)
                if far <= NEAR and name not in there.numbers and name not in names.values():
                    names[place] = name
    return replace(there, numbers={names.get(place, place): number for place, number in there.numbers.items()})


def _column(found: re.Match[str]) -> tuple[str, ...]:
    """point of a table → all of its name but where it is."""
    return found["table"], found["axis"], found["unit"], found[0][found.end("unit") :]


def looked_at(there: Present, held: Sequence[Held], request: Request) -> tuple[str, ...]:
    """what a control shall hold, what its target stores, job → doubts, for a person.

    Raises InputError for numbers that no control of this machine holds.
    """
    machine, by_place = request.machine, {h.place: h for h in held}
    given = {place: (by_place[place], number) for place, number in there.numbers.items()}
    for place, (h, number) in given.items():
        if h.tcp and h.kind == "length":
            continue
        found, unit, most = size(h, number, request.limits, machine)
        if found > most:
            own = "" if h.unit == "1" else f" {h.unit}"
            does = "turns" if unit == "deg" else "moves"
            moves = f"{number:g}{own}" + ("" if unit == h.unit and h.base == 0 else f", which {does} an axis by {found:.3g} {unit}")
            raise InputError(
                f"--present: {place}: found {moves}; allowed: at most {most:g} {unit}, as no machine needs more. It counts other "
                f"increments, has another unit, or is of another machine: take numbers {CONTROL_OF.format(machine=machine.name)}"
                + (f", in{own}" if own else "")
            )
    _whole(there, given, held, machine)
    centers = [(h, h.value(number)) for h, number in given.values() if h.tcp and h.kind == "length"]
    _same_zero(centers, machine)
    return (*_doubts(there, given, held, centers, machine), *_unlikely(given, request))


def _whole(there: Present, given: Mapping[str, tuple[Held, float]], held: Sequence[Held], machine: Machine) -> None:
    """what a control shall hold → nothing. Raises InputError where a table lacks rows, and where somebody cut the file off."""
    lost = [h for h in held if h.place not in given]
    for h in lost:
        rows = [other for other in held if other.table == h.table and other.at is not None]
        count = sum(other.place in given for other in rows)
        if h.at is not None and count:
            raise InputError(
                f"--present: {h.table}: found {count} of its {len(rows)} rows; absent: {h.place!r}; allowed: every row of a table, "
                f"or none of it. The file has lost rows, or was cut off: take all numbers {CONTROL_OF.format(machine=machine.name)}"
            )
    if there.open_end and lost and given:
        raise InputError(
            f"--present: found {len(given)} of the {len(held)} numbers that this target stores, and a last line without an end; "
            f"allowed: a whole file. It was cut off, perhaps within a number: take all numbers "
            f"{CONTROL_OF.format(machine=machine.name)}, and end the last line"
        )


def _unlikely(given: Mapping[str, tuple[Held, float]], request: Request) -> Iterable[str]:
    """numbers of a control, job → doubts: what takes away more than few machines need; a row far from all others of its table."""
    large = []
    for place, (h, number) in given.items():
        if not (h.tcp and h.kind == "length"):
            found, unit, _ = size(h, number, request.limits, request.machine)
            large.append((found / (MUCH_DEG if unit == "deg" else MUCH_MM), place, found, unit))
    share, place, found, unit = max(large, default=(0.0, "", 0.0, ""))
    if share > 1:
        most = MUCH_DEG if unit == "deg" else MUCH_MM
        yield (
            f"--present: {place} takes away {found:.3g} {unit}; few machines need more than {most:g} {unit}. Compare it with the "
            "control: it may count other increments"
        )
    tables: dict[tuple[str, int], list[tuple[Held, float]]] = {}
    for h, number in given.values():
        if h.at is not None:
            tables.setdefault((h.table, h.sense), []).append((h, number))
    for rows in tables.values():
        if len(rows) >= ROWS and (alone := _alone(rows)):
            yield (
                f"--present: {alone} is more than {ALONE:g} times as far from the other rows of its table as these are from each "
                "other. Compare it with the control: it may be a mistake"
            )


def _alone(rows: Sequence[tuple[Held, float]]) -> str:
    """rows of a table with the control's numbers → the place of one that stands alone; '' where none does."""
    values = np.array([number - h.base for h, number in rows])
    for i, (h, _) in enumerate(rows):
        own, others = float(values[i]), np.delete(values, i)
        low, high = float(others.min()), float(others.max())
        if max(low - own, own - high) > ALONE * max(high - low, 10 * h.increment):
            return h.place
    return ""


def _same_zero(centers: Sequence[tuple[Held, float]], machine: Machine) -> None:
    """centers, each with the mm that it is away from machine.yaml → nothing. Raises InputError where they are not as far apart as
    there: no zero makes that so."""
    for h, off in centers:
        if h.between and abs(off) > ZERO:
            raise InputError(
                f"--present: {h.place}: found {off:+.4g} mm from machine.yaml; allowed: ± {ZERO:g} mm, as it is a distance between "
                f"axes and counts from no zero. {_other(machine)}"
            )
    for along in range(3):
        own = [(off, h) for h, off in centers if h.along == along and not h.between]
        if not own:
            continue
        (low, one), (high, other) = min(own, key=lambda p: p[0]), max(own, key=lambda p: p[0])
        if high - low > ZERO:
            raise InputError(
                f"--present: {one.place}, {other.place}: found {low:+.4g} and {high:+.4g} mm from machine.yaml; allowed: the same "
                f"to {ZERO:g} mm, as another zero moves both alike. {_other(machine)}"
            )


def _other(machine: Machine) -> str:
    return (
        f"Either these are the numbers of another machine, or machine.yaml of {machine.name!r} has the axes elsewhere: take "
        f"numbers {CONTROL_OF.format(machine=machine.name)}, or mend machine.yaml"
    )


def _doubts(
    there: Present,
    given: Mapping[str, tuple[Held, float]],
    held: Sequence[Held],
    centers: Sequence[tuple[Held, float]],
    machine: Machine,
) -> Iterable[str]:
    if not given or there.uncorrected:  # a record says for which machine it is, and from which zero its centers count
        return
    away = [(h, off) for h, off in centers if abs(off) > ZERO]
    if away:
        h, off = max(away, key=lambda pair: abs(pair[1]))
        yield (
            f"--present: {h.place} is {off:+.4g} mm from machine.yaml. It is taken to be counted from another zero. Where the "
            f"control of {machine.name!r} counts from the zero of machine.yaml, these are the numbers of another machine"
        )
    off_grid = [(h, number) for h, number in given.values() if _off_grid(h, number)]
    if off_grid:
        h, number = off_grid[0]
        more = f" and {len(off_grid) - 1} more" if len(off_grid) > 1 else ""
        yield (
            f"--present: {h.place}: found {number!r}{more}, and this control stores steps of {h.increment:g} {h.unit}: a control "
            "of other increments, or rounded by hand"
        )
    if len(given) < len(held):
        missing = next(h.place for h in held if h.place not in given)
        yield (
            f"--present: found {len(given)} of the {len(held)} numbers that this target stores. The others, such as {missing}, are "
            "taken as a control has them that corrects nothing"
        )


def _off_grid(h: Held, number: float) -> bool:
    if h.digits:  # a program reads as many as somebody writes
        return False
    steps = number / h.increment
    return abs(steps - round(steps)) > max(ON_GRID, 1e-12 * abs(steps))
