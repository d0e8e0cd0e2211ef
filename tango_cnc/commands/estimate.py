"""`tango estimate`: estimate the error parameters from the readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..estimate import Estimate, estimate, without
from ..features import bar_left_out
from ..files import blamed_on, read_cell, read_readings, read_terms
from ..files.checked import resumed
from ..files.origin import current
from ..identify import never_seen, summary
from ..iso230 import columns
from ..iso230.also import said_also
from ..iso230.signed import withheld_and_also
from ..judgement import Judgement
from ..judging import NoFit, judged
from ..plausible import worst
from ..plausible.data import listed
from ..records import Cell, InputError, Parameter, Readings, TangoError, TermItem
from ..report.units import shown
from ..report.verdict import PREDICTED
from ..segments import offsets
from ..verify import held_out
from . import _scales
from ._common import ahead, cell_option, json_option, table, write_json
from ._handed import pasted, printed
from ._stylus import alike_said
from ._trust import despite_option, members, status, told
from .iso230 import thermal_of

PLACE = "Understand 10"  # in the list of commands
LEFT_OUT = ("single_touches", "copied_positions")  # mistakes that --exclude-outliers mends where there is no fit
WIDER, ENOUGH = 2.0, 20  # times the stated repeatability, of so many degrees of freedom: no chance makes that
GROUPS = 8  # of indexations, each predicted from the others: a fit of S4 takes a tenth of a second


@click.command()
@cell_option
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option("--exclude-outliers", is_flag=True, help="Fit again without the touches that are flagged as outliers.")
@click.option(
    "--segment-offset",
    "frame",
    type=click.Choice(["machine", "table"]),
    help="Of a run that was resumed: estimate how far everything moved in between, as a displacement of machine or table.",
)
@despite_option
@json_option
def command(
    folder: Path,
    file: Path | None,
    terms: str | None,
    degree: int,
    exclude_outliers: bool,
    frame: str | None,
    despite: bool,
    json_file: str | None,
) -> int:
    """Estimates the machine's error parameters, the stylus and the table from readings.

    Only rows with status ok are used. Outliers are listed and kept, unless --exclude-outliers is given, which makes no
    verdict better. Exit status 1 when the result is implausible, half of the plan is missing or no parameter is trusted; the
    mistake that explains it best is named.
    """
    cell = read_cell(folder)
    source = current(folder, file)
    _interrupted(source)
    readings = read_readings(source, cell.machine, cell.artefact)
    items = cell.terms if terms is None else read_terms(terms, cell.folder)
    blamed: tuple[int, ...] = ()
    with blamed_on(folder / "tango.yaml") if terms is None else nullcontext():
        try:
            result, judgement = judged(
                cell, readings, items, source=source, fit=lambda: _estimated(cell, readings, items, degree, frame)
            )
        except NoFit as error:
            blamed = _blamed(error) if exclude_outliers else ()
            if not blamed:
                write_json(json_file, {"format": "tango-estimate/1", **members(error.judgement), "parameters": {}})
                raise
            readings = readings.rows(~np.isin(readings.touch, blamed))
            result, judgement = judged(
                cell, readings, items, source=source, fit=lambda: _estimated(cell, readings, items, degree, frame)
            )
    if blamed:
        judgement = _but_for(judgement, blamed)
    excluded, fewer = result.model.touches.number[result.unused] if exclude_outliers else (), readings
    if len(excluded):
        fewer = without(readings, result.model.touches, result.unused)
        result, after = judged(cell, fewer, items, source=source, fit=lambda: _estimated(cell, fewer, items, degree, frame))
        judgement = _no_better(judgement, after)
    if frame is None and judgement.verdict != "implausible":
        judgement = _predicting(cell, without(fewer, result.model.touches, result.unused), items, degree, judgement)
    gone = sorted({*blamed, *(int(i) for i in excluded)})
    figures, also = withheld_and_also(result)
    data = as_json(result, figures, judgement)
    data["may_also_hold"] = {name: list(motions) for name, motions in also.items()}
    data["relative"] = list(_scales.relative(result))
    data["scale_bar_not_used"] = bar = bar_left_out(cell.artefact, result.model.touches.facet)
    alike = alike_said(result, items, degree)
    data["temperature_notes"] = warm = list(columns.said(readings.temperatures, thermal_of(folder)))
    if exclude_outliers:
        data["excluded"] = gone
    if not write_json(json_file, data):
        scales = [text] if (text := _scales.said(folder, result)) else []
        sound = [] if judgement.verdict != "trustworthy" else [sound_words(judgement, _scales.relative(result))]
        printed(
            "\n".join(
                [*told(judgement), as_text(result, figures), *said_also(also), *scales, *warm, *filter(None, (bar, alike)), *sound]
            )
        )
    if exclude_outliers and gone:
        click.echo(f"{len(gone)} touches excluded: {', '.join(map(str, gone))}", err=True)
    skipped = int((~readings.ok).sum())
    if judgement.verdict == "trustworthy" and file is None and json_file != "-":
        ahead(folder, "verify", "report")
    if skipped:
        click.echo(f"{skipped} of {len(readings)} touches made no proper contact (miss or early) and were not used", err=True)
    return status(judgement, despite)


def sound_words(judgement: Judgement, relative: Sequence[str] = ()) -> str:
    """trustworthy numbers, gains that are relative → what ends the output, without those that are not to be trusted."""
    own = [name for name in relative if name not in judgement.untrusted]
    more = f"; {', '.join(own)}: relative to each other only, touch a scale bar for more" if own else ""
    if judgement.untrusted:
        return f"trustworthy, except {', '.join(judgement.untrusted)}: the notes above say why and what to do{more}"
    return f"trustworthy: nothing was found that speaks against these numbers{more}"


def _no_better(before: Judgement, after: Judgement) -> Judgement:
    """judgement of all touches, and of those without outliers → that of all, with what the others say against the numbers besides.

    Whoever leaves touches out does not know for that why they were wrong, nor what the same has done to the others.
    """
    untrusted = tuple(dict.fromkeys((*before.untrusted, *after.untrusted)))
    verdict = worst([before.verdict, after.verdict])
    reasons = before.reasons if verdict == before.verdict else (*before.reasons, *after.reasons)
    held = [n for n in before.stand if n in after.stand or n not in after.untrusted]
    return replace(
        before, verdict=verdict, reasons=reasons, untrusted=untrusted, stand=tuple(held), nothing=before.nothing or after.nothing
    )


def _but_for(judgement: Judgement, blamed: tuple[int, ...]) -> Judgement:
    """judgement without touches with which there is no fit → at best doubtful, for what was wrong with them may be in others."""
    text = f"there is no fit with touches {listed(blamed)}, which are left out: what was wrong with them may be in others"
    return replace(judgement, verdict=worst([judgement.verdict, "doubtful"]), reasons=(*judgement.reasons, text))


def _blamed(error: NoFit) -> tuple[int, ...]:
    """there is no fit → touch numbers without which there most likely is one; none where that is another mistake."""
    first = next(iter(error.judgement.suspicions), None)
    return () if first is None or not first.fits or first.kind not in LEFT_OUT else first.touches


def _interrupted(source: Path) -> None:
    """readings.csv → nothing. Raises InputError where there is only what an interrupted run has left."""
    left = source.with_name(f"{source.stem}.partial.csv")
    if not source.exists() and left.exists():
        count = max(len(left.read_bytes().splitlines()) - 1, 0)
        raise InputError(
            f"{source}: no such file; the run was interrupted, and {left.name} has its {count} touches: go on with "
            f"'tango run {resumed(source.with_suffix('.journal'))}', or look at what there is with --readings {pasted(left)}"
        )


def _predicting(cell: Cell, readings: Readings, items: Sequence[TermItem], degree: int, judgement: Judgement) -> Judgement:
    """judgement → the worst of it and of how well touches are predicted that take no part in the fit."""
    try:
        number = held_out.indexations(readings, cell.machine)
        groups = held_out.dealt(number, math.ceil(number.max() / GROUPS))
        found = held_out.held_out(cell.machine, cell.artefact, readings, items, groups, degree, whole=False)
    except TangoError:
        text = "no indexation was predicted from the others, which is a test of the model: these touches are too few for it"
        return replace(judgement, remarks=(*judgement.remarks, text))
    if found.skipped:
        some = ", ".join(str(i) for group in found.skipped for i in group)
        text = f"indexations {some} were not predicted from the others: without their touches there is no estimate"
        judgement = replace(judgement, remarks=(*judgement.remarks, text))
    if (ratio := found.beyond) < PREDICTED[0]:
        return judgement
    text = f"held-out indexations are {ratio:.1f} times as far off as predicted: 'tango diagnose' looks for what the terms lack"
    return replace(judgement, verdict="doubtful", reasons=(*judgement.reasons, text))


def _estimated(cell: Cell, readings: Readings, items: Sequence[TermItem], degree: int, frame: str | None) -> Estimate:
    more = () if frame is None else offsets(readings, frame)
    return estimate(cell.machine, cell.artefact, readings, (*items, *more), degree)


def _finite(number: float) -> float | None:
    """number → the same; None where it is infinite: a check of a night has fewer touches than unknowns."""
    return number if math.isfinite(number) else None


def as_json(result: Estimate, figures: Sequence[str], judgement: Judgement | None = None) -> dict[str, Any]:
    """estimate, sentences on the ISO figures withheld, judgement → plain data of the format tango-estimate/1."""
    size = abs(result.residuals) * 1e3

    def value(parameter: Parameter) -> dict[str, Any]:
        return {"value": parameter.value, "unit": parameter.unit, "std": parameter.std}

    setup = result.setup
    data: dict[str, Any] = {
        "format": "tango-estimate/1",
        **({} if judgement is None else members(judgement)),
        "touches": len(result.residuals),
        "terms": list(result.parameters),
        "parameters": {name: value(p) for name, p in result.parameters.items()},
        "stylus": {name: p.value for name, p in setup.items() if not name.endswith("w")},
        "stylus_std": {name: p.std for name, p in setup.items() if not name.endswith("w")},
        "facets": {name: {"offset": p.value, "std": p.std} for name, p in result.facets.items()},
        "balls": {name: {"centre": [float(c) for c in centre]} for name, centre in result.balls.items()},
        "residual": {
            "max_um": float(size.max()),
            "mean_abs_um": float(size.mean()),
            "rms_um": float((size**2).mean() ** 0.5),
            "std_um": result.sigma * 1e3,
            "dof": result.dof,
        },
        "condition_number": _finite(result.condition_number),
        "scaled_condition_number": _finite(result.scaled_condition_number),
        "not_identifiable": [*(c.text for c in result.selection.unseen), *_never(result)],
        "not_identifiable_figures": list(figures),
        "outliers": [int(i) for i in result.outliers],
    }
    if (noise := result.noise) is not None:
        data["noise"] = {"white_um": noise.white * 1e3, "walk_um": noise.walk * 1e3, "seating_um": noise.seating * 1e3}
        data["noise"]["facets_um"] = {name: size * 1e3 for name, size in noise.facets.items()}
    placement = {name: value(p) for name, p in setup.items() if name.endswith("w")}
    return data | ({"placement": placement} if placement else {})


def _never(result: Estimate) -> list[str]:
    return never_seen(result.model.touches.machine, list(result.parameters))


def _unseen(result: Estimate) -> list[str]:
    return [*summary([c.text for c in result.selection.unseen]), *_never(result)]


def as_text(result: Estimate, figures: Sequence[str]) -> str:
    """estimate, sentences on the ISO figures withheld → what a person reads on the terminal."""
    rows = [["parameter", "value", "std", ""]]
    relative = _scales.relative(result)
    for name, p in {**result.parameters, **result.setup}.items():
        factor, unit = shown(p.unit)
        rows.append([name, f"{p.value * factor:.3f}", f"{p.std * factor:.3f}", f"{unit}, relative" if name in relative else unit])
    offsets = [p.value * 1e3 for p in result.facets.values()]
    size, stated = abs(result.residuals) * 1e3, result.model.touches.machine.probe.repeatability
    lines = [
        table(rows, "<>><"),
        "",
        f"unexplained |r|  max {size.max():.2f}  mean {size.mean():.2f}  rms {(size**2).mean() ** 0.5:.2f} µm",
        f"{len(size)} touches, {len(result.values)} unknowns, {result.dof} degrees of freedom, one touch scatters by "
        f"{result.sigma * 1e3:.2f} µm (stated {stated * 1e3:.2f})",
        f"condition number {result.condition_number:.4g}, of scaled columns {result.scaled_condition_number:.4g}",
    ]
    if stated > 0 and (times := result.sigma / stated) > WIDER and result.dof >= ENOUGH:
        lines.append(
            f"the touches scatter {times:.1f} times as much as machine.yaml states for the probe; the standard deviations are of "
            "this scatter. Look at stylus and probe. 'tango capability repeatability' measures what machine.yaml has to state"
        )
    if offsets:
        lines.append(f"{len(offsets)} facet offsets from {min(offsets):.1f} to {max(offsets):.1f} µm (values: --json)")
    lines += [f"cannot be seen: {text}" for text in _unseen(result)]
    if figures:
        one = len(figures) == 1
        count = "1 ISO figure is" if one else f"{len(figures)} ISO figures are"
        lines.append(f"{count} withheld, as these touches do not decide {'it' if one else 'them'}: 'tango iso230' says why")
    if len(result.outliers):
        worst = ", ".join(str(i) for i in result.outliers[:10]) + (" …" if len(result.outliers) > 10 else "")
        weight = "kept; leave them out with --exclude-outliers" if result.rejected is None else "they have no weight"
        lines.append(f"{len(result.outliers)} touches do not fit ({weight}): {worst}")
    return "\n".join(lines)
