"""`tango accept`: one page with limits, decisions, conditions and certificates, to be signed."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click

from .. import __version__
from ..acceptance import RELATIVE, Order, Source, made, page, read_order
from ..acceptance.beside import by_figures
from ..acceptance.fitting import other_bar
from ..acceptance.further import PARAMETER, known_of, of_part, parameters
from ..estimate import Estimate
from ..files import read_cell, read_readings, read_terms
from ..files.origin import Origin, cell_texts, changes, check_values, look_up, origin_file
from ..iso230 import columns
from ..iso230.signed import Sheet, signed
from ..judging import judged, rows_alone, said_of_origin
from ..nc import features
from ..nc.follow import Setup, zero_of
from ..nc.predict import along, touched_of
from ..records import Cell, InputError
from ..report import pdf
from ._budget import absent, budget_of
from ._common import Output, cell_option, json_option, table, write_json
from ._program import blamed, language_of, opened
from ._progress import said
from ._trust import despite_option, members, told
from .iso230 import thermal_of
from .report import paper

PLACE = "Keep 55"  # in the list of commands


@click.command()
@cell_option
@click.option("--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv in the cell].")
@click.option("--order", type=click.Path(path_type=Path), help="Limits, people, conditions [default: acceptance.yaml in the cell].")
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list; the terms by whose fit the touches are judged.")
@click.option("--pdf", "pdf_file", type=Output(), metavar="FILE", help="Write the page as PDF (pip install 'tango-cnc[pdf]').")
@despite_option
@json_option
def command(
    folder: Path,
    file: Path | None,
    order: Path | None,
    terms: str | None,
    pdf_file: Path | None,
    despite: bool,
    json_file: str | None,
) -> int:
    """Compares ISO figures with limits by the decision rule of ISO 14253-1 and writes one page to be signed.

    Exit status 0 only when every figure conforms and the page answers every clause of ISO/IEC 17025, 7.8.
    """
    if pdf_file is not None and not pdf.available():
        raise InputError("--pdf: typst is not installed; pip install 'tango-cnc[pdf]'")
    cell = read_cell(folder)
    asked = order or folder / "acceptance.yaml"
    day = datetime.now(UTC).date()
    wanted = read_order(asked, day)
    source = file or folder / "readings.csv"
    readings = read_readings(source, cell.machine, cell.artefact)
    beside = () if wanted.part is None else (wanted.part.features, *([wanted.part.program] if wanted.part.program else []))
    origin = paper(folder, source, "", "", asked, folder / "temperature.yaml", *beside)
    items = cell.terms if terms is None else read_terms(terms, folder)
    result, judgement = judged(cell, readings, items, source=source, run=origin.origin)
    budget = budget_of(folder, result)
    differences = any(RELATIVE in name for name in wanted.limits)
    thermal = thermal_of(folder)
    warm = columns.said(readings.temperatures, thermal)
    sheet = signed(result, wanted.tool_length, thermal, budget=budget, differences=differences)
    by_terms = judgement
    judgement = by_figures(judgement, rows_alone(cell, readings, source, origin.origin), sheet)
    found = made(
        wanted,
        _with_further(wanted, sheet, result, cell),
        judgement,
        cell,
        _with_bar(_source(source, origin.simulated, readings.status, _older(folder, source), warm), wanted, source, folder),
        () if budget is None else absent(budget.named),
        origin.files,
        __version__,
        day,
        by_terms,
    )
    if pdf_file is not None:
        boxes: dict[str, None] = {}  # said once, however often the page is tried in smaller letters
        pdf_file.write_bytes(page.one_page(found, pdf.quoted, lambda source: pdf.compiled(source, boxes.setdefault)))
        for text in boxes:
            said(text)
    if not write_json(json_file, page.as_json(found) | members(judgement)):
        lines = [*told(judgement), table([page.HEAD, *(page.cells(r) for r in found.rows)], "<<>>>>><<")]
        lines += [f"note: {text}" for text in warm]
        lines += [f"no interval stands: {found.stands}"] if found.stands else []
        lines += [f"{r.name}: {r.why}" for r in found.rows if r.why and r.why != found.stands]
        lines += [f"missing for ISO/IEC 17025: {c}" + (f": {found.lacks[c]}" if c in found.lacks else "") for c in found.missing]
        lines.append(page.headline(found))
        click.echo("\n".join(lines))
    return int(not found.conforms or bool(found.missing))


def _with_further(order: Order, sheet: Sheet, result: Estimate, cell: Cell) -> Sheet:
    """order, figures, estimate, cell → the figures, and the parameters and features of the part that the order asks for."""
    names = [name.removeprefix(f"{PARAMETER} ") for name in order.limits if name.startswith(f"{PARAMETER} ")]
    more = parameters(result, names, sheet, order.file) if names else ()
    part = order.part
    if part is None:
        return replace(sheet, figures=(*sheet.figures, *more))
    zero = zero_of(",".join(f"{axis}={value}" for axis, value in part.zero.items()), cell.machine, f"{order.file}: part: zero")
    setup = Setup(cell.machine, zero, cell.machine.probe.length if part.tool_length is None else part.tool_length)
    wanted = features.read(part.features)
    known, labels = known_of(sheet, setup, tool=wanted.tool), {}
    if part.program is not None:
        language = language_of(part.program, cell, None)
        with blamed(part.program, language), opened(part.program) as lines:
            labels = along(lines, language, setup, known, touched_of(result.model.touches))[1]
    return replace(sheet, figures=(*sheet.figures, *more, *of_part(wanted, setup, known, labels, sheet)))


def _source(readings: Path, simulated: bool, status: tuple[str, ...], older: str, warm: tuple[str, ...]) -> Source:
    """readings.csv, whether a simulated control made them, status of every touch, a compensation that they do not contain, what
    their temperatures contradict → where they come from.
    """
    origin = look_up(readings)
    known = origin.known
    run = known.get("run", {})
    doubt = _doubt(origin, simulated)
    moments = [found for key in ("start_utc", "end_utc") if (found := _moment(run.get(key))) is not None]
    text = f"{readings.name}, {known.get('origin', 'of unknown origin')}"
    text += "".join(f"; {key.replace('_', ' ')} {run[key]}" for key in ("start_utc", "end_utc", "program_hash") if run.get(key))
    left = sum(s != "ok" for s in status)
    remarks = (f"{left} of {len(status)} touches made no contact where they should and take no part",) if left else ()
    return Source(doubt, (moments[0], moments[-1]) if moments else None, text, (*remarks, *warm), older)


def _with_bar(source: Source, order: Order, readings: Path, folder: Path) -> Source:
    """where the readings come from, order, readings.csv, cell → the same with what a bar of another length says of them."""
    then = look_up(readings).known.get("cell")
    known = changes(then, cell_texts(folder)) if isinstance(then, dict) else {}
    doubt, said_of_it = other_bar(order, [change for keys in known.values() for change in keys])
    return replace(source, doubt=source.doubt or doubt, remarks=(*source.remarks, *filter(None, [said_of_it])))


def _doubt(origin: Origin, simulated: bool) -> str:
    """what is known of the readings, whether a simulated control made them → why nothing is accepted by them, and what to do."""
    if not origin.known:
        beside, name = origin_file(origin.readings).name, origin.readings.name
        return (
            f"origin unknown: there is no {beside} beside {name} that can be read, so nothing says which machine was measured, "
            f"and by which program. Put the {beside} that 'tango run' wrote with these readings there. "
            "If that file is lost, measure with 'tango run' once more and accept those readings"
        )
    if said_of_origin(origin) or simulated:
        return "these are readings of the simulated machine, so nothing says that a machine was measured. Measure with 'tango run'"
    return ""


def _older(folder: Path, readings: Path) -> str:
    """cell, its readings → the compensation in the control that was written after them, and why; '' where there is none."""
    from ..compensate import loop

    run = look_up(readings).known.get("run") or {}
    missed = loop.ignored(folder, check_values(readings.read_text(encoding="utf-8-sig")), run.get("end_utc"))
    if missed is None:
        return ""
    kept, why = missed
    return f"compensation {kept.number} ({kept.record['target']}) is in the control and not in these readings, as {why}"


def _moment(text: object) -> datetime | None:
    try:
        return datetime.fromisoformat(str(text))
    except ValueError:
        return None
