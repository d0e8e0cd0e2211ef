"""`tango compare`: compare two readings files of one plan, touch by touch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..compare import Comparison, compare, latch
from ..files import read_cell, read_readings
from ..files.origin import current
from ..judgement import Judgement
from ..judging import NoFit, judged
from ..plausible import ORDER
from ..records import Cell, Readings
from ._common import cell_option, json_option, table, write_json
from ._handed import printed
from ._trust import despite_option, members, status, told

PLACE = "Measure 70"  # in the list of commands


@click.command()
@cell_option
@click.option("--with", "other", required=True, type=click.Path(path_type=Path), metavar="FILE", help="Readings to compare with.")
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option(
    "--period",
    type=click.FloatRange(0, min_open=True),
    metavar="SECONDS",
    help="The control looks at the probe once in this time: also say what that explains.",
)
@despite_option
@json_option
def command(folder: Path, other: Path, file: Path | None, period: float | None, despite: bool, json_file: str | None) -> int:
    """Shows what one control, feed or day does to the readings that another does not.

    Both files are of the same plan, e.g. of the machine and of 'tango simulate'. Differences are those of the readings file minus
    those of --with, along the approach: positive is farther in. Touches without proper contact are left out.
    """
    cell = read_cell(folder)
    file = current(folder, file)
    readings, others = (read_readings(f, cell.machine, cell.artefact) for f in (file, other))
    found = compare(cell.machine, cell.artefact, readings, others)
    judgement = _together({f: _judged(cell, r, f) for r, f in ((readings, file), (others, other))})
    expected = None if period is None else latch(found.feed, period)
    if not write_json(json_file, _as_json(found, period, expected) | members(judgement)):
        printed("\n".join([*told(judgement), _as_text(found, file, other, period, expected)]))
    return status(judgement, despite)


def _judged(cell: Cell, readings: Readings, source: Path) -> Judgement:
    try:
        return judged(cell, readings, cell.terms, source=source)[1]
    except NoFit as error:
        return error.judgement


def _together(both: Mapping[Path, Judgement]) -> Judgement:
    """file → judgement on it → the worse of them, with what is said of either, and of which file."""
    worse = max(both.values(), key=lambda j: ORDER.index(j.verdict))
    reasons = tuple(f"{file}: {line}" for file, j in both.items() for line in j.reasons)
    every = [line for j in both.values() for line in j.remarks]
    remarks = [line if every.count(line) > 1 else f"{file}: {line}" for file, j in both.items() for line in j.remarks]
    return replace(worse, reasons=reasons, remarks=tuple(dict.fromkeys(remarks)))


def _groups(found: Comparison) -> dict[str, Any]:
    main = np.array(found.main)
    return {name: found.along[main == name] for name in sorted(set(found.main))}


def _as_json(found: Comparison, period: float | None, expected: tuple[float, float] | None) -> dict[str, Any]:
    """comparison, period of the probe input, what it predicts → plain data of the format tango-compare/1."""
    data: dict[str, Any] = {
        "format": "tango-compare/1",
        "touches": len(found.along),
        "only_in_first": found.alone[0],
        "only_in_second": found.alone[1],
        "mean_um": found.mean * 1e3,
        "std_um": found.std * 1e3,
        "min_um": float(found.along.min()) * 1e3,
        "max_um": float(found.along.max()) * 1e3,
        "across_max_um": float(found.across.max()) * 1e3,
        "by_direction": {name: {"touches": len(v), "mean_um": float(v.mean()) * 1e3} for name, v in _groups(found).items()},
        "differences_um": {str(n): value * 1e3 for n, value in zip(found.touch.tolist(), found.along.tolist(), strict=True)},
    }
    if expected is not None:
        data["latch"] = {"period_s": period, "mean_um": expected[0] * 1e3, "std_um": expected[1] * 1e3}
    return data


def _as_text(found: Comparison, file: Path, other: Path, period: float | None, expected: tuple[float, float] | None) -> str:
    """comparison → what a person reads on the terminal."""
    count, mean, std = len(found.along), found.mean * 1e3, found.std * 1e3
    error = std / math.sqrt(count)
    lines = [
        f"{count} touches, {file} minus {other}, along the approach (positive: farther in)",
        f"mean {mean:+.2f} ± {error:.2f} µm, standard deviation {std:.2f} µm, "
        f"{found.along.min() * 1e3:+.2f} to {found.along.max() * 1e3:+.2f} µm; across at most {found.across.max() * 1e3:.2f} µm",
    ]
    if any(found.alone):
        lines.append(
            f"not compared: {found.alone[0]} touches that only the first file has, {found.alone[1]} that only the second has"
        )
    if expected is not None and period is not None:
        late, scatter = (1e3 * value for value in expected)
        rest = math.copysign(math.sqrt(abs(std**2 - scatter**2)), std - scatter)
        lines += [
            f"the probe input looked at once in {period * 1e3:g} ms: mean {late:+.2f} µm, standard deviation {scatter:.2f} µm",
            f"beyond that: mean {mean - late:+.2f} ± {error:.2f} µm, standard deviation {max(rest, 0.0):.2f} µm",
        ]
    rows = [["approach", "touches", "mean", ""]]
    rows += [[name, str(len(v)), f"{v.mean() * 1e3:+.2f}", "µm"] for name, v in _groups(found).items()]
    return "\n".join([*lines, "", table(rows, "<>><")])
