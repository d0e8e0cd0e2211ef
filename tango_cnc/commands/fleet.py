"""`tango fleet`: how the machines of a fleet are doing, who is late, who alarms."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from ..files import read_cell
from ..files.nightly import history_of, read_nightly
from ..records import InputError
from ._common import json_option, table, write_json

PLACE = "Keep 30"


@click.command()
@click.argument("cells", nargs=-1, type=click.Path(path_type=Path))
@click.option("--history", "where", metavar="FILE|URL", help="One history of many machines, e.g. postgresql://….")
@click.option("--late", type=click.FloatRange(1, 10_000), default=36.0, show_default=True, metavar="HOURS", help="Late after this.")
@click.option(
    "--again",
    "target",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Estimate all nights of the cells again, into this folder.",
)
@click.option("--dask", metavar="ADDRESS", help="With --again: spread the machines over a Dask cluster, tcp://host:port.")
@json_option
def command(
    cells: tuple[Path, ...], where: str | None, late: float, target: Path | None, dask: str | None, json_file: str | None
) -> int:
    """Last night of every machine: who is late, who alarms, who is fine. Exit status 1 when anybody needs somebody.

    Of one history (--history), or of the histories of the cells that are named. --again estimates the whole history of the cells
    once more, after a change of the model: into new files, one a machine. What was cut off goes on when it is called again.
    """
    from ..history import opened

    if target is not None:
        return _again(cells, where, target, dask, json_file)
    if dask is not None:
        raise InputError("--dask: found without --again; allowed: with it")
    if (where is None) == (not cells):
        raise InputError("fleet: found neither or both of cells and --history; allowed: folders of cells, or one history")
    places: list[str | Path] = (
        [where if "://" in where else Path(where)]
        if where
        else list(dict.fromkeys(history_of(cell, read_nightly(cell)) for cell in cells))
    )
    wanted = {read_cell(cell).machine.name for cell in cells} if cells else None
    now = datetime.now(UTC).isoformat()
    found: list[Any] = []
    for place in places:
        with opened(place, create=False) as history:
            found += [s for s in history.fleet(now, late) if wanted is None or s.machine in wanted]
    found.sort(key=lambda s: (not (s.alarms_open or s.late), s.machine))
    machines = [{**vars(s), "last": None if s.last is None else vars(s.last)} for s in found]
    if not write_json(json_file, {"format": "tango-fleet/1", "machines": machines}):
        rows = [["machine", "last night", "verdict", "open alarms", "", "what"]]
        for s in found:
            last = ("never", "", "") if s.last is None else (s.last.night, s.last.verdict, s.last.headline)
            rows.append([s.machine, last[0], last[1], str(s.alarms_open or ""), "LATE" if s.late else "", last[2]])
        click.echo(table(rows, "<<<><<"))
    return 1 if any(s.alarms_open or s.late for s in found) else 0


def _again(cells: tuple[Path, ...], where: str | None, target: Path, dask: str | None, json_file: str | None) -> int:
    from contextlib import ExitStack

    from ..uncertainty.fleet import cluster
    from ._again import again

    if not cells:
        raise InputError("--again: found no cell; allowed: folders of cells, whose models and readings are used")
    with ExitStack() as stack:
        spread: Any = map if dask is None else stack.enter_context(cluster(dask))
        done = again(cells, where, target, spread)
    if not write_json(json_file, {"format": "tango-fleet-again/1", "machines": [vars(d) for d in done]}):
        rows = [["machine", "nights", "estimated now", "verdicts that differ", "alarms then", "alarms now"]]
        rows += [[d.machine, *(str(n) for n in (d.nights, d.added, d.differ, d.alarms_then, d.alarms_now))] for d in done]
        click.echo(table(rows, "<>>>>>"))
        click.echo(
            f"→ {target}; look at them with 'tango history list --history FILE'. The histories of the cells are as they were"
        )
    return 0
