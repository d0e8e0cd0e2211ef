"""A program that a cell needs besides its measurement: written into a folder of its own, and run into readings of its own."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import blamed_on, read_readings
from ..records import Cell, Plan, Readings
from ._common import attended, controller_of, start_patience
from ._links import say_doubt
from ._start import ask, counts, obeys, refuse_fatal, tries_of, unattended, unproven_of

if TYPE_CHECKING:
    from postprocessors import Post

    from ..program import Program
    from ._live import Live


def written(cell: Cell, target: Path, post: Post, made: Plan, options: Mapping[str, Any]) -> list[Program]:
    """cell, folder, its post, plan, options → the programs of the plan, read back, and what travels with them, in that folder.

    Raises InputError for what the post or the read-back refuses; then nothing is written.
    """
    import postprocessors as posts

    from ..files.plan import Content, plan_lines, write_together
    from ..program import programs

    with blamed_on(cell.folder / "tango.yaml"):
        found = programs(post, made, options)
    files: dict[Path, Content] = {target / p.name: p.lines for p in found}
    files |= {target / name: partial(iter, lines) for name, lines in posts.companions(post, made, options).items()}
    write_together({**files, target / "plan.csv": lambda: plan_lines(made)})
    return [replace(p, file=str(target / p.name)) for p in found]


def said_beside(programs: Sequence[Program]) -> None:
    """programs that are written and not sent → says which files go to the control with them, where there are any."""
    from ..program import beside_of

    if programs[0].beside:
        click.echo(beside_of(programs[0]), err=True)


def conducted(
    cell: Cell,
    post: Post,
    made: Plan,
    programs: Sequence[Program],
    address: str,
    target: Path,
    live: Live,
    *,
    gate: str,
    yes: bool,
    then: str,
    misses: int = 3,
    timeout: float | None = None,
    notice: str = "",
    trying: Collection[str] = (),
) -> Readings:
    """cell, its post, plan, its programs, port, file of the readings, who watches → the readings, after they are run.

    `gate`: what proves the probe alive in them. `yes`: nobody is asked before the machine moves; who is asked hears `notice`
    first. `then`: what to do when it breaks off. `misses`, `timeout`: as in `Wanted`. `trying`: beliefs that it tries. Raises
    InputError before anything moves, LinkError where a program does not come to its end.
    """
    from ..link.measure import Wanted, measure
    from ..link.secrets import shown
    from .check import positioning_feed

    someone = attended()
    say_doubt(post, address)
    if yes or not someone:
        unattended(cell, post)
    else:
        refuse_fatal(cell, post, trying)

    def confirm(part: Plan, program: Program) -> None:
        if not yes and someone:
            if notice:
                click.echo(notice, err=True)
            doubts, tries = unproven_of(cell, post, trying), tries_of(cell, post, trying)
            ask(part, shown(address), positioning_feed(cell), doubts, gate, obeys(cell, post), tries)

    wanted = Wanted(
        address,
        post.link,
        controller_of(cell).post,
        target,
        timeout=timeout,
        start_timeout=start_patience(someone),
        misses=misses,
        counted=counts(post),
        then=then,
        feed=positioning_feed(cell),
    )
    measure(cell, made, wanted, lambda part: programs, live, confirm)
    return read_readings(target, cell.machine, cell.artefact)
