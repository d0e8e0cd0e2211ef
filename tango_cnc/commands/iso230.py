"""`tango iso230`: show the figures of ISO 230-1."""

from __future__ import annotations

from pathlib import Path

import click

from .. import iso230
from ..files import read_cell, read_readings, read_terms
from ._common import cell_option, json_option, table, write_json
from ._trust import despite_option, judged, members, status, told

PLACE = "Understand 50"  # in the list of commands


@click.command()
@cell_option
@click.option("--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv in the cell].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@despite_option
@json_option
def command(folder: Path, file: Path | None, terms: str | None, degree: int, despite: bool, json_file: str | None) -> int:
    """Straightness, positioning, reversal, squareness, error motions of rotary axes: ISO 230-1 figures out of the estimate.

    One axis is moved alone over the range that was touched, against least-squares reference lines.
    """
    cell = read_cell(folder)
    source = file or folder / "readings.csv"
    readings = read_readings(source, cell.machine, cell.artefact)
    result, judgement = judged(cell, readings, cell.terms if terms is None else read_terms(terms), degree, source=source)
    figures = iso230.figures(result)
    data = [
        {
            "kind": f.kind,
            "name": f.name,
            "value": f.value,
            "std": f.std,
            "unit": f.unit,
            "range": None if f.range is None else list(f.range),
            "note": f.note,
        }
        for f in figures
    ]
    if write_json(json_file, {"format": "tango-iso230/1", **members(judgement), "figures": data}):
        return status(judgement, despite)
    rows = [["figure", "", "value", "std", "", "″", "over mm or °", ""]]
    for f in figures:
        over = "" if f.range is None else f"{f.range[0]:.0f} … {f.range[1]:.0f}"
        second = "" if f.arcseconds is None else f"{f.arcseconds:.2f}"
        rows.append([f.kind, f.name, f"{f.value:.2f}", f"{f.std:.2f}", f.unit, second, over, f.note])
    click.echo("\n".join([*told(judgement), table(rows, "<<>><>><")]))
    return status(judgement, despite)
