"""`tango demo`: the whole job on the example cell, against a simulated controller."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import click

from ..estimate import Estimate, estimate
from ..files import read_cell, read_readings, read_world
from ..iso230.signed import withheld
from ..records import LinkError, World
from ..report.units import shown
from ._common import table, write_json
from .estimate import as_json

PLACE = "Begin 10"  # in the list of commands

LIMIT = 4.0  # standard deviations; one of twenty honest values is further off once in 800 demos


@click.command()
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="New folder for all files [default: demo/1, demo/2 …].")
@click.option("--speed", type=click.FloatRange(0), default=0, help="Simulated seconds per second; 0: as fast as it goes.")
@click.pass_context
def command(context: click.Context, out: Path | None, speed: float) -> int:
    """Calibrates the example machine, start to end, in about a minute.

    init, check, plan, run over a serial line to a simulated controller, estimate; last the estimated against the true values.
    Exit status 1 when an estimate is further from the truth than its uncertainty allows.
    """
    from . import check, init, plan, run

    began = time.monotonic()
    folder = out or next(f for i in count(1) if not (f := Path("demo") / str(i)).exists())
    _says(f"init {folder}")
    context.invoke(init.command, folder=folder)
    _says(f"check -C {folder}")
    context.invoke(check.command, folder=folder)
    _says(f"plan -C {folder}")
    context.invoke(plan.command, folder=folder)
    with _controller(folder, speed) as port:
        _says(f"run -C {folder} --port {port} --simulated --yes")
        context.invoke(run.command, folder=folder, port=port, simulated=True, yes=True)
    _says(f"estimate -C {folder} --json {folder / 'estimate.json'}")
    cell = read_cell(folder)
    result = estimate(cell.machine, cell.artefact, read_readings(folder / "readings.csv", cell.machine, cell.artefact), cell.terms)
    write_json(str(folder / "estimate.json"), as_json(result, withheld(result)))
    text, worst = _against(result, read_world(folder / "world.yaml"))
    click.echo(text)
    click.echo(
        f"\n{time.monotonic() - began:.0f} s. All files are in {folder}: {', '.join(sorted(f.name for f in folder.iterdir()))}"
    )
    return int(worst > LIMIT)


def _says(command: str) -> None:
    click.secho(f"\n$ tango {command}", bold=True)


@contextmanager
def _controller(folder: Path, speed: float) -> Iterator[str]:
    """cell, speed → port of a simulated controller in a process of its own. Raises LinkError when it does not start."""
    line = ["--tcp", "127.0.0.1:0"] if os.name == "nt" else ["--pty"]
    arguments = ["--cell", str(folder), "--speed", str(speed), "--ledger", str(folder / "controller.jsonl"), *line]
    log = folder / "controller.log"
    with log.open("wb") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "sim_controller", *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors
        )
        try:
            assert process.stdout is not None
            port = process.stdout.readline().decode().strip()
            if not port:
                raise LinkError(f"the simulated controller did not start; {log} says why")
            _shows(arguments)
            yield port
        finally:
            process.terminate()
            process.wait()


def _shows(arguments: list[str]) -> None:
    click.secho(f"\n$ python -m sim_controller {' '.join(arguments)} &", bold=True)


def _against(result: Estimate, world: World) -> tuple[str, float]:
    """estimate, truth → a table for people, and the largest deviation in standard deviations."""
    rows = [["parameter", "estimated", "std", "true", "off by", ""]]
    worst = 0.0
    for name, p in {**result.parameters, **result.setup}.items():
        truth = world.errors.get(name, world.stylus.get(name, 0.0))
        off = (p.value - truth) / p.std
        worst = max(worst, abs(off))
        factor, unit = shown(p.unit)
        rows.append([name, f"{p.value * factor:.2f}", f"{p.std * factor:.2f}", f"{truth * factor:.2f}", f"{off:+.1f} std", unit])
    facets = [(p.value - world.facets.get(facet, 0.0)) / p.std for facet, p in result.facets.items()]
    worst = max([worst, *map(abs, facets)])
    size = abs(result.residuals) * 1e3
    text = (
        f"{table(rows, '<>>>><')}\n\n"
        f"{len(facets)} facet offsets, each found within {max(map(abs, facets)):.1f} std of the true one\n"
        f"{len(size)} touches leave |r| max {size.max():.2f}, mean {size.mean():.2f} µm unexplained; "
        f"one touch scatters by {result.sigma * 1e3:.2f} µm (simulated: {world.noise * 1e3:.2f})"
    )
    return text, worst
