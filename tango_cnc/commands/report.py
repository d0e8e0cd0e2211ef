"""`tango report`: one HTML page with pictures, for the people at the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from .. import __version__, iso230
from ..estimate import Estimate, estimate
from ..files import degrees_of, read_cell, read_readings, read_terms, write_text
from ..records import Array, Cell, Readings, TangoError, TermItem
from ..report import page, pictures
from ..report.units import shown
from ..verify import held_out, volume
from ._common import Output, cell_option, json_option, write_json


@click.command()
@cell_option
@click.option("--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv in the cell].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option("-o", "--output", type=Output(), metavar="FILE", help="Default: report.html in the cell.")
@click.option("--no-pictures", is_flag=True, help="Leave the pictures out (also done when matplotlib is not installed).")
@json_option
def command(
    folder: Path, file: Path | None, terms: str | None, degree: int, output: Path | None, no_pictures: bool, json_file: str | None
) -> None:
    """Writes one HTML page that stands alone: summary, parameters, residual pictures, outliers, ISO 230-1 figures."""
    cell = read_cell(folder)
    readings = read_readings(file or folder / "readings.csv", cell.machine, cell.artefact)
    items = cell.terms if terms is None else read_terms(terms)
    drawn = not no_pictures and pictures.available()
    found = findings(cell, readings, items, degree, drawn)
    target = output or folder / "report.html"
    write_text(target, page.render(found, __version__))
    if not no_pictures and not drawn:
        click.echo("no pictures: matplotlib is not installed (pip install 'tango-cnc[report]')", err=True)
    if not write_json(json_file, page.as_json(found) | {"report": str(target)}):
        click.echo(f"{target} ({target.stat().st_size / 1000:.0f} kB): open it in a browser")


def findings(cell: Cell, readings: Readings, terms: tuple[TermItem, ...], degree: int, drawn: bool) -> page.Findings:
    """cell, readings, terms → all that goes on the page. Raises what `estimate` raises."""
    result = estimate(cell.machine, cell.artefact, readings, terms, degree)
    own = np.array(result.model.touches.position)
    own[:, cell.machine.column("S")] = 0.0
    chart = volume.volume(result, np.vstack([volume.grid(cell.machine, result.model.touches), own])) if result.parameters else None
    held, why = None, ""
    try:
        groups = held_out.leave_one_out(held_out.indexations(readings, cell.machine))
        held = held_out.held_out(cell.machine, cell.artefact, readings, terms, groups, degree)
    except TangoError as error:
        why = f"No indexation can be left out: {error}"
    before = page.unexplained_before(result)
    shown_pictures = draw(result, before, chart, held, readings) if drawn else {}
    return page.Findings(cell, readings, result, before, iso230.figures(result), chart, held, why, shown_pictures)


def draw(
    result: Estimate, before: Array, chart: volume.VolumeMap | None, held: held_out.HeldOut | None, readings: Readings
) -> dict[str, tuple[str, str]]:
    """results → pictures by section: caption and data URI."""
    touches, machine = result.model.touches, result.model.touches.machine
    both = {
        title: (touches.point, touches.normal, r, touches.indexation)
        for title, r in (("stylus and facets only", before), ("with the errors of the machine", result.residuals))
    }
    flagged = np.isin(touches.number, result.outliers)
    found: dict[str, tuple[str, Any]] = {
        "touches": (
            "Unexplained distance of every touch; positive: the ball stands off the estimated surface.",
            pictures.touches(touches.number, result.residuals, touches.indexation, flagged, result.sigma),
        ),
        "vectors": (
            "Unexplained distances on the table, along the facet normals; a colour an indexation.",
            pictures.vectors(both),
        ),
    }
    size = page.effects(result)
    strong = list(size)[:24]
    groups: dict[str, list[tuple[str, float, float]]] = {}
    for name in strong:
        p = result.parameters[name]
        factor, unit = shown(p.unit)
        if unit in ("µm", "µrad", "µm/m"):  # coefficients of higher degree mean little one by one: they are drawn as curves
            groups.setdefault(unit, []).append((name, p.value * factor, p.std * factor))
    if groups:
        found["parameters"] = (
            "Parameters that matter most to the touches, with two standard deviations to either side.",
            pictures.parameters(groups),
        )
    if held is not None:
        names = {int(i): held_out.in_words(readings, machine, [int(i)]) for i in np.unique(held.indexation)}
        found["held_out"] = (
            "Each indexation as predicted from all others.",
            pictures.held_out(held.indexation, held.residual, held.expected, names),
        )
    if chart is not None:
        axes = (*machine.linear, *machine.rotary)
        at = (chart.position / degrees_of(machine))[:, [machine.column(n) for n in axes]]
        unit_of = ["mm" if n in machine.linear else "°" for n in axes]
        found["volume"] = (
            "Largest error of the tool tip near each axis position, all other axes anywhere. Shaded: touched range.",
            pictures.volume(axes, at, unit_of, {"error": chart.size}, chart.std, ~chart.extrapolated),
        )
    motions = panels(result)
    if motions:
        found["curves"] = ("Error motions over the touched ranges, with two standard deviations.", pictures.curves(motions))
    return {key: (caption, pictures.embedded(drawn)) for key, (caption, drawn) in found.items()}


def panels(result: Estimate) -> dict[str, Any]:
    """estimate → panels of error motions, displacements and rotations of each axis apart."""
    found: dict[str, Any] = {}
    for axis, (at, curves) in iso230.curves(result).items():
        label = f"{axis}, {'mm' if axis in result.model.touches.machine.linear else '°'}"
        for unit, what in (("µm", "displacements"), ("µrad", "rotations")):
            own = [(f"{c.name} {c.kind}", c.value, c.std) for c in curves if c.unit == unit]
            if own:
                found[f"{axis}: {what}"] = (label, at, own, unit)
    return found
