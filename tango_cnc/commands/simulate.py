"""`tango simulate`: make readings of the simulated machine, without a controller."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from ..files import blamed_on, joined, read_cell, read_world, readings_text, write_text
from ..files.normals import refuse_inward
from ..files.origin import MEASURED, SIMULATED, set_aside, simulated, write_origin
from ..link.lock import holding
from ..plan import by_stylus, last_moves, plan, reachable
from ..records import Array, Cell, InputError, Readings, Strategy
from ._beside import beside
from ._common import Output, cell_option, json_option, write_json
from ._handed import pasted, printed

PLACE = "Measure 60"  # in the list of commands


def _list_effects(context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    if not wanted or context.resilient_parsing:
        return
    from sim_controller.effects import described

    for cause, keys, text in described():
        click.echo(f"{cause}: {keys}\n    {text}")
    click.echo("Keys in brackets have a default. Units and signs: docs/effects.md")
    context.exit()


def _made(cell: Cell) -> tuple[Strategy, NDArray[np.int64] | None, Array | None]:
    """cell → strategy that is simulated, numbers of its touches where the strategy states `obstructed`, and as `_moved`.

    Raises InputError for what the strategy's own `obstructed` refuses.
    """
    if cell.strategy.obstructed is None:
        return cell.strategy, None, _moved(cell)
    made = plan(cell)
    return reachable(cell), np.array([t.number for t in made.touches]), last_moves(made)


def _left_out(part: Cell, numbers: NDArray[np.int64] | None) -> list[int]:
    """cell of one stylus, numbers of the touches that are simulated (None: all) → those that are not, as the strategy counts."""
    count = sum(len(i.facets) for i in part.strategy.indexations)
    every = range(part.strategy.before + 1, part.strategy.before + count + 1)
    return [] if numbers is None else sorted(set(every) - set(numbers.tolist()))


def _moved(cell: Cell) -> Array | None:
    """cell → (n, k) mm rad, size and sense of each axis' last motion at every touch of its plan; None when it cannot be planned."""
    try:
        made = plan(cell, "warn")  # the simulated machine is no iron: every touch of the strategy is made
    except InputError:
        return None
    whole = len(made.touches) == sum(len(indexation.facets) for indexation in cell.strategy.indexations)
    return last_moves(made) if whole else None


@click.command()
@cell_option
@click.option("--world", "world_file", type=click.Path(path_type=Path), metavar="FILE", help="Default: world.yaml in the cell.")
@click.option(
    "-o",
    "--output",
    type=Output(replaces=SIMULATED),
    metavar="FILE",
    help="Default: simulated.csv in the cell. Never readings.csv: that is what was measured.",
)
@click.option("--cycles", type=click.IntRange(1), default=1, show_default=True, help="Repetitions of the strategy a day.")
@click.option("--days", type=click.IntRange(1), default=1, show_default=True, help="Days, each with all its cycles.")
@click.option("--seed", type=click.IntRange(0), metavar="N", help="Of noise and effects; default: the world's.")
@click.option(
    "--compensation", type=click.Path(path_type=Path), metavar="DIR", help="What 'tango compensate' wrote is in the control."
)
@beside("--compensation")(
    "--no-tcp", is_flag=True, help="With --compensation: probed without tool center point control; kinematics do not act."
)
@click.option("--exact", is_flag=True, help="Write every digit instead of six decimals, for checks without noise.")
@click.option(
    "--list-effects",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_list_effects,
    help="List what world.yaml may hide, and end.",
)
@json_option
def command(
    folder: Path,
    world_file: Path | None,
    output: Path | None,
    cycles: int,
    days: int,
    seed: int | None,
    compensation: Path | None,
    no_tcp: bool,
    exact: bool,
    json_file: str | None,
) -> None:
    """Writes the readings that the true machine of world.yaml would give.

    Backlash goes by the way that the planned program takes. A strategy that cannot be planned is simulated all the same, as if
    the probe went straight from touch to touch.
    """
    from sim_controller.compensation import read
    from sim_controller.simulate import simulate

    if output is not None and output.name == MEASURED:
        raise InputError(
            f"--output: found {output}; {MEASURED} is the name of what was measured; allowed: another name, e.g. "
            f"{output.with_name(SIMULATED)}"
        )
    cell = read_cell(folder)
    refuse_inward(cell)
    tcp = "off" if no_tcp else "on"
    world_file = world_file or folder / "world.yaml"
    world = read_world(world_file)
    done: list[Readings] = []
    planned, left_out = True, list[int]()
    for part in by_stylus(cell):
        control = read(compensation, part.machine, tcp=not no_tcp) if compensation is not None else None
        strategy, numbers, moved = _made(part)
        if moved is None:
            planned = False
            printed("the strategy cannot be planned ('tango plan' says why): the last motions go from touch to touch", err=True)
        own = (world.seed if seed is None else seed) + len(done)
        with blamed_on(world_file):
            readings = simulate(part.machine, cell.artefact, strategy, world, cycles, days, own, moved, control)
        number = readings.touch + part.strategy.before if numbers is None else numbers[readings.touch - 1]
        left_out += _left_out(part, numbers)
        done.append(replace(readings, touch=number))
    readings = done[0]
    for part, more in zip(by_stylus(cell)[1:], done[1:], strict=True):
        readings = joined(readings, more, part.machine.stylus)
    target = output or folder / SIMULATED
    text = readings_text(readings, None if exact else 6)
    with holding(target.parent, "tango simulate") if target.parent.is_dir() else nullcontext():
        same = target.exists() and target.read_bytes() == text.encode()
        kept = None if same or (output is not None and simulated(target)) else set_aside(target)
        if kept is not None:
            click.echo(f"what was in {target} is kept as {kept}", err=True)
        write_text(target, text)
        write_origin(target, folder, "simulated", kept, {"left_out_touches": left_out} if left_out else None)
    if output is None and (folder / MEASURED).exists():
        click.echo(
            f"{folder / MEASURED} was measured and stays what commands read; --readings {pasted(target)} reads the simulated ones",
            err=True,
        )
    counts = {status: readings.status.count(status) for status in ("ok", "miss", "early")}
    result = {
        "format": "tango-simulation/1",
        "readings": str(target),
        "touches": len(readings),
        **counts,
        "cycles": cycles,
        "days": days,
        "seed": world.seed if seed is None else seed,
        "planned": planned,
        "duration_s": round(float(readings.time[-1]), 3),
    }
    if not write_json(json_file, result):
        bad = f", {counts['miss']} missed, {counts['early']} early" if counts["ok"] < len(readings) else ""
        held = "" if compensation is None else f" with {compensation} in the control, tool center point control {tcp}"
        way = f"in {readings.time[-1] / 60:.0f} min, without safety moves (the real program takes longer: 'tango check')"
        printed(f"{len(readings)} touches{bad} {way}{held} → {target}")
