"""readings.csv ↔ `Readings`; files carry degrees, records radians."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..records import Array, Artefact, Machine, Readings
from .checked import FURTHEST, complaint, read_text, rows_of, suggestion

STATUSES = ("ok", "miss", "early")
NUMBER = "a finite number; delete the row or give it the status 'miss'"

SHEETS = (".xlsx", ".xls", ".ods")
MACHINE = 2e4  # mm: hardly any machine travels further
BEYOND = f"a position of at most {FURTHEST:.0f} mm or degrees; delete the row or give it the status 'miss' and a place"


def of_stylus(file: Path, number: int) -> Path:
    """readings.csv, number of a stylus → the file of its own run beside it: readings.stylus2.csv; the first has readings.csv."""
    return file if number == 1 else file.with_name(f"{file.stem}.stylus{number}{file.suffix}")


def read_readings(file: Path, machine: Machine, artefact: Artefact) -> Readings:
    """readings.csv of a cell → readings, with those of the runs with other styli that stand beside it.

    A run with another stylus begins when the one before it has ended: nothing is known of the time between them.
    Raises InputError naming line and column of what is wrong.
    """
    found = _read(file, machine, artefact)
    for number in range(2, len(machine.styli) + 1):
        beside = of_stylus(file, number)
        if (found.stylus is None or number not in found.stylus) and beside.exists():
            found = joined(found, _read(beside, machine, artefact), number)
    return found


def joined(one: Readings, two: Readings, number: int) -> Readings:
    """readings, those of a later run with the stylus of that number → both, in one table."""
    length = len(one), len(two)

    def both(a: Any, b: Any, without: float) -> Any:
        if a is None and b is None:
            return None
        parts = [np.full(n, without) if part is None else part for part, n in zip((a, b), length, strict=True)]
        return np.concatenate(parts).astype(parts[0].dtype if a is not None else parts[1].dtype)

    stylus = both(one.stylus, np.full(length[1], number), 1)
    sensors = dict.fromkeys((*one.temperatures, *two.temperatures))
    return Readings(
        one.axes,
        np.concatenate([one.touch, two.touch]),
        np.concatenate([one.time, two.time + one.time.max()]),
        (*one.facet, *two.facet),
        np.concatenate([one.position, two.position]),
        np.concatenate([one.direction, two.direction]),
        (*one.status, *two.status),
        np.concatenate([one.cycle, two.cycle]),
        np.concatenate([one.day, two.day]),
        both(one.feed, two.feed, math.nan),
        {s: both(one.temperatures.get(s), two.temperatures.get(s), math.nan) for s in sensors},
        both(one.segment, two.segment, 1),
        stylus,
        tuple(name for name in one.axes if name in (*one.derived, *two.derived)),
    )


def later(one: Readings, two: Readings) -> Readings:
    """readings, those of a later run with the same stylus → both, in one table; its cycles have numbers of their own."""
    both = joined(one, replace(two, cycle=two.cycle + one.cycle.max(initial=0)), 1)
    return both if one.stylus is not None else replace(both, stylus=None)


def _read(file: Path, machine: Machine, artefact: Artefact) -> Readings:
    if file.suffix.lower() in SHEETS:
        raise complaint(
            file, None, "", "found a spreadsheet", "allowed: a text file. Save the sheet as CSV (UTF-8), and name that file"
        )
    return read_readings_text(read_text(file), machine, artefact, file)


def read_readings_text(text: str, machine: Machine, artefact: Artefact, file: Path = Path("readings.csv")) -> Readings:
    """text of a readings.csv, machine, artefact, name for complaints → readings.

    Raises InputError naming line and column of what is wrong.
    """
    lines = text.splitlines()
    if not lines:
        raise complaint(file, None, "", "the file is empty", "a header row and one row a touch")
    rows = _rows(file, lines)
    header = [name.strip() for name in rows[0]]
    _check_header(file, header, machine)
    body = [(i + 2, row) for i, row in enumerate(rows[1:]) if row]
    if not body:
        raise complaint(file, 2, "", "no rows under the header", "one row a touch; has the run recorded anything?")
    for line, row in body:
        if len(row) != len(header):
            commas = "; are these decimal commas? Save numbers with points" if len(row) > len(header) else ""
            allowed = f"allowed: {len(header)} values, as many as the header names{commas}"
            raise complaint(file, line, "", f"found {len(row)} values", allowed)
    cells = {name: [row[i].strip() for _, row in body] for i, name in enumerate(header)}
    at = [line for line, _ in body]

    def numbers(name: str, empty: bool = False) -> Array:
        texts = zip(at, cells[name], strict=True)
        return np.array([finite(file, line, name, text, NUMBER) if text or not empty else math.nan for line, text in texts])

    def whole(name: str) -> np.ndarray:
        values = numbers(name) if name in cells else np.ones(len(body))
        for line, value in zip(at, values, strict=True):
            if value != int(value):
                raise complaint(file, line, name, repr(float(value)), "a whole number")
        return values.astype(np.int64)

    for line, facet in zip(at, cells["facet"], strict=True):
        if facet not in artefact.facets:
            known = list(artefact.facets)
            raise complaint(file, line, "facet", repr(facet), f"a facet of artefact {artefact.name!r}.{suggestion(facet, known)}")
    for line, status in zip(at, cells["status"], strict=True):
        if status not in STATUSES:
            raise complaint(file, line, "status", repr(status), ", ".join(STATUSES))

    stylus = whole("stylus") if "stylus" in cells else None
    if stylus is not None:
        last = max(len(machine.styli), 1)
        for line, number in zip(at, stylus.tolist(), strict=True):
            if not 1 <= number <= last:
                raise complaint(file, line, "stylus", f"{number}", f"1 … {last}: 1 is that of probe, the others stand under styli")
        stylus = stylus if machine.styli else None
    scale = degrees_of(machine)
    missing = np.zeros(len(body))
    position = np.column_stack([numbers(name) if name in cells else missing for name in machine.names]) * scale
    for row, column in np.argwhere(np.abs(position / scale) > FURTHEST):
        name = machine.names[column]
        raise complaint(file, at[row], name, repr(cells[name][row]), BEYOND + _micrometres(position, machine, name))
    given = np.column_stack([numbers(f"d{name}") if f"d{name}" in cells else missing for name in machine.names])
    for column, name in enumerate(machine.names):
        for line, value in zip(at, given[:, column], strict=True):
            if value not in (-1, 0, 1):
                raise complaint(file, line, f"d{name}", repr(float(value)), "-1, 0 or 1")
    return Readings(
        machine.names,
        whole("touch"),
        numbers("time_s"),
        tuple(cells["facet"]),
        position,
        np.where(given != 0, given, last_direction(position)),
        tuple(cells["status"]),
        whole("cycle"),
        whole("day"),
        numbers("feed") if "feed" in cells else None,
        {name[2:]: numbers(name, empty=True) for name in header if name.startswith("T_")},
        whole("segment") if "segment" in cells else None,
        stylus,
        tuple(name for name in machine.names if f"d{name}" not in cells),
    )


def _micrometres(position: Array, machine: Machine, name: str) -> str:
    """(n, k) mm rad as if the file had mm, machine, axis that is too far → the unit that it may have, where the rows show it."""
    linear = np.abs(position[:, [machine.column(axis) for axis in machine.linear]])
    far = int((linear.max(axis=1) > MACHINE).sum())
    if name not in machine.linear or 2 * far < len(linear) or linear.max() > 1e3 * MACHINE:
        return ""
    axes = ", ".join(machine.linear)
    return (
        f". {far} of {len(linear)} rows are more than {MACHINE / 1e3:g} m away: if {axes} are in µm, divide these columns by 1000"
    )


def _rows(file: Path, lines: Sequence[str]) -> list[list[str]]:
    """lines → values of each, as a comma or, where a spreadsheet writes decimal commas, a semicolon or tabulator parts them."""
    header = lines[0]
    other = next((mark for mark in ";\t" if mark in header and "," not in header), None)
    if other is None:
        return rows_of(file, lines)
    rows = rows_of(file, lines, other)
    for line, row in enumerate(rows, 1):
        for text in row:
            if text.count(",") > 1 or ("," in text and "." in text):
                raise complaint(file, line, "", repr(text), "one decimal comma or point, and nothing between thousands")
    return [[text.replace(",", ".") for text in row] for row in rows]


def _check_header(file: Path, header: Sequence[str], machine: Machine) -> None:
    required = ["touch", "time_s", "facet", *machine.linear, *machine.rotary, "status"]
    optional = ["S", *(f"d{name}" for name in machine.names), "cycle", "day", "feed", "segment", "stylus"]
    for name in required:
        if name not in header:
            raise complaint(file, 1, "header", f"no column {name!r}", f"{', '.join(required)} are required")
    for name in header:
        if header.count(name) > 1:
            raise complaint(file, 1, "header", f"the column {name!r} twice", "each column once")
        if name not in (*required, *optional) and not name.startswith("T_"):
            known = [*required, *optional]
            raise complaint(
                file, 1, "header", f"the unknown column {name!r}", f"{', '.join(known)}, T_<sensor>.{suggestion(name, known)}"
            )


def finite(file: Path, line: int, name: str, text: str, allowed: str) -> float:
    """text in a cell of a table → its number. Raises InputError for anything else; `allowed` says what would be right."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise complaint(file, line, name, repr(text), allowed)
    return value


def degrees_of(machine: Machine) -> Array:
    """machine → (k,) factor from file units (mm, deg) to mm, rad for each column of a position array."""
    return np.array([1.0 if name in machine.linear else math.pi / 180 for name in machine.names])


def last_direction(position: Array) -> Array:
    """(n, k) → (n, k) direction −1 0 1 of the last motion of each axis, from the sequence of positions alone."""
    change = np.sign(np.diff(position, axis=0, prepend=position[:1]))
    row = np.arange(len(position))[:, None]
    moved = np.maximum.accumulate(np.where(change != 0, row, 0), axis=0)
    return np.take_along_axis(change, moved, axis=0)


def readings_text(readings: Readings, decimals: int | None = 6) -> str:
    """readings → text of readings.csv, mm and degrees; `decimals` None writes every digit.

    A direction that no column gave gets none: a copy says no more than what was measured.
    """
    spelt = [a for a in readings.axes if a in "XYZ"], [a for a in readings.axes if a not in "XYZ"]
    axes = [*spelt[0], *spelt[1]]
    column = {name: readings.axes.index(name) for name in axes}
    signs = [name for name in axes if name not in readings.derived]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    extra = (["feed"] if readings.feed is not None else []) + [f"T_{name}" for name in readings.temperatures]
    extra += ["segment"] if readings.segment is not None else []
    extra += ["stylus"] if readings.stylus is not None else []
    writer.writerow(["touch", "time_s", "facet", *axes, *(f"d{name}" for name in signs), "status", "cycle", "day", *extra])

    def shown(values: Array) -> list[str]:
        plain = values.tolist()
        return [repr(value) for value in plain] if decimals is None else [f"{value + 0.0:.{decimals}f}" for value in plain]

    columns: list[list[Any]] = [readings.touch.tolist(), [f"{t:.3f}" for t in readings.time.tolist()], list(readings.facet)]
    for a in axes:
        at = readings.position[:, column[a]]
        columns.append(shown(at if a in "XYZ" else np.array([math.degrees(value) for value in at.tolist()])))
    columns += [[f"{sign:.0f}" for sign in readings.direction[:, column[a]].tolist()] for a in signs]
    columns += [list(readings.status), list(readings.cycle), list(readings.day)]
    columns += [] if readings.feed is None else [[f"{feed:g}" for feed in readings.feed.tolist()]]
    for temperature in readings.temperatures.values():
        columns.append(["" if math.isnan(value) else f"{value:.3f}" for value in temperature.tolist()])
    columns += [list(number) for number in (readings.segment, readings.stylus) if number is not None]
    writer.writerows(zip(*columns, strict=True))
    return out.getvalue()
