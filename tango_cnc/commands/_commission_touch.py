"""`tango commission --touch`: points of rotary axes and late readings, by a few touches of the table."""

from __future__ import annotations

import sys
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .. import commission
from ..files import read_readings
from ..link._measure import Wanted, measure
from ..link._secrets import shown
from ..link.lock import holding
from ..plan import plan
from ..records import Array, Cell, InputError, Plan
from ._common import asks_for_a_finger
from ._live import Live
from ._proofs import told
from ._start import ask, unproven_of
from ._written import written
from .check import positioning_feed

if TYPE_CHECKING:
    from postprocessors._base import Post

FOLDER = Path("commissioning", "touch")  # of the cell
AGAIN = "'tango commission --touch' makes them again"
FAILED = 1


def touched(
    cell: Cell,
    post: Post,
    port: str | None,
    wanted: Collection[str],
    yes: bool,
    only_program: bool,
    timeout: float | None,
    json_file: str | None,
) -> None:
    """cell, its post, port, beliefs to try, … → two programs run, and what they show in commissioning.yaml.

    Raises InputError before anything moves, LinkError where a program does not come to its end: then nothing is proven.
    """
    assert cell.controller is not None
    slow = commission.touching(plan(cell))
    plans = {"slow": slow, "quick": commission.quicker(slow)}
    options = asks_for_a_finger(cell.controller.options)
    ready = {name: written(cell, cell.folder / FOLDER / name, post, made, options) for name, made in plans.items()}
    if only_program:
        for programs in ready.values():
            click.echo(f"{programs[0].file}: 'tango commission --touch' with the port of the cell runs it")
        return
    address = port or cell.controller.port
    if address is None:
        raise InputError(
            f"{cell.folder / 'tango.yaml'}: no controller.port; state it there or with --port; 'tango ports' lists them"
        )
    someone = sys.stdin is not None and sys.stdin.isatty()

    def confirm(part: Plan, program: Any) -> None:
        if not yes and someone:
            ask(part, shown(address), positioning_feed(cell), unproven_of(cell, post), str(options.get("gate", "finger")))

    places: dict[str, dict[int, Array]] = {}
    with holding(cell.folder, "tango commission"), Live(None) as live:
        for name, made in plans.items():
            target = cell.folder / FOLDER / name / "readings.csv"
            start = 600.0 if someone else 60.0
            what = Wanted(address, post.link, cell.controller.post, target, timeout=timeout, start_timeout=start, then=AGAIN)
            measure(cell, made, what, lambda part, name=name: ready[name], live, confirm)  # type: ignore[misc]
            read = read_readings(target, cell.machine, cell.artefact)
            good = [row for row in range(len(read)) if read.status[row] == "ok"]
            places[name] = {int(read.touch[row]): read.position[row] for row in good}
    met = places["slow"]
    seen = commission.Seen(
        slow,
        {},
        True,
        True,
        pivots=commission.pivots(slow, met) if met else None,
        late=commission.late(slow, met, plans["quick"], places["quick"]),
    )
    judged = [each for each in commission.judge(seen) if each.experiment.belief in wanted]
    if told(cell, post, judged, ready["slow"][0].mark, "", json_file):
        raise click.exceptions.Exit(FAILED)
