"""`tango predict --test NAME`: what a ball bar, an R-test or a laser should show on this machine, and whether it did."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from .. import instruments
from ..estimate import Estimate
from ..iso230 import ranges
from ..records import InputError, Machine
from ._budget import absent, budget_of
from ._common import table
from .iso230 import at_20

SHOWN = 6  # sentences on what is withheld
IN_METRES = 5.0  # mm: a laser test that goes no further may be written in m


def test_options(call: Any) -> Any:
    """function of a command → the same with the options of a test."""
    path = click.Path(path_type=Path, exists=True, dir_okay=False)
    for option in reversed(
        [
            click.option(
                "--test", metavar="NAME", help="Instead of a program: laser-X, circle-XY, rotary-C, K1, K2, BK1 … (docs/verify.md)."
            ),
            click.option(
                "--by",
                type=click.Choice(instruments.INSTRUMENTS),
                default="ballbar",
                show_default=True,
                help="Instrument of a rotary test.",
            ),
            click.option(
                "--radius",
                type=click.FloatRange(1, 5000),
                metavar="MM",
                help="Of the circle, or of the ball from the axis [default: the largest that was touched].",
            ),
            click.option(
                "--at",
                metavar="Y=10,Z=200",
                help="Where the other axes stand, mm and degrees [default: the middle of the touches].",
            ),
            click.option("--measured", type=path, metavar="FILE", help="What the instrument showed: a CSV file to compare."),
            click.option(
                "--instrument-um",
                type=click.FloatRange(0, 1000),
                default=0.0,
                metavar="U",
                help="U (k = 2) of one reading of the instrument.",
            ),
        ]
    ):
        call = option(call)
    return call


def predicted(folder: Path, result: Estimate, options: dict[str, Any]) -> tuple[dict[str, Any], str, int]:
    """cell, estimate, options → plain data of the format tango-test/1, text, exit status (1 where something measured differs)."""
    machine = result.model.touches.machine
    wanted = instruments.Wanted(
        options["test"], options["by"], options["radius"], options["tool_length"], _place(options["at"], machine)
    )
    path = instruments.path_of(machine, ranges(result.model.touches), wanted)
    measured = None
    if options["measured"] is not None:
        measured = instruments.read_measured(options["measured"], path.channels, path.turns)
        wanted = replace(wanted, radius=options["radius"] or path.radius)

    def at(read: instruments.InstrumentReadings | None) -> instruments.Predicted:
        way = path
        if read is not None:
            way = instruments.path_of(machine, ranges(result.model.touches), wanted, read.command, read.sense)
        laser = path.name.startswith("laser")
        return instruments.predict(result, way, at_20(folder), at_reference=laser, budget=budget_of(folder, result))

    told = at(measured)
    compared = None if measured is None else instruments.compare(told, measured, options["instrument_um"])
    if measured is not None and compared is not None and not compared.slip and _in_other_unit(path, measured):
        factor, unit, right = (math.degrees(1.0), "rad", "degrees") if path.turns else (1e3, "m", "mm")
        read = replace(measured, command=factor * measured.command)
        there = at(read)
        if not instruments.compare(there, read, options["instrument_um"]).far:
            compared = replace(compared, slip=f"they agree where commands are in {unit}. The column has {right}")
    data = _data(told) | ({} if compared is None or measured is None else _compared(compared, measured, options["instrument_um"]))
    differs = compared is not None and (
        compared.far or bool(compared.slip) or any(f.verdict == "differs" for f in compared.figures)
    )
    return data, "\n".join(_text(told, compared, measured)), int(differs)


def _in_other_unit(path: instruments.Path, measured: instruments.InstrumentReadings) -> bool:
    """path, what was measured → whether its commands go no further than those of a whole turn in rad, or of a laser in m, would."""
    far = float(np.abs(measured.command).max())
    return far <= 1.02 * math.radians(2 * math.pi) if path.turns else far < IN_METRES


def _place(text: str | None, machine: Machine) -> dict[str, float]:
    found, names = {}, (*machine.linear, *machine.rotary)
    for part in text.split(",") if text else ():
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if name.strip() not in names or not math.isfinite(number):
            raise InputError(f"--at: found {part!r}; allowed: AXIS=NUMBER,… in mm and degrees, axes {' '.join(names)}")
        low, high = machine.axis(name.strip()).limits
        own = number if name.strip() in machine.linear else math.radians(number)
        if not low - 1e-6 <= own <= high + 1e-6:
            factor = 1.0 if name.strip() in machine.linear else 180 / math.pi
            raise InputError(
                f"--at: found {part.strip()}; allowed: {factor * low:g} to {factor * high:g}, the travel of {name.strip()}"
            )
        found[name.strip()] = number if name.strip() in machine.linear else math.radians(number)
    return found


def _data(told: instruments.Predicted) -> dict[str, Any]:
    path = told.path
    command = np.degrees(path.command) if path.turns else path.command
    return {
        "format": "tango-test/1",
        "test": path.name,
        "path": path.text,
        "reference": path.reference.text,
        "temperature": told.temperature,
        "budget": list(told.budget),
        "extrapolated": path.outside,
        "figures": [
            {
                "kind": f.kind,
                "name": f.name,
                "value_um": f.value,
                "interval_um": None if f.interval is None else list(f.interval),
                "mixed_with": list(f.mixed),
            }
            for f in told.figures
        ],
        "not_identifiable": [f.text for f in told.figures if f.value is None],
        "channels": list(path.channels),
        "readings": [
            {
                "angle_deg" if path.turns else "position_mm": round(float(c), 6),
                "direction": "+" if s > 0 else "-",
                "um": [round(float(v), 4) for v in told.value[:, i]],
                "std_um": [round(float(v), 4) for v in told.std[:, i]],
            }
            for i, (c, s) in enumerate(zip(command, path.sense, strict=True))
        ],
    }


def _compared(found: instruments.Compared, measured: instruments.InstrumentReadings, own: float) -> dict[str, Any]:
    return {
        "compared": {
            "runs": measured.runs,
            "instrument_U_um": own,
            "rms_um": found.rms,
            "expected_um": found.expected,
            "readings_inside": found.inside,
            "readings_chance": found.chance,
            "readings_differ": found.far,
            "slip": found.slip or None,
            "figures": [
                {"name": f.name, "measured_um": f.measured, "E_n": f.normalized, "verdict": f.verdict} for f in found.figures
            ],
        }
    }


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.1f} %" if share >= 0.001 else "fewer than 0.1 %"


def _text(
    told: instruments.Predicted, found: instruments.Compared | None, measured: instruments.InstrumentReadings | None
) -> list[str]:
    path = told.path
    lines = [f"{path.name}: {path.text}", path.reference.text]
    if path.name.startswith("laser"):
        lines.append(f"temperature of scales: {told.temperature}")
    if path.outside:
        share = 100 * path.outside / len(path.command)
        lines.append(
            f"extrapolated: at {share:.0f} % of the positions an axis is beyond the touches: the machine was not measured there"
        )
    if not told.budget:
        lines.append(
            "intervals: error motions of every order and the scatter of the touches; "
            "write uncertainty.yaml for drift, lobing and the like"
        )
    elif lacking := absent(told.budget):
        lines.append(f"intervals: with uncertainty.yaml, which does not name {', '.join(lacking)}")
    rows = [["figure", "µm", "95 %", *([] if found is None else ["measured", "E_n", ""])]]
    for i, f in enumerate(told.figures):
        value = "withheld" if f.value is None or f.interval is None else f"{f.value:.1f}"
        between = "" if f.interval is None else f"{f.interval[0]:.1f} … {f.interval[1]:.1f}"
        row = [f.name, value, between]
        if found is not None:
            a = found.figures[i]
            row += [f"{a.measured:.1f}", "" if a.normalized is None else f"{a.normalized:+.2f}", a.verdict]
        rows.append(row)
    lines.append(table(rows, "<>>" if found is None else "<>>>><"))
    texts = [f.text for f in told.figures if f.value is None]
    lines += [f"withheld: {text}" for text in texts[:SHOWN]]
    if len(texts) > SHOWN:
        lines.append(f"and {len(texts) - SHOWN} figures more: --json FILE has their sentences")
    if found is not None and measured is not None:
        lines.append(
            f"readings: {found.rms:.2f} µm rms from the prediction, {found.expected:.2f} µm expected; "
            f"{100 * found.inside:.0f} % within their own 95 % intervals; {measured.runs} runs. Of true files "
            f"{_percent(found.chance)} are as far off, by all that the prediction leaves open"
        )
        if found.slip:
            lines.append(f"The readings do not fit as they are: {found.slip}.")
        elif found.far:
            why = (
                "the machine has changed, or the instrument shows what these touches cannot see"
                if texts
                else "the machine has changed"
            )
            lines.append(
                f"The readings differ from the prediction: {why}. Look at how the instrument was set up, then measure again."
            )
    return lines
