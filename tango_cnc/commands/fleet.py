"""`tango fleet`: how the machines of a fleet are doing, who is late, who alarms."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from ..files import read_cell
from ..files.nightly import history_of, read_nightly
from ..records import InputError
from ..texts import say
from ._common import json_option, on_terminal, table, write_json
from ._shop import headlines, note_simulated

PLACE = "Keep 30"
NIGHTS = 14  # of the sparkline of the tool tip


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
    from ..report.characters import sparkline
    from ..report.texts import code, texts

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
    tips: dict[str, list[float]] = {}
    said: dict[str, str] = {}
    for place in places:
        with opened(place, create=False) as history:
            own = [s for s in history.fleet(now, late) if wanted is None or s.machine in wanted]
            found += own
            for s in own:
                nights = history.nights(s.machine, last=NIGHTS)
                tips[s.machine] = [math.nan if n.volume_um is None else n.volume_um for n in reversed(nights)]
                if json_file is None:
                    note_simulated(history, s.machine, texts())
                said |= {} if not nights else {s.machine: headlines(history, nights[:1])[nights[0].entry]}
    found.sort(key=lambda s: (not (s.alarms_open or s.late), s.machine))
    machines = [{**vars(s), "last": None if s.last is None else vars(s.last)} for s in found]
    if not write_json(json_file, {"format": "tango-fleet/1", "machines": machines}):
        t = texts()
        heads = [t("cli.fleet.machine"), t("cli.fleet.last_night"), t("cli.history.verdict"), t("cli.fleet.alarms")]
        rows = [[*heads, "", t("cli.fleet.tip"), t("cli.history.what")]]
        for s in found:
            last = (t("cli.fleet.never"), "") if s.last is None else (s.last.night, code(s.last.verdict))
            drawn = sparkline(tips[s.machine], NIGHTS)
            tip = "" if s.last is None or s.last.volume_um is None else f"{s.last.volume_um:.1f}"
            late_word = t("cli.nightly.late") if s.late else ""
            row = [s.machine, *last, str(s.alarms_open or ""), late_word, f"{drawn:<{NIGHTS}} {tip:>6}".rstrip()]
            rows.append([*row, said.get(s.machine, "")])
        click.echo(table(rows, "<<<><<<", on_terminal()))
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
        names = ("machine", "again_nights", "again_now", "again_differ", "again_then", "again_alarms")
        rows = [[say(f"cli.fleet.{name}")[:] for name in names]]
        rows += [[d.machine, *(str(n) for n in (d.nights, d.added, d.differ, d.alarms_then, d.alarms_now))] for d in done]
        click.echo(table(rows, "<>>>>>"))
        click.echo(say("cli.fleet.again_kept", target=str(target)))
    return 0
