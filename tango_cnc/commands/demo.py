"""`tango demo`: run all steps on the example cell, with a simulated controller."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import click

from ..files import read_world
from ..records import LinkError, World
from ..report.units import shown
from ._common import table
from ._handed import pasted

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
    from . import check, estimate, init, plan, run

    began = time.monotonic()
    folder = out or next(f for i in count(1) if not (f := Path("demo") / str(i)).exists())
    _says(f"init {folder}")
    context.invoke(init.command, folder=folder)
    _says(f"check -C {pasted(folder)}")
    context.invoke(check.command, folder=folder)
    _says(f"plan -C {pasted(folder)}")
    context.invoke(plan.command, folder=folder)
    with _controller(folder, speed) as port:
        _says(f"run -C {pasted(folder)} --port {port} --simulated --yes")
        context.invoke(run.command, folder=folder, port=port, simulated=True, yes=True)
    _says(f"estimate -C {pasted(folder)} --json {pasted(folder / 'estimate.json')}")
    status = context.invoke(estimate.command, folder=folder, json_file=str(folder / "estimate.json"))
    text, worst = _against(json.loads((folder / "estimate.json").read_text(encoding="utf-8")), read_world(folder / "world.yaml"))
    click.echo(text)
    click.echo(
        f"\n{time.monotonic() - began:.0f} s. All files are in {folder}: {', '.join(sorted(f.name for f in folder.iterdir()))}"
    )
    return int(status or worst > LIMIT)


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


def _against(result: Mapping[str, Any], world: World) -> tuple[str, float]:
    """content of estimate.json, truth → a table for people, and the largest deviation in standard deviations."""
    stylus = [(name, value, result["stylus_std"][name], "mm") for name, value in result["stylus"].items()]
    rows = [["parameter", "estimated", "std", "true", "off by", ""]]
    worst = 0.0
    for name, value, std, unit in [*((name, p["value"], p["std"], p["unit"]) for name, p in result["parameters"].items()), *stylus]:
        truth = world.errors.get(name, world.stylus.get(name, 0.0))
        off = (value - truth) / std
        worst = max(worst, abs(off))
        factor, shown_in = shown(unit)
        rows.append([name, f"{value * factor:.2f}", f"{std * factor:.2f}", f"{truth * factor:.2f}", f"{off:+.1f} std", shown_in])
    facets = [(p["offset"] - world.facets.get(facet, 0.0)) / p["std"] for facet, p in result["facets"].items()]
    worst = max([worst, *map(abs, facets)])
    left = result["residual"]
    text = (
        f"{table(rows, '<>>>><')}\n\n"
        f"{len(facets)} facet offsets, each found within {max(map(abs, facets)):.1f} std of the true one\n"
        f"{result['touches']} touches leave |r| max {left['max_um']:.2f}, mean {left['mean_abs_um']:.2f} µm unexplained; "
        f"one touch scatters by {left['std_um']:.2f} µm (simulated: {world.noise * 1e3:.2f})"
    )
    return text, worst
