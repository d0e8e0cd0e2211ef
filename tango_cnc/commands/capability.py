"""`tango capability`: measure how well the probe of this machine repeats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from .. import capability
from ..capability import CapabilitySettings, Kind
from ..files import artefact_text, machine_text, read_cell, read_readings, strategy_text, write_text
from ..files.checked import load
from ..files.origin import current
from ..files.write import dump
from ..iso230 import columns
from ..records import Cell, InputError
from ..touches import Touches, from_readings
from ._beside import beside, stated
from ._common import Output, cell_option, json_option, table, write_json
from ._handed import pasted
from .iso230 import thermal_of

PLACE = "Understand 60"  # in the list of commands
UNITS = {"duration": " (s)", "tau": " (s)", "temperature": " (K)", "per_kelvin": " (µm/K)", "per_kelvin_std": " (µm/K)"}

OF = {"window": ("repeatability", "grid"), "block": ("wetness",), "last": ("wetness",), "after": ("probe",)}  # kinds by option


@click.command()
@click.argument("kind", type=click.Choice(capability.KINDS))
@cell_option
@click.option("--cell", "target", type=click.Path(path_type=Path), metavar="DIR", help="Write the cell that measures it, and stop.")
@beside("--cell")("--facets", default="", metavar="3,5", help="With --cell: these facets [default: one for every direction].")
@beside("--cell")("--repetitions", type=click.IntRange(2), help="With --cell: touches or cycles [default: those of the thesis].")
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option("--window", type=click.IntRange(2), help="Touches pooled together [default: 25, on a grid 5].")
@click.option("--block", type=click.IntRange(2), default=100, show_default=True, help="Wetness: touches between dry and wet.")
@click.option(
    "--last", type=click.IntRange(2), help="Wetness: only so many of the last touches, when the machine is warm [default: all]."
)
@click.option(
    "--after", type=click.Path(path_type=Path), metavar="FILE", help="Probe: readings of the same test after a calibration."
)
@click.option(
    "--budget", type=Output(replaces="uncertainty.yaml"), metavar="FILE", help="Put the numbers into this uncertainty.yaml."
)
@click.option("--world", type=Output(replaces="world.yaml"), metavar="FILE", help="Put the numbers into this world.yaml.")
@json_option
def command(
    kind: Kind,
    folder: Path,
    target: Path | None,
    facets: str,
    repetitions: int | None,
    file: Path | None,
    window: int | None,
    block: int,
    last: int | None,
    after: Path | None,
    budget: Path | None,
    world: Path | None,
    json_file: str | None,
) -> None:
    """Measures KIND: repeatability, wetness, grid (surface), drift, lobing, probe (ISO 230-10) or etve (ISO 230-3).

    First --cell writes a cell whose program measures it; plan, run or simulate it as any other. Then the analysis of its
    readings: with -C that cell.
    """
    for option, kinds in OF.items():
        if kind not in kinds and stated(option):
            raise InputError(f"--{option}: found capability {kind}; allowed: capability {' or '.join(kinds)}")
    cell = read_cell(folder)
    if target is not None:
        _write_cell(cell, kind, CapabilitySettings(tuple(f for f in facets.split(",") if f), repetitions), target)
        return
    readings = read_readings(current(folder, file), cell.machine, cell.artefact)
    doubts = columns.doubted(readings.temperatures, thermal_of(folder)) if kind == "etve" else ()
    left = {n: t for n, t in readings.temperatures.items() if n not in {c.sensor for c in doubts}}
    touches = from_readings(cell.machine, cell.artefact, replace(readings, temperatures=left))
    results = _analyse(kind, touches, window, block, last)
    verdicts = {}
    if after is not None:
        later = read_readings(after, cell.machine, cell.artefact)
        results["after"] = capability.probing(from_readings(cell.machine, cell.artefact, later))
        verdicts = capability.changed(results["ball"], results["after"])
    lines = capability.budget_lines(kind, results)
    noise, effects = capability.world_effects(kind, results)
    data = {
        "format": "tango-capability/1",
        "kind": kind,
        "touches": len(touches),
        "results": {key: _plain(value) for key, value in results.items()},
        "changed": verdicts,
        "sensors_doubted": [c.text for c in doubts],
        "budget": lines,
        "world": ({} if noise is None else {"noise": noise}) | {"effects": effects},
    }
    if budget is not None:
        _merge(budget, "contributions", "source", lines)
    if world is not None:
        _merge(world, "effects", "cause", effects, {} if noise is None else {"noise": noise})
    if not write_json(json_file, data):
        click.echo(_text(kind, results))
        for c in doubts:
            click.echo(f"{c.text}: it takes no part. Write the column in °C")
        for name, word in verdicts.items():
            click.echo(f"{name.replace('_', ' ')} after the calibration: {word}")
        said = "; ".join(", ".join(f"{k} {v:.5g}" if isinstance(v, float) else f"{v}" for k, v in line.items()) for line in lines)
        click.echo(f"\nFor the budget (mm, deg): {said or 'nothing that stands out'}")


def _write_cell(cell: Cell, kind: Kind, settings: CapabilitySettings, target: Path) -> None:
    if target.exists() and any(target.iterdir()):
        raise InputError(f"{target}: already there and not empty; give a new folder, nothing is ever overwritten")
    artefact, strategy = capability.program(kind, cell.machine, cell.artefact, cell.strategy, settings)
    controller = {} if cell.controller is None else {"controller": _controller(cell)}
    root = {"tango": 1, "machine": "machine.yaml", "artefact": "artefact.yaml", "strategy": "strategy.yaml", "terms": ["S1"]}
    write_text(target / "machine.yaml", machine_text(cell.machine))
    write_text(target / "artefact.yaml", artefact_text(artefact))
    write_text(target / "strategy.yaml", strategy_text(strategy))
    if (cell.folder / "world.yaml").is_file():
        write_text(target / "world.yaml", (cell.folder / "world.yaml").read_text(encoding="utf-8"))
    write_text(target / "tango.yaml", dump(root | controller))
    touches = sum(len(i.facets) for i in strategy.indexations)
    click.echo(
        f"{target} measures {kind} with {touches} touches. Next: tango plan -C {pasted(target)}, tango run -C {pasted(target)},"
    )
    click.echo(f"then tango capability {kind} -C {pasted(target)}")


def _controller(cell: Cell) -> dict[str, Any]:
    assert cell.controller is not None
    port = {} if cell.controller.port is None else {"port": cell.controller.port}
    return {"post": cell.controller.post, **port, **cell.controller.options}


def _analyse(kind: Kind, touches: Touches, window: int | None, block: int, last: int | None) -> dict[str, Any]:
    """→ results by direction (by `ball` for lobing)."""
    if kind == "lobing":
        return {"ball": capability.lobing(touches)}
    if kind == "probe":
        return {"ball": capability.probing(touches)}
    height = capability.heights(touches)
    along = np.array(capability.directions(touches))
    order = [name for name in ("X", "Y", "Z", "2D", "3D") if name in along]
    results: dict[str, Any] = {}
    for name in order:
        rows = np.flatnonzero((along == name) & (touches.ball_index < 0))
        values = height[rows]
        if kind == "repeatability":
            results[name] = capability.repeatability(values, window or 25)
        elif kind == "wetness":
            results[name] = capability.wetness(values, block, touches.time[rows], last)
        elif kind == "etve":
            warm = [t[rows] for t in touches.temperatures.values()]
            results[name] = capability.environment(touches.time[rows], values, warm, touches.machine.probe.repeatability)
        elif kind == "drift":
            results[name] = capability.drift(touches.time[rows], values)
        else:
            results[name] = capability.grid(_cycles(touches, rows, values), window or 5)
    return results


def _cycles(touches: Touches, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """→ (m, n): the same n points in each of m cycles; raises InputError when a touch of the grid is missing."""
    names = [touches.facet[i] for i in rows]
    points = list(dict.fromkeys(names))
    cycles, left = divmod(len(names), len(points))
    if left or names != points * cycles:
        raise InputError(
            f"capability grid: found {len(names)} good touches on {len(points)} points, not the same points in every cycle; "
            "allowed: whole cycles. Delete the rows of the incomplete cycle"
        )
    result: np.ndarray = values.reshape(cycles, len(points))
    return result


def _merge(file: Path, key: str, name: str, lines: list[dict[str, Any]], more: Mapping[str, Any] | None = None) -> None:
    """Lines of the same name are replaced, everything else in the file stays (without its comments)."""
    fields = dict(load(file).items()) if file.is_file() else {}
    data: dict[str, Any] = {word: node.plain() for word, node in fields.items()}
    new = [line[name] for line in lines]
    before = [{word: node.plain() for word, node in line.items()} for line in fields[key].list()] if key in fields else []
    kept = [line for line in before if line.get(name) not in new]
    write_text(file, dump({**data, **(more or {}), key: [*kept, *lines]}))


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, (np.ndarray, tuple, list)):
        return [_plain(v) for v in value]
    return float(value) if isinstance(value, np.floating) else value


def _text(kind: Kind, results: Mapping[str, Any]) -> str:
    if kind == "lobing":
        r = results["ball"]
        lines = [
            f"{r.touches} touches on the ball, µm: residuals {r.smallest * 1e3:.2f} to {r.largest * 1e3:+.2f}, out of sphericity "
            f"{r.out_of_sphericity * 1e3:.2f}, standard deviation {r.std * 1e3:.2f}; without lobes {r.std_after * 1e3:.2f}"
        ]
        lines += [
            f"{x.order} lobes: amplitude {x.amplitude * 1e3:.2f} ± {x.amplitude_std * 1e3:.2f} µm, phase {x.phase:.0f}°"
            for x in r.lobes
        ]
        return "\n".join(lines)
    first = next(iter(results.values()))
    shown = [f.name for f in fields(first) if isinstance(getattr(first, f.name), float)]
    unlike = {"p_value": 1.0, "explained": 1.0, "duration": 1.0, "tau": 1.0, "temperature": 1.0}
    rows = [[f"{kind}, µm", *results]]
    for name in shown:
        label = name.replace("_", " ") + UNITS.get(name, "")
        rows.append([label, *(f"{getattr(r, name) * unlike.get(name, 1e3):.3g}" for r in results.values())])
    text = table(rows, "<" + ">" * len(results))
    if kind == "wetness":
        text += "\n\nwet minus dry at every change, µm: " + "; ".join(
            f"{name} " + ", ".join(f"{e * 1e3:+.2f}" for e in r.edges) for name, r in results.items()
        )
    return text
