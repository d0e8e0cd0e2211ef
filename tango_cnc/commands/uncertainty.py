"""`tango uncertainty`: compute the uncertainty of the parameters, by GUM and by Monte Carlo."""

from __future__ import annotations

import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from .. import conformity
from ..estimate import Estimate
from ..files import read_cell, read_readings, read_terms
from ..files.origin import current
from ..judgement import Judgement
from ..judging import judged
from ..plausible import ORDER
from ..plausible.bounds import alone, is_backlash
from ..records import Cell, InputError
from ..terms import SCALES, Coefficient
from ..uncertainty import analysis
from ..uncertainty.fleet import cluster
from ..uncertainty.inputs import BudgetLine, read_budget
from ..uncertainty.repetitions import NAMES
from ..uncertainty.scatter import LABEL, reached
from . import _uncertainty as report
from ._beside import beside
from ._common import ahead, cell_option, json_option, write_json
from ._handed import printed
from ._runs import judged_apart
from ._trust import despite_option, members, status, told

PLACE = "Understand 20"  # in the list of commands
CONTRADICTED = 1.5  # times what the budget allows for that a touch may scatter before the result is doubtful
ABSURD = 5.0  # times what is plausible of a parameter at which its limit decides nothing
APART = 5.0  # of the larger standard deviation that the two estimates may differ by
SHOWN = 4  # parameters that a remark names


@click.command()
@cell_option
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option(
    "--budget",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Contributions [default: uncertainty.yaml in the cell, if any].",
)
@click.option(
    "--pool",
    type=click.Choice(["auto", "none", "cycles", "days"]),
    default="auto",
    show_default=True,
    help="Covariance of the readings from repeated cycles; none: from the budget alone.",
)
@click.option("--trials", type=click.IntRange(1000), default=10_000, show_default=True, help="Monte Carlo trials.")
@click.option("--adaptive", is_flag=True, help="As many trials as the results need to be stable to --digits.")
@beside("--adaptive")(
    "--most", type=click.IntRange(20_000), default=1_000_000, show_default=True, help="Trials at which --adaptive gives up."
)
@click.option("--digits", type=click.IntRange(1, 2), default=1, show_default=True, help="Significant digits of the uncertainties.")
@click.option("--probability", type=float, default=0.95, show_default=True, help="Coverage probability.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the Monte Carlo trials.")
@click.option("--full", is_flag=True, help="Solve every trial in full: slow, for plans where the frozen Jacobian is too coarse.")
@click.option(
    "--factor",
    type=click.FloatRange(0, min_open=True),
    metavar="K",
    help="Show expanded uncertainties with this factor, e.g. the thesis' k_q = 2.6.",
)
@click.option(
    "--limits", type=click.Path(path_type=Path), metavar="FILE", help="Decide conformity; exit status 1 unless all conform."
)
@click.option("--subset", "subsets", multiple=True, metavar="LABEL=1-20,22", help="Compare indexation subsets (give two or more).")
@beside("--limits")(
    "--conform",
    type=click.Choice(NAMES),
    help="With repeated runs, whose uncertainty decides on limits: of their mean, of one run, or of where the next run will be "
    "[default: mean].",
)
@click.option("--compare", "runs", multiple=True, metavar="LABEL=FILE", help="Compare readings files (give two or more).")
@click.option("--dask", metavar="tcp://…", help="Spread the trials over this Dask cluster (extra 'fleet').")
@despite_option
@json_option
def command(
    folder: Path,
    file: Path | None,
    terms: str | None,
    degree: int,
    budget: Path | None,
    limits: Path | None,
    subsets: tuple[str, ...],
    runs: tuple[str, ...],
    dask: str | None,
    factor: float | None,
    despite: bool,
    conform: str | None,
    json_file: str | None,
    **chosen: Any,
) -> int:
    """Gives every parameter an interval, which holds as far as budget and model are complete.

    Readings of one run: the budget (docs/uncertainty.md) says what disturbs them. Repeated cycles or days: the readings say it
    themselves, pooled by cycles or by days, and the budget adds what no repetition shows.
    """
    cell = read_cell(folder)
    items = cell.terms if terms is None else read_terms(terms, cell.folder)
    given = budget or (folder / "uncertainty.yaml" if (folder / "uncertainty.yaml").is_file() else None)
    lines = None if given is None else read_budget(given)
    if runs:
        return _compare(cell, runs, items, degree, lines, json_file, despite)
    source = current(folder, file)
    readings = read_readings(source, cell.machine, cell.artefact)
    robust, judgement = judged(cell, readings, items, degree, source=source)
    if chosen["pool"] != "none" and not subsets:
        robust, judgement = judged_apart(cell, readings, items, degree, source, (robust, judgement))
    if judgement.verdict == "implausible" and not despite:
        return _refused(judgement, json_file)
    if limits is not None:
        places = {robust.selection.label(c.name): c for c in robust.model.coefficients if c.slot.axis not in ("t", "w")}
        for name, limit in conformity.read_limits(limits, list(places)).items():
            _sane(limits, name, limit, places[name], cell)
    if subsets:
        choices = dict(_subset(text) for text in subsets)
        comparison, condition = analysis.compare_subsets(
            cell.machine, cell.artefact, readings, items, degree, lines, choices, robust
        )
        data = {
            "format": "tango-comparison/1",
            **members(judgement),
            "comparisons": [report.comparison_json(comparison, condition)],
        }
        if not write_json(json_file, data):
            click.echo(
                "".join(f"{line}\n" for line in told(judgement))
                + report.comparison_text(comparison, report.units(cell.machine, comparison.names), condition)
            )
        return status(judgement, despite)
    with cluster(dask) if dask else nullcontext(map) as mapper:
        options = analysis.Options(**chosen, mapper=mapper)
        found = analysis.analyse(cell.machine, cell.artefact, readings, items, degree, lines, options, robust)
    judgement = _beside(found, robust, judgement, stated=given is None)
    decisions = _decide(found, limits, conform)
    if judgement.verdict != "trustworthy" and not despite:
        decisions = [conformity.undecided(d) for d in decisions]
    if not write_json(json_file, report.as_json(found, decisions, factor) | members(judgement)):
        printed("".join(f"{line}\n" for line in told(judgement)) + report.as_text(found, decisions, factor))
    if given is None and found.pool == "none":
        click.echo(
            "No budget: only the stated repeatability and what artefact.yaml states as known are taken into account. Drift, lobing "
            "and form are not; state them in uncertainty.yaml (docs/uncertainty.md)",
            err=True,
        )
    if judgement.verdict == "trustworthy" and file is None and json_file != "-":
        ahead(folder, "iso230", "report")
    return status(judgement, despite) if limits is None or conformity.all_conform(decisions) else 1


def _decide(found: analysis.Analysis, limits: Path | None, conform: str | None) -> list[conformity.ConformityDecision]:
    if conform not in (None, "one run") and found.four is None:
        raise InputError(f"--conform {conform}: found a single run; allowed: one run, or readings of several cycles or days")
    if limits is None:
        return []
    labels = {found.selection.label(found.study.names[int(i)]): int(i) for i in found.study.machine}
    wanted = conformity.read_limits(limits, list(labels))
    if found.four is None:
        return [
            conformity.decide_from(name, found.samples(labels[name]), float(found.values[labels[name]]), limit)
            for name, limit in wanted.items()
        ]
    uses = conform or "mean"
    spread = found.four.of(uses)
    return [
        replace(
            conformity.decide(name, float(found.four.mean[i]), spread.fair(i, found.probability), limit, dof=float(spread.dof[i])),
            uses=uses,
        )
        for name, limit, i in ((name, limit, labels[name]) for name, limit in wanted.items())
    ]


def _refused(judgement: Judgement, json_file: str | None) -> int:
    if not write_json(json_file, {"format": "tango-uncertainty/1", **members(judgement), "parameters": {}}):
        printed("\n".join([*told(judgement), "No intervals: they would stand around wrong values (--despite computes them)"]))
    return 1


def _beside(found: analysis.Analysis, robust: Estimate, judgement: Judgement, stated: bool) -> Judgement:
    """analysis, the estimate that is shown elsewhere → judgement with what the budget leaves out, and where the two differ."""
    reasons, remarks = list(judgement.reasons), list(judgement.remarks)
    parts = {
        part.label: float(np.sqrt(np.mean(np.sum(part.factor[: found.study.count] ** 2, axis=1)))) for part in found.study.parts
    }
    if LABEL in parts:
        rest, whole = parts[LABEL] * 1e3, np.sqrt(sum(size**2 for size in parts.values())) * 1e3
        what = "the stated repeatability" if stated else "the budget"
        text = (
            f"the residuals show more than {what} allows for: {rest:.2g} µm of a touch were added ('{LABEL}'), "
            f"{whole:.2g} µm in all. 'tango diagnose' looks for the cause"
        )
        far = whole > CONTRADICTED * np.sqrt(max(whole**2 - rest**2, 1e-12))
        (reasons if far else remarks).append(text)
    labels = [found.selection.label(name) for name in found.study.names]
    own = {robust.selection.label(n): (v, s) for n, v, s in zip(robust.model.names, robust.values, robust.std, strict=True)}
    differ = list[tuple[float, str]]()
    for label, value, std in zip(labels, found.values, found.std, strict=True):
        other, spread = own.get(label, (value, std))
        if found.pool == "none" and abs(value - other) > APART * max(std, spread):
            reasons.append(
                f"{label} is not what 'tango estimate' shows: the two weigh the touches differently, and cannot both be right"
            )
        if found.pool == "none" and abs(value - other) > spread > 0:
            differ.append((abs(value - other) / spread, label))
    if differ:
        names = ", ".join(f"{name} by {sigmas:.1f}" for sigmas, name in sorted(differ, reverse=True)[:SHOWN])
        remarks.append(
            "values here are those of touches that all count alike; 'tango estimate' lets them count by how the machine wandered, "
            f"and shows other values: {names} of its standard deviations. Either interval is for its own value; where the "
            "parameter is trusted, that of 'tango estimate' knows more"
        )
    verdict = "doubtful" if len(reasons) > len(judgement.reasons) and judgement.verdict == "trustworthy" else judgement.verdict
    return replace(judgement, verdict=verdict, reasons=tuple(reasons), remarks=tuple(remarks))


def _sane(file: Path, name: str, limit: conformity.Limits, c: Coefficient, cell: Cell) -> None:
    """Raises InputError for a limit that every machine keeps: µm were written for mm, or degrees for rad."""
    machine = cell.machine
    if name in SCALES:
        most, unit = machine.tolerances.scale, "mm/mm; 20 µm/m is 0.00002"
    elif is_backlash(c) or (c.slot.axis and c.slot.stage == "inter"):
        most, kind, _ = alone(c, machine, cell.artefact.tolerances)
        unit = "mm; 10 µm is 0.01" if kind == "mm" else "rad; 10 µrad is 0.00001"
    else:
        return
    for end in (limit.high, limit.low):
        if np.isfinite(end) and abs(end) >= ABSURD * most:
            raise InputError(
                f"{file}: limits.{name}: found {end:g}; allowed: less than {ABSURD * most:.2g} ({unit}). Every machine keeps "
                f"such a limit: {most:.2g} is all that is plausible of {name}"
            )


def _compare(
    cell: Cell,
    runs: tuple[str, ...],
    items: Any,
    degree: int,
    lines: tuple[BudgetLine, ...] | None,
    json_file: str | None,
    despite: bool,
) -> int:
    pairs = [_pair(text, "--compare", "LABEL=FILE") for text in runs]
    readings = {label: read_readings(Path(name), cell.machine, cell.artefact) for label, name in pairs}
    if len(readings) < 2:
        raise InputError("--compare: found one run; allowed: two or more, each with its own label")
    thought = {}
    for label, name in pairs:
        robust, thought[label] = judged(cell, readings[label], items, degree, source=Path(name))
        readings[label] = reached(readings[label], robust)
    worst = max(thought.values(), key=lambda j: (status(j, False), ORDER.index(j.verdict)))
    found = analysis.compare_runs(cell.machine, cell.artefact, readings, items, degree, lines)
    data = {"format": "tango-comparison/1", **members(worst), "comparisons": [report.comparison_json(c) for c in found]}
    if not write_json(json_file, data):
        lines_told = [f"{label}: {line}\n" for label, j in thought.items() if j.verdict != "trustworthy" for line in told(j)]
        printed("".join(lines_told) + "\n\n".join(report.comparison_text(c, report.units(cell.machine, c.names)) for c in found))
    return status(worst, despite)


def _pair(text: str, option: str, form: str) -> tuple[str, str]:
    label, equals, value = text.partition("=")
    if not equals or not label or not value:
        raise InputError(f"{option}: found {text!r}; allowed: {form}")
    return label, value


def _subset(text: str) -> tuple[str, list[int]]:
    label, value = _pair(text, "--subset", "LABEL=numbers of indexations, e.g. A=1-20,22")
    numbers: list[int] = []
    for piece in value.split(","):
        match = re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", piece)
        if match is None:
            raise InputError(f"--subset {label}: found {piece!r}; allowed: numbers and ranges such as 1-20,22")
        numbers += range(int(match[1]), int(match[2] or match[1]) + 1)
    return label, sorted(set(numbers))
