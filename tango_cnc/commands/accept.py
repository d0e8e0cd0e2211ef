"""`tango accept`: one page with limits, decisions, conditions and certificates, to be signed."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click

from .. import __version__
from ..acceptance import made, page, read_order
from ..files import read_cell, read_readings
from ..iso230.signed import signed
from ..records import InputError
from ..report import pdf
from ._common import Output, cell_option, json_option, table, write_json
from ._trust import despite_option, judged, members, said_of_origin, told
from .iso230 import thermal_of
from .report import paper

PLACE = "Keep 55"  # in the list of commands


@click.command()
@cell_option
@click.option("--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv in the cell].")
@click.option("--order", type=click.Path(path_type=Path), help="Limits, people, conditions [default: acceptance.yaml in the cell].")
@click.option("--pdf", "pdf_file", type=Output(), metavar="FILE", help="Write the page as PDF (pip install 'tango-cnc[pdf]').")
@despite_option
@json_option
def command(
    folder: Path, file: Path | None, order: Path | None, pdf_file: Path | None, despite: bool, json_file: str | None
) -> int:
    """Compares ISO figures with limits by the decision rule of ISO 14253-1 and writes one page to be signed.

    Exit status 0 only when every figure conforms and the page answers every clause of ISO/IEC 17025, 7.8.
    """
    if pdf_file is not None and not pdf.available():
        raise InputError("--pdf: typst is not installed; pip install 'tango-cnc[pdf]'")
    cell = read_cell(folder)
    asked = order or folder / "acceptance.yaml"
    wanted = read_order(asked)
    source = file or folder / "readings.csv"
    readings = read_readings(source, cell.machine, cell.artefact)
    result, judgement = judged(cell, readings, cell.terms, source=source)
    if "simulated" in (said := said_of_origin(source)):
        judgement = replace(judgement, verdict="doubtful", reasons=(*judgement.reasons, f"{said}: no machine was measured"))
    now = datetime.now(UTC)
    origin = paper(folder, source, "", "", asked)
    found = made(
        wanted,
        signed(result, wanted.tool_length, thermal_of(folder)),
        judgement,
        cell.machine,
        origin.files,
        __version__,
        now.date().isoformat(),
    )
    if pdf_file is not None:
        pdf_file.write_bytes(pdf.compiled(page.typst(found, pdf.quoted)))
    if not write_json(json_file, page.as_json(found) | members(judgement)):
        lines = [*told(judgement), table([page.HEAD, *(page.cells(r) for r in found.rows)], "<>>>><<")]
        lines += [f"no interval stands: {found.stands}"] if found.stands else []
        lines += [f"{r.name}: {r.why}" for r in found.rows if r.why and not found.stands]
        lines += [f"missing for ISO/IEC 17025: {clause}" for clause in found.missing]
        lines.append("every figure conforms" if found.conforms else "not every figure conforms")
        click.echo("\n".join(lines))
    return int(not found.conforms or bool(found.missing))
