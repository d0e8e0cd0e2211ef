"""`tango commission --touch`: points of rotary axes and late readings, by a few touches of the table."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .. import commission
from ..link.lock import holding
from ..link.measure import fitting
from ..plan import plan
from ..records import Array, Cell
from ._common import address_of, asks_for_a_finger, controller_of
from ._handed import whole
from ._live import Live
from ._proofs import told
from ._start import misses_of
from ._written import conducted, said_beside, written

if TYPE_CHECKING:
    from postprocessors import Post

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
    address = None if only_program else address_of(cell, port, post.link)
    slow = commission.touching(plan(cell))
    if address is not None:
        fitting(address, post.link, slow)
    plans = {"slow": slow, "quick": commission.quicker(slow)}
    options = asks_for_a_finger(controller_of(cell).options)
    ready = {name: written(cell, cell.folder / FOLDER / name, post, made, options) for name, made in plans.items()}
    if address is None:
        for programs in ready.values():
            said_beside(programs)
            click.echo(whole(f"{programs[0].file}: 'tango commission --touch' with the port of the cell runs it"))
        return
    places: dict[str, dict[int, Array]] = {}
    gate = str(options.get("gate", "finger"))
    with holding(cell.folder, "tango commission"), Live(None) as live:
        for name, made in plans.items():
            target = cell.folder / FOLDER / name / "readings.csv"
            read = conducted(
                cell,
                post,
                made,
                ready[name],
                address,
                target,
                live,
                gate=gate,
                yes=yes,
                then=AGAIN,
                timeout=timeout,
                trying=wanted,
                misses=misses_of(cell, post),
            )
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
