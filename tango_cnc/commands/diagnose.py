"""`tango diagnose`: find what the model gets wrong, its cause, and what knowing it gains."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from datetime import date
from pathlib import Path

import click
import numpy as np

from ..diagnose import Diagnosis, as_term, diagnose
from ..diagnose.sentences import unexplained
from ..diagnose.table import as_text as table_text
from ..diagnose.table import diagnose_table
from ..diagnose.words import as_json, as_text
from ..diagnose.world import world
from ..files import read_cell, read_readings, read_terms, world_text, write_text
from ..files.checked import suggestion
from ..files.learned import FOLDER, learned, learned_text
from ..files.origin import current
from ..iso230 import columns
from ..judging import judged
from ..records import InputError, Readings
from ..report.pictures import needed
from ..terms import causes
from ._common import Output, ahead, cell_option, json_option, write_json
from ._handed import printed
from ._progress import Progress
from ._trust import despite_option, members, status, told
from .iso230 import thermal_of

PLACE = "Understand 30"  # in the list of commands


@click.command()
@cell_option
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option("--terms", help="The present model, instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--exclude", multiple=True, metavar="CAUSE", help="Do not try this cause; may be given several times.")
@click.option("--html", type=Output(), metavar="FILE", help="Also write a report with pictures.")
@click.option(
    "--world",
    "world_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also write what was found as a new world.yaml, for tango simulate --world FILE.",
)
@click.option("--learn", metavar="NAME", help="Keep the shapes that have no name in learned/NAME.yaml of the cell, as terms.")
@click.option("--table", "table_file", type=click.Path(path_type=Path), metavar="FILE", help="Measured data from elsewhere (CSV).")
@click.option("--response", metavar="NAME[,NAME…]", help="With --table: the measured column, or the columns of a vector.")
@click.option("--model", metavar="NAME[,NAME…]", help="With --table: columns that the present linear model contains.")
@click.option(
    "--covariate",
    "covariates",
    multiple=True,
    metavar="NAME:KIND",
    help="With --table: what the rest may depend on; KIND is time, order, position, angle (degrees) or category.",
)
@click.option("--group", metavar="NAME", help="With --table: rows with the same value are held out together.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the noise that sets the limits.")
@despite_option
@json_option
def command(
    folder: Path,
    file: Path | None,
    terms: str | None,
    exclude: tuple[str, ...],
    html: Path | None,
    world_file: Path | None,
    learn: str | None,
    table_file: Path | None,
    response: str | None,
    model: str | None,
    covariates: tuple[str, ...],
    group: str | None,
    seed: int,
    despite: bool,
    json_file: str | None,
) -> int:
    """Finds what the model leaves over, names the cause, adds it to the model and measures what that gains.

    A cause is named when noise alone would hardly ever look like it, and when touches that were not fitted are predicted better
    with it. If no known cause fits, the report says what the rest depends on, such as time or an axis.
    """
    for option, target in (("--html", html), ("--world", world_file), ("--json", json_file)):
        if target is not None and str(target) != "-":
            _writable(option, Path(target))
    if html is not None:
        needed()
    if table_file is not None:
        of_a_cell = (("--html", html), ("--world", world_file), ("--learn", learn))
        result = diagnose_table(table_file, _table_only(response, of_a_cell), _names(model), covariates, group, seed)
        if not write_json(json_file, result):
            click.echo(table_text(result))
        return 0
    for name, value in (("--response", response), ("--model", model), ("--covariate", covariates), ("--group", group)):
        if value:
            raise InputError(f"{name}: found without --table; allowed: only together with --table FILE")
    for name in exclude:
        if name not in causes():
            raise InputError(f"--exclude: found {name!r}; allowed: {', '.join(causes())}.{suggestion(name, causes())}")
    if world_file is not None and world_file.exists():
        raise InputError(f"--world: found {world_file}, which exists; allowed: a new file, as it may hold the true machine")
    cell = read_cell(folder)
    source = current(folder, file)
    readings = read_readings(source, cell.machine, cell.artefact)
    for text in (*_unused(readings, source), *columns.said(readings.temperatures, thermal_of(folder))):
        printed(text, err=True)
    items = cell.terms if terms is None else read_terms(terms, cell.folder)
    _, judgement = judged(cell, readings, items, source=source)
    if learn is not None:
        _free(folder, learn)
    known = learned(folder)
    with Progress() as progress:
        found = diagnose(cell.machine, cell.artefact, readings, items, exclude, seed, known, progress.stage)
    if learn is not None:
        _learn(folder, learn, found)
    if html is not None:
        from ..report.diagnosis import page

        write_text(html, page(found))
        click.echo(f"report with pictures → {html}", err=True)
    if world_file is not None:
        found_world, missing = world(found)
        write_text(world_file, world_text(found_world))
        click.echo(f"simulated machine with what was found → {world_file}", err=True)
        if missing:
            click.echo(f"not in it, as the simulated machine has nothing like it: {', '.join(missing)}", err=True)
    data = as_json(found)
    data |= {"trust" if key == "verdict" else key: value for key, value in members(judgement).items()}
    if not write_json(json_file, data):
        printed("\n".join([*told(judgement), as_text(found)]))
    if judgement.verdict == "trustworthy" and found.verdict == "adequate" and file is None and json_file != "-":
        ahead(folder, "uncertainty", "report")
    return status(judgement, despite)


def _table_only(response: str | None, of_a_cell: Sequence[tuple[str, object]]) -> list[str]:
    """--response, options of a cell with their values → measured columns. Raises InputError for what a table cannot have."""
    if not response:
        raise InputError("--table: found no --response; allowed: the name of the measured column, e.g. --response r")
    for option, target in of_a_cell:
        if target is not None:
            raise InputError(f"{option}: found together with --table; allowed: with the readings of a cell only")
    return _names(response)


def _unused(readings: Readings, source: Path) -> list[str]:
    """readings, their file → a sentence for each sensor that is left out because it has gaps."""
    gaps = {name: int(np.isnan(values).sum()) for name, values in readings.temperatures.items()}
    return [
        f"{source}: sensor T_{name} is not used: {many} of {len(readings)} touches have no value, and none is made up. "
        "'old' in sensors.yaml says how long a value counts; a sensor has to be there before the first touch"
        for name, many in gaps.items()
        if many
    ]


def _free(folder: Path, name: str) -> None:
    """Raises InputError for a name that is no word, or is taken: what was learned is never overwritten."""
    if not re.fullmatch(r"[\w-]+", name):
        raise InputError(f"--learn: found {name!r}; allowed: a word of letters, digits, _ and -, the name of a file")
    if (file := folder / FOLDER / f"{name}.yaml").exists():
        raise InputError(f"--learn: found {file}, which exists; allowed: another name, or delete the file first")


def _learn(folder: Path, name: str, found: Diagnosis) -> None:
    """Writes every shape without a name as a term; several get numbers."""
    shapes = [r for r in found.unexplained if r.form is not None]
    if not shapes:
        click.echo("--learn: nothing to learn: no shape without a name was found", err=True)
    names = ", ".join(f.cause for f in found.findings)
    beside = f" It was learned beside {names}: without these terms it is only a part of what was there." if names else ""
    for i, r in enumerate(shapes, 1):
        file = folder / FOLDER / (f"{name}.yaml" if i == 1 else f"{name}_{i}.yaml")
        _free(folder, file.stem)
        file.parent.mkdir(exist_ok=True)
        about = {
            "text": f"{unexplained(r)}.{beside}",
            "learned": date.today().isoformat(),
            "amplitude_um": round(r.amplitude * 1e3, 3),
        }
        write_text(file, learned_text({**about, **as_term(r)}))
        click.echo(f"learned → {file}: add {{cause: learned, name: {file.stem}}} to the terms in tango.yaml to use it", err=True)
    if len(shapes) > 1:
        click.echo(f"These {len(shapes)} shapes belong together: each is only a part of what was there.", err=True)
    if shapes and names:
        click.echo(f"They were learned beside {names}: put these into the terms, too. All of them: {found.terms_text}", err=True)


def _writable(option: str, file: Path) -> None:
    """Raises InputError where a file cannot be written: before half a minute of computing, not after it."""
    if file.is_dir():
        raise InputError(f"{option}: found {file}, which is a folder; allowed: a file, e.g. {file / 'found'}")
    if not file.parent.is_dir():
        raise InputError(f"{option}: found {file}, and there is no folder {file.parent}; make it first, or correct the path")
    if not os.access(file.parent, os.W_OK):
        raise InputError(f"{option}: found {file}; the folder {file.parent} cannot be written to; choose another one")


def _names(text: str | None) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()] if text else []
