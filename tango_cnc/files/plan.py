"""plan.csv ↔ the positions of a plan, and several files that appear together or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..records import Array, Id, Machine, Plan
from .checked import complaint, read_text, rows_of
from .readings import degrees_of
from .write import mode

PLACES = ("standoff", "contact", "end")
Content = Callable[[], Iterable[str] | bytes]  # lines of a file, or all of it


@dataclass(frozen=True)
class PlannedTouches:
    """plan.csv as arrays: mm and rad, columns of `Machine.names`, one row a touch."""

    touch: tuple[int, ...]
    facet: tuple[Id, ...]
    standoff: Array  # (n, k)
    contact: Array  # (n, k)
    end: Array  # (n, k)


def plan_lines(plan: Plan) -> Iterator[str]:
    """plan → lines of plan.csv, mm and degrees: touch, facet, axis positions of stand-off, nominal contact and search end."""
    machine = plan.machine
    yield ",".join(["touch", "facet", *(f"{place}_{name}" for place in PLACES for name in machine.names)])
    factor = 1 / degrees_of(machine)
    for touch in plan.touches:
        values = np.concatenate([np.array(p) * factor for p in (touch.standoff, touch.contact, touch.end)])
        facet = touch.facet if not set('",\r\n') & set(touch.facet) else '"' + touch.facet.replace('"', '""') + '"'
        yield ",".join([str(touch.number), facet, *(f"{round(v, 6) + 0.0:.6f}" for v in values.tolist())])


def read_plan(file: Path, machine: Machine) -> PlannedTouches:
    """plan.csv of a machine → its touches. Raises InputError naming line and column of what is wrong."""
    rows = rows_of(file, read_text(file).splitlines())
    wanted = ["touch", "facet", *(f"{place}_{name}" for place in PLACES for name in machine.names)]
    if not rows or rows[0] != wanted:
        raise complaint(
            file, 1, "header", ",".join(rows[0]) if rows else "nothing", f"{','.join(wanted)}; write it with tango plan"
        )
    values = np.empty((len(rows) - 1, len(wanted) - 2))
    numbers: list[int] = []
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(wanted):
            raise complaint(file, line, "", f"{len(row)} values", f"{len(wanted)} values; write it again with tango plan")
        try:
            numbers.append(int(row[0]))
            values[line - 2] = [float(text) for text in row[2:]]
        except ValueError as error:
            raise complaint(file, line, "", str(error), "numbers; write it again with tango plan") from None
    if not np.isfinite(values).all():
        raise complaint(file, int(np.argwhere(~np.isfinite(values))[0, 0]) + 2, "", "a number that is not finite", "finite numbers")
    k = len(machine.names)
    parts = [values[:, i * k : (i + 1) * k] * degrees_of(machine) for i in range(3)]
    return PlannedTouches(tuple(numbers), tuple(row[1] for row in rows[1:]), *parts)


def write_together(files: Mapping[Path, Content]) -> None:
    """{file: function → its lines, or its bytes} → files, durable; either all are replaced or, when anything fails before, none."""
    ready: list[tuple[str, Path]] = []
    made: list[Path] = []
    try:
        for file, content in files.items():
            if file.is_dir():  # found out now, as the files before it would have been replaced by then
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(file))
            made += [folder for folder in reversed((file.parent, *file.parent.parents)) if not folder.exists()]
            file.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
            ready.append((name, file))
            with os.fdopen(handle, "wb") as out:
                written = content()
                out.writelines([written] if isinstance(written, bytes) else (f"{line}\n".encode() for line in written))
                out.flush()
                os.fsync(out.fileno())
            os.chmod(name, mode(file))
        while ready:
            os.replace(*ready[0])
            ready.pop(0)
    finally:
        for name, _ in ready:
            os.unlink(name)
        for folder in reversed(made):  # innermost first; one that holds a file stays
            with suppress(OSError):
                folder.rmdir()
