"""`tango fleet`: how the machines of a fleet are doing, who is late, who alarms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import read_cell
from ..files.nightly import history_of, read_nightly
from ..records import InputError, TangoError
from ..texts import say
from ._common import cells_in, folders_option, json_option, on_terminal, table, write_json
from ._shop import headlines, note_simulated

if TYPE_CHECKING:
    from ..history import Standing

PLACE = "Keep 30"
NIGHTS = 14  # of the sparkline of the tool tip
NOT_IN_ORDER = ("out_of_limits", "doubtful", "not_measured")  # a change is in order once its alarm is answered


@click.command()
@click.argument("cells", nargs=-1, type=click.Path(path_type=Path))
@folders_option
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
    cells: tuple[Path, ...],
    folders: tuple[Path, ...],
    where: str | None,
    late: float,
    target: Path | None,
    dask: str | None,
    json_file: str | None,
) -> int:
    """Last night of every machine: who is late, who alarms, who is fine.

    Of one history (--history), or of the histories of the cells that are named. Exit status 1 when a machine needs somebody: it is
    late, an alarm has no answer, or its last night was out of limits, in doubt or measured nothing.

    --again estimates the whole history of the cells once more, after a change of the model: into new files, one a machine. What
    was cut off goes on when it is called again.
    """
    from ..history import Standing, opened
    from ..report.characters import sparkline
    from ..report.texts import code, texts

    cells = tuple(c for cell in (*cells, *folders) for c in cells_in(cell) or [cell])
    cells = cells or (() if where is not None else tuple(cells_in(Path("."))))
    if target is not None:
        return _again(cells, where, target, dask, json_file)
    if dask is not None:
        raise InputError("--dask: found without --again; allowed: with it")
    if (where is None) == (not cells):
        raise InputError("fleet: found neither or both of cells and --history; allowed: folders of cells, or one history")
    places: list[tuple[str | Path, Path | None]] = []
    wanted: set[str] = set()
    trouble: dict[str, str] = {}
    if where:
        places = [(where if "://" in where else Path(where), None)]
    else:
        places, wanted, trouble = _places(cells)
    now = datetime.now(UTC).isoformat()
    found: list[Any] = []
    tips: dict[str, list[float]] = {}
    said: dict[str, str] = {}
    for place, cell in places:
        if len(cells) > 1 and isinstance(place, Path) and not place.exists():
            continue  # no night yet
        try:
            with opened(place, create=False) as history:
                own = [s for s in history.fleet(now, late) if not wanted or s.machine in wanted]
                found += own
                for s in own:
                    nights = history.nights(s.machine, last=NIGHTS)
                    tips[s.machine] = [math.nan if n.volume_um is None else n.volume_um for n in reversed(nights)]
                    if json_file is None:
                        note_simulated(history, s.machine, texts())
                    said |= {} if not nights else {s.machine: headlines(history, nights[:1])[nights[0].entry]}
        except TangoError as error:  # one machine that cannot be read hides no other one
            if cell is None or len(cells) == 1:
                raise
            trouble[str(cell)] = str(error)
            wanted.discard(read_cell(cell).machine.name)
    found += [Standing(name, None, 0, 0, True) for name in sorted(wanted - {s.machine for s in found})]
    found.sort(key=lambda s: (not wants_somebody(s), s.machine))
    machines = [{**vars(s), "last": None if s.last is None else vars(s.last)} for s in found]
    t = texts()
    if not write_json(json_file, {"format": "tango-fleet/1", "machines": machines, "unreadable": trouble}):
        heads = [t("cli.fleet.machine"), t("cli.fleet.last_night"), t("cli.history.verdict"), t("cli.fleet.alarms")]
        rows = [[*heads, "", t("cli.fleet.tip"), t("cli.history.what")]]
        for s in found:
            last = (t("cli.fleet.never"), "") if s.last is None else (s.last.night, code(s.last.verdict))
            drawn = sparkline(tips.get(s.machine, []), NIGHTS)
            tip = "" if s.last is None or s.last.volume_um is None else f"{s.last.volume_um:.1f}"
            late_word = t("cli.nightly.late") if s.late else ""
            row = [s.machine, *last, str(s.alarms_open or ""), late_word, f"{drawn:<{NIGHTS}} {tip:>6}".rstrip()]
            rows.append([*row, said.get(s.machine, "")])
        click.echo(table(rows, "<<<><<<", on_terminal()))
    for folder, why in trouble.items():
        click.echo(t("cli.fleet.unreadable", cell=folder, why=why), err=True)
    return 1 if trouble or any(wants_somebody(s) for s in found) else 0


def wants_somebody(standing: Standing) -> bool:
    """machine of a fleet → whether somebody has to look: it is late, an alarm has no answer, or its last night is not in order."""
    last = standing.last
    return last is None or standing.late or standing.alarms_open > 0 or last.verdict in NOT_IN_ORDER


def _places(cells: Sequence[Path]) -> tuple[list[tuple[str | Path, Path | None]], set[str], dict[str, str]]:
    """cells → every history with a cell that names it, names of their machines, {cell: why it cannot be read}.

    Raises InputError where none can be read.
    """
    places: dict[str | Path, Path | None] = {}
    wanted: set[str] = set()
    trouble: dict[str, str] = {}
    for cell in dict.fromkeys(cells):
        try:
            wanted.add(read_cell(cell).machine.name)
            places.setdefault(history_of(cell, read_nightly(cell)), cell)
        except TangoError as error:
            if len(cells) == 1:
                raise
            trouble[str(cell)] = str(error)
    return list(places.items()), wanted, trouble


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
