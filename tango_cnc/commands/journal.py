"""`tango journal`: show the journals of the runs, and save what can be saved of a damaged one."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import read_cell, readings_text, write_text
from ..files.readjson import read_json
from ..records import InputError
from ..report.days import ended_at
from ._common import Output, cell_option, json_option, table, write_json
from ._handed import pasted, printed
from ._plan import obstructed_option

if TYPE_CHECKING:
    from ..link.journal import Found

PLACE = "Keep 40"  # in the list of commands
LAST = "readings.journal"
file_argument = click.argument("file", type=click.Path(path_type=Path), required=False)


@click.group()
def command() -> None:
    """Lists and verifies the journals of runs, and saves readings from a damaged one."""


@command.command("list")
@cell_option
@json_option
def list_(folder: Path, json_file: str | None) -> None:
    """Lists every run of the cell: when it began, what it measured, how it ended, whether its journal is whole."""
    files = sorted(folder.glob("*.journal"), key=lambda file: file.stat().st_mtime)
    if not files:
        raise InputError(f"{folder}: no journal here; 'tango run' writes one. Give the folder of the cell with -C")
    rows = [_row(file) for file in files]
    if write_json(json_file, {"format": "tango-journals/1", "journals": rows}):
        return
    zone = datetime.now().astimezone().strftime("%Z")
    shown = [["journal", f"begun ({zone})", "programs", "ok", "miss", "early", "end", "state"]]
    for row in rows:
        moment = ended_at(row["begun_utc"])
        begun = "" if moment is None else moment.astimezone().strftime("%Y-%m-%d %H:%M")
        shown.append([row["file"], begun, *(str(row[n]) for n in ("segments", "ok", "miss", "early")), row["end"], row["state"]])
    click.echo(table(shown, "<<>>>><<"))


@command.command()
@cell_option
@file_argument
@json_option
def verify(folder: Path, file: Path | None, json_file: str | None) -> int:
    """Looks at every line of a journal (default: readings.journal of the cell). Exit status 1: it is damaged or was changed."""
    from ..link.journal import look_at

    file = file or folder / LAST
    found = look_at(file)
    complaints = _complaints(file, found)
    result = {
        "format": "tango-journal-check/1",
        "file": str(file),
        "lines": len(found.lines),
        "unfinished_bytes": found.unfinished,
        "whole": not complaints,
        "complaints": complaints,
    }
    if not write_json(json_file, result):
        half = f"; {found.unfinished} bytes of an unfinished last line, which counts for nothing" if found.unfinished else ""
        said = complaints or [f"{file}: {len(found.lines)} lines, every one as it was written{half}"]
        click.echo("\n".join(said))
        if complaints:
            printed(
                f"'tango journal salvage {pasted(file)} --out FILE.csv' saves the readings of the lines that are whole", err=True
            )
    return 1 if complaints else 0


@command.command()
@cell_option
@file_argument
@obstructed_option
@click.option("--out", type=Output(), metavar="FILE", help="Where the readings go; default: salvaged.csv beside the journal.")
def salvage(folder: Path, file: Path | None, obstructed: str | None, out: Path | None) -> int:
    """Writes the readings of all lines that are whole, before and after the damage. The journal stays as it is.

    Exit status 1: the journal is damaged or was changed; what is wrong is said as 'tango journal verify' says it.
    """
    from ..link.entries import ProgramSent
    from ..link.journal import look_at, salvaged
    from ..link.readings import readings_of
    from ..plan import by_stylus, plan, plan_hash

    file = file or folder / LAST
    target = out or file.with_name("salvaged.csv")
    if target.exists():
        raise InputError(f"--out: found {target}, which is there already; allowed: a new file. Readings are never overwritten")
    found = look_at(file)
    entries, left_out = salvaged(found)
    hashes = {entry.plan_hash for entry in entries if isinstance(entry, ProgramSent)}
    plans = [plan(part, obstructed) for part in by_stylus(read_cell(folder))]
    made = next((one for one in plans if plan_hash(one) in hashes), plans[0])
    ours = plan_hash(made)
    if hashes - {ours}:
        raise InputError(
            f"{file}: found a run of plan {', '.join(sorted(hashes))}; the cell now makes plan {ours}: restore its files"
        )
    readings = readings_of(entries, made)
    if readings is None:
        raise InputError(f"{file}: no reading in it is whole; nothing was written")
    write_text(target, readings_text(readings))
    lines = f", without line {', '.join(map(str, left_out))}" if left_out else ""
    for complaint in (complaints := _complaints(file, found)):
        click.echo(complaint, err=True)
    click.echo(f"{len(readings.touch)} readings → {target}{lines}")
    return 1 if left_out or complaints else 0


def _complaints(file: Path, found: Found) -> list[str]:
    """journal, what is in it → one sentence for each fault."""
    from ..link.entries import Reading
    from ..link.journal import RETURNS, chosen_of

    chosen = chosen_of(found)
    complaints = [f"{file}: {RETURNS}"] if found.returns else []
    complaints += [f"{file}:{line.number}: {line.wrong}" for line in found.lines if line.wrong]
    for line in found.lines:
        if not isinstance(reading := line.entry, Reading):
            continue
        taken = chosen.get(reading.touch)
        if taken is not None and taken is not line and taken.entry != reading:
            complaints.append(
                f"{file}:{line.number}: another reading of touch {reading.touch} than line {taken.number}, which counts"
            )
    if not found.lines:
        complaints.append(f"{file}: no entry in it")
    if (named := _named(file)) is not None and found.lines and named != found.lines[-1].digest:
        complaints.append(
            f"{file}: {file.with_suffix('.json').name} was written with another last line: lines were taken away or added"
        )
    return complaints


def _row(file: Path) -> dict[str, Any]:
    """journal → what a list says of it."""
    from ..link.entries import End, ProgramSent, Reading
    from ..link.journal import look_at

    try:
        found = look_at(file)
    except InputError as error:
        return _counted(file.name, [], None, str(error))
    entries = [line.entry for line in found.lines if line.entry is not None]
    statuses = [entry.status for entry in entries if isinstance(entry, Reading)]
    sent = [entry for entry in entries if isinstance(entry, ProgramSent)]
    last = next((entry for entry in reversed(entries) if isinstance(entry, End | ProgramSent)), None)
    end = "none" if not isinstance(last, End) else "complete" if last.complete else last.why
    return {
        **_counted(file.name, statuses, sent[0].utc if sent else None, _state(found)),
        "segments": len(sent),
        "end": end,
    }


def _counted(name: str, statuses: list[str], begun: str | None, state: str) -> dict[str, Any]:
    counts = {status: statuses.count(status) for status in ("ok", "miss", "early")}
    return {"file": name, "begun_utc": begun, "segments": 0, **counts, "end": "none", "state": state}


def _state(found: Found) -> str:
    if found.wrong is not None:
        return f"damaged or changed at line {found.wrong.number}"
    if found.returns:
        return "lines end in CR LF"
    return "an unfinished last line" if found.unfinished else "whole"


def _named(file: Path) -> str | None:
    """journal → the hash of its last line that readings.json beside it names, None when it names none."""
    try:
        return read_json(file.with_suffix(".json"), "").get("journal_hash")
    except InputError:
        return None
