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
@json_option
def command(cells: tuple[Path, ...], where: str | None, late: float, json_file: str | None) -> int:
    """Last night of every machine: who is late, who alarms, who is fine. Exit status 1 when anybody needs somebody.

    Of one history (--history), or of the histories of the cells that are named.
    """
    from ..history import opened

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
