"""`tango iso230`: show the figures of ISO 230-1."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from .. import iso230
from ..estimate import Estimate
from ..files import read_cell, read_readings, read_terms
from ..files.origin import current
from ..iso230 import columns
from ..iso230.seen import WORTH
from ..iso230.signed import Sheet, signed
from ..iso230.temperature import ASSUMED, Known, Thermal, read_thermal, scale, state_of
from ..judging import judged
from ..texts import say
from ._budget import absent, budget_of
from ._common import ahead, cell_option, json_option, table, write_json
from ._handed import printed
from ._trust import despite_option, members, status, told

PLACE = "Understand 50"  # in the list of commands


@click.command()
@cell_option
@click.option(
    "--readings", "file", type=click.Path(path_type=Path), help="Readings file [default: readings.csv, else simulated.csv]."
)
@click.option("--terms", help="Instead of the cell's: S1 … S4 or a list, e.g. S3,EYX2.")
@click.option("--degree", type=click.IntRange(1, 6), default=3, show_default=True, help="Highest degree of the polynomials of S4.")
@click.option(
    "--tool-length", type=click.FloatRange(0, min_open=True), help="mm, of the tool at whose tip figures hold [default: the probe]."
)
@click.option(
    "--as-found", is_flag=True, help="Scales at the temperature of the machine, not at 20 °C; without temperature.yaml as read."
)
@click.option("--fitted", is_flag=True, help="Figures of the fitted terms alone, as if the machine had no other error motion.")
@despite_option
@json_option
def command(
    folder: Path,
    file: Path | None,
    terms: str | None,
    degree: int,
    tool_length: float | None,
    as_found: bool,
    fitted: bool,
    despite: bool,
    json_file: str | None,
) -> int:
    """Straightness, positioning, reversal, squareness, error motions of rotary axes: ISO 230-1 figures out of the estimate.

    The tool moves relative to the workpiece, one axis at a time, over the range that was touched. A figure that other error
    motions of this machine could have made as well is withheld, and they are named.
    """
    cell = read_cell(folder)
    source = current(folder, file)
    readings = read_readings(source, cell.machine, cell.artefact)
    result, judgement = judged(
        cell, readings, cell.terms if terms is None else read_terms(terms, cell.folder), degree, source=source
    )
    thermal = thermal_of(folder) if as_found else at_20(folder)
    longer, state = None if thermal is None else scale(thermal, not as_found), state_of(thermal, not as_found)
    if fitted:
        alone = {"temperature": state, "fitted": _fitted_json(result, longer)}
        if not write_json(json_file, {"format": "tango-iso230/1", **members(judgement), **alone}):
            printed("\n".join([*told(judgement), f"temperature of scales: {state}", _fitted_text(result, longer)]))
        return status(judgement, despite)
    sheet = signed(result, tool_length, thermal, not as_found, budget_of(folder, result))
    warm = columns.said(readings.temperatures, thermal_of(folder))
    if not write_json(
        json_file,
        sheet_json(sheet) | members(judgement) | {"fitted": _fitted_json(result, longer), "temperature_notes": list(warm)},
    ):
        printed("\n".join([*told(judgement), *warm, *sheet_text(sheet)]))
        if judgement.verdict == "trustworthy" and file is None:
            ahead(folder, "compensate --list", "report")
    return status(judgement, despite)


def thermal_of(folder: Path) -> Thermal | None:
    """cell → its temperature.yaml, None where it has none."""
    file = folder / "temperature.yaml"
    return read_thermal(file) if file.exists() else None


def at_20(folder: Path) -> Thermal:
    """cell → its temperature.yaml, else what is assumed of a workshop: with it figures hold at 20 °C."""
    return thermal_of(folder) or ASSUMED


def sheet_json(sheet: Sheet) -> dict[str, Any]:
    """figures → plain data of the format tango-iso230/1."""
    at = sheet.reference
    return {
        "format": "tango-iso230/1",
        "reference": {
            "pose": {n: v if n in "XYZ" else v * 180 / math.pi for n, v in at.pose.items()},
            "tool_length_mm": at.length,
            "functional_point_mm": list(at.point),
        },
        "temperature": sheet.temperature,
        "temperatures": None if sheet.thermal is None else sheet.thermal.text,
        "budget": None if sheet.budget is None else list(sheet.budget.named),
        "order": {"degree": sheet.order[0], "harmonics": sheet.order[1]},
        "orders": [
            {"degree": d, "harmonics": h, "weight": worth, "left_out_um": off * 1e3}
            for ((d, h), worth), off in zip(sheet.orders, sheet.left_out, strict=True)
        ],
        "unseen_harmonics": list(sheet.unseen),
        "touch_std_um": sheet.sigma * 1e3,
        "dof": sheet.freedom,
        "drift_um": _drifted(sheet) or None,
        "figures": [
            {
                "kind": f.kind,
                "name": f.name,
                "value": f.value,
                "interval": None if f.interval is None else list(f.interval),
                "unit": f.unit,
                "range": None if f.range is None else list(f.range),
                "positions": f.positions,
                "note": f.note,
                "mixed_with": list(f.mixed),
            }
            for f in sheet.figures
        ],
        "not_identifiable": list(sheet.not_identifiable),
        "advice": list(sheet.advice),
    }


def sheet_text(sheet: Sheet) -> list[str]:
    """figures → lines for people."""
    rows = [["figure", "", "value", "95 % interval", "", "over mm or °", "positions", ""]]
    for f in sheet.figures:
        if f.value is None or f.interval is None:
            continue
        over = "" if f.range is None else f"{f.range[0]:.0f} … {f.range[1]:.0f}"
        between = f"{f.interval[0]:.2f} … {f.interval[1]:.2f}"
        rows.append([f.kind, f.name, f"{f.value:.2f}", between, f.unit, over, f"{f.positions or ''}", f.note])
    lines = [sheet.reference.text, f"temperature of scales: {sheet.temperature}"]
    tried = ", ".join(
        f"degree {d} with {h} harmonics {100 * worth:.0f} % ({off * 1e3:.2f} µm)"
        for ((d, h), worth), off in zip(sheet.orders, sheet.left_out, strict=True)
        if worth > WORTH or (d, h) == sheet.order
    )
    used = f"error motions as polynomials of degree {sheet.order[0]} and {sheet.order[1]} harmonics"
    if sheet.temperature == "not stated":
        lines[1] += say("iso_said.temperature.as_read")
    if sheet.thermal is not None:
        lines[1] += f" ({sheet.thermal.text})"
        if sheet.thermal.assumed:
            lines[1] += say("iso_said.temperature.assumed", size=f"{2e6 * scale(sheet.thermal, True).std:.0f}")
    if sheet.budget is None:
        lines.append(
            "intervals: scatter of the touches, all error motions, and drift as the touches show it; without uncertainty.yaml they "
            "have no lobing …"
        )
    else:
        also, not_in = ", ".join(sheet.budget.beside) or "nothing more", ", ".join(absent(sheet.budget.named))
        lines.append(
            f"intervals: scatter of the touches, all error motions, and drift as the touches show it; of uncertainty.yaml: {also}"
            + (f"; it does not name {not_in}" if not_in else "")
        )
    if drifted := _drifted(sheet):
        gone = ", ".join(f"{c} {v:.1f}" for c, v in zip("XYZ", drifted, strict=True))
        lines.append(
            f"drift of the table against the tool while it was touched: about {gone} µm, as far as the touches part it from error "
            "motions; figures are without it, and intervals allow for what is not parted"
        )
    lines += list(sheet.unseen)
    lines.append(
        f"{used}, or more where the intervals say so; what each order is worth to these touches: {tried}; in "
        "brackets how far a touch is off what all others predict, rms"
    )
    lines.append(table(rows, "<<>><>><") if len(rows) > 1 else "these touches decide no figure")
    withheld = [f"withheld: {text}" for text in sheet.not_identifiable]
    return lines + withheld + (["", "what to do about withheld figures:", *(f"  {t}" for t in sheet.advice)] if withheld else [])


def _drifted(sheet: Sheet) -> list[float]:
    """figures → µm that the table went against the tool along X Y Z of the machine while it was touched; [] where nobody knows."""
    return [] if sheet.learned is None else [1e3 * v for v in sheet.learned.drifted]


def _fitted_json(result: Estimate, longer: Known | None) -> list[dict[str, Any]]:
    return [
        {
            "kind": f.kind,
            "name": f.name,
            "value": f.value,
            "std": f.std,
            "interval": None if f.interval is None else list(f.interval),
            "unit": f.unit,
            "range": None if f.range is None else list(f.range),
            "note": f.note,
        }
        for f in iso230.figures(result, expansion=longer)
    ]


def _fitted_text(result: Estimate, longer: Known | None) -> str:
    rows = [["figure", "", "value", "std", "", "″", "over mm or °", ""]]
    for f in iso230.figures(result, expansion=longer):
        over = "" if f.range is None else f"{f.range[0]:.0f} … {f.range[1]:.0f}"
        second = "" if f.arcseconds is None else f"{f.arcseconds:.2f}"
        rows.append([f.kind, f.name, f"{f.value:.2f}", f"{f.std:.2f}", f.unit, second, over, f.note])
    return table(rows, "<<>><>><")
