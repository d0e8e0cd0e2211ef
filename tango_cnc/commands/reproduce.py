"""`tango reproduce`: the thesis' tables beside this program's numbers."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import click

from ..files import read_cell, read_strategy
from ..report import pictures
from ..reproduce import Setting, Table, table, tables
from ._common import json_option, write_json
from ._common import table as aligned
from .init import examples


@click.command()
@click.argument("numbers", nargs=-1, metavar="[TABLE]...")
@click.option("--list", "listing", is_flag=True, help="List the tables that are reproduced.")
@click.option(
    "--pictures", "folder", type=click.Path(path_type=Path), metavar="DIR", help="Figures 4-7 to 4-10 there (needs matplotlib)."
)
@json_option
def command(numbers: tuple[str, ...], listing: bool, folder: Path | None, json_file: str | None) -> None:
    """Puts the tables of the thesis beside this program's numbers: what is compared, what differs, and why.

    TABLE is a number such as 4-6; without one, all of them. Printed figures come from a real machine, ours from the simulator.
    """
    known = tables()
    if listing:
        click.echo("\n".join(known))
        return
    if folder is not None:
        pictures.needed()
    setting = _setting()
    found = []
    for number in numbers or known:
        click.echo(f"table {number} …", err=True)
        found.append(table(number, setting))
    if folder is not None:
        for one in found:
            if one.arrows is not None:
                file = pictures.write(pictures.vectors(one.arrows.panels), folder / f"figure_{one.arrows.figure}.png")
                click.echo(f"picture: {file}", err=True)
    if not write_json(json_file, {"format": "tango-reproduction/1", "tables": [as_json(one) for one in found]}):
        click.echo("\n\n".join(as_text(one) for one in found))


def _setting() -> Setting:
    folders = examples()
    huron = read_cell(folders["huron"])
    second = read_strategy(folders["huron"] / "strategy_s2.yaml", huron.machine, huron.artefact)
    return Setting(huron, second)


def as_json(one: Table) -> dict[str, Any]:
    """table → plain data."""
    rows = [
        {
            "name": row.name,
            "printed": dict(zip(one.columns, row.printed, strict=True)),
            "ours": dict(zip(one.columns, row.ours, strict=True)),
        }
        for row in one.rows
    ]
    return {
        "table": one.number,
        "title": one.title,
        "unit": one.unit,
        "rows": rows,
        "compared": one.compared,
        "differs": one.differs,
    }


def as_text(one: Table) -> str:
    """table → what a person reads on the terminal."""
    head = [["", *(cell for column in one.columns for cell in (column, ""))], ["", *(("thesis", "here") * len(one.columns))]]
    rows = [[row.name, *(_shown(v) for pair in zip(row.printed, row.ours, strict=True) for v in pair)] for row in one.rows]
    lines = [f"Table {one.number}  {one.title}, {one.unit}", aligned([*head, *rows], "<" + ">>" * len(one.columns))]
    for title, text in (("compared", one.compared), ("differs", one.differs)):
        lines.append(textwrap.fill(f"{title}: {text}", 118, subsequent_indent="  "))
    return "\n".join(lines)


def _shown(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.2f}" if abs(value) >= 0.1 or value == 0 else f"{value:.4f}"
