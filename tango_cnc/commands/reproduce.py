"""`tango reproduce`: compare the tables of the thesis with the numbers of this program."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import click

from ..files import read_cell, read_strategy, write_text
from ..records import InputError
from ..report import pictures
from ..reproduce import Setting, Table, table, tables, unexplained
from ._beside import alone
from ._common import Output, json_option, write_json
from ._common import table as aligned
from .init import examples

PLACE = "Understand 70"  # in the list of commands


@click.command()
@click.argument("numbers", nargs=-1, metavar="[TABLE]...")
@alone()("--list", "listing", is_flag=True, help="List the tables that are reproduced.")
@click.option(
    "--pictures", "folder", type=click.Path(path_type=Path), metavar="DIR", help="Figures 4-7 to 4-10 there (needs matplotlib)."
)
@click.option(
    "--diagnose",
    "explaining",
    is_flag=True,
    help="With table 4-6: simulate it many times with the drift, surface and lobing that the thesis measured, find them again in "
    "the readings, and say what the printed numbers leave unexplained (some 20 s).",
)
@click.option(
    "--repeats", type=click.IntRange(2), metavar="N", help=f"With --diagnose: simulated tests [default: {unexplained.REPEATS}]."
)
@click.option("--html", type=Output(), metavar="FILE", help="Also write a page with pictures (needs matplotlib).")
@json_option
def command(
    numbers: tuple[str, ...],
    listing: bool,
    folder: Path | None,
    explaining: bool,
    repeats: int | None,
    html: Path | None,
    json_file: str | None,
) -> None:
    """Puts the tables of the thesis beside this program's numbers: what is compared, what differs, and why.

    TABLE is a number such as 4-6; without one, all of them. Printed figures come from a real machine, ours from the simulator.
    """
    numbers = tuple(number.removeprefix("table-") for number in numbers)
    if explaining and not numbers:
        numbers = ("4-6",)
    if explaining and "4-6" not in numbers:
        raise InputError(f"--diagnose: found with table {', '.join(numbers)}; allowed: with 4-6, whose residuals it explains")
    if repeats is not None and not explaining:
        raise InputError("--repeats: found without --diagnose; allowed: only together with it")
    known = tables()
    if listing:
        click.echo("\n".join(known))
        return
    for number in numbers:
        if number not in known:
            raise InputError(f"table: found {number!r}; allowed: {', '.join(known)}")
    if folder is not None or html is not None:
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
    study = None
    if explaining:
        click.echo("simulating table 4-6 again and again, then diagnosing …", err=True)
        study = unexplained.study(setting, repeats or unexplained.REPEATS)
    if html is not None:
        from ..reproduce._page import page

        write_text(html, page(found, study))
        click.echo(f"report with pictures → {html}", err=True)
    data: dict[str, Any] = {"format": "tango-reproduction/1", "tables": [as_json(one) for one in found]}
    if study is not None:
        data["unexplained"] = unexplained.as_json(study)
    if not write_json(json_file, data):
        click.echo("\n\n".join(as_text(one) for one in found))
        if study is not None:
            click.echo("\n" + study_text(study))


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
            **({"other": dict(zip(one.columns, row.other, strict=True))} if row.other else {}),
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
    sources = ("thesis", "here", "other") if any(row.other for row in one.rows) else ("thesis", "here")
    blank = [""] * (len(sources) - 1)
    head = [["", *(cell for column in one.columns for cell in (column, *blank))], ["", *(sources * len(one.columns))]]
    rows = []
    for row in one.rows:
        values = (row.printed, row.ours, row.other or (None,) * len(row.ours))[: len(sources)]
        rows.append([row.name, *(_shown(v) for group in zip(*values, strict=True) for v in group)])
    lines = [f"Table {one.number}  {one.title}, {one.unit}", aligned([*head, *rows], "<" + ">" * len(sources) * len(one.columns))]
    for title, text in (("compared", one.compared), ("differs", one.differs)):
        lines.append(textwrap.fill(f"{title}: {text}", 118, subsequent_indent="  "))
    return "\n".join(lines)


def study_text(study: unexplained.Unexplained) -> str:
    """study → what a person reads on the terminal."""
    sources = ("thesis", "here, without", "other, without", "here, with", "other, with")
    rows = [["|r|, µm", *sources]]
    for name in unexplained.SETS:
        for what in ("mean", "max"):
            pair = [f"{v:.2f} ± {sd:.2f}" for v, sd in (one[name].values[what] for one in (study.without, study.disturbed))]
            other = [f"{study.other[how][name][what]:.2f}" for how in ("without", "with")]
            rows.append([f"{name} {what}", f"{study.printed[name][what]:.2f}", pair[0], other[0], pair[1], other[1]])
    lines = [
        f"Table 4-6 without and with what the thesis measured, {study.repeats} simulated tests each (± their standard deviation)"
    ]
    lines += [aligned(rows, "<>>>>>"), ""]
    for one in study.found:
        lines.append(f"Hidden in simulated readings: {one.title}. tango diagnose, terms S4, says {one.diagnosis.verdict}:")
        lines += [f"  hidden  {line}" for line in unexplained.hidden(one.hidden)]
        lines += [f"  found   {line}" for line in unexplained.found_words(one)]
        lines.append("")
    lines.append("What the printed numbers leave unexplained")
    lines += [textwrap.fill(line, 118, initial_indent="- ", subsequent_indent="  ") for line in unexplained.words(study)]
    return "\n".join(lines)


def _shown(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.2f}" if abs(value) >= 0.1 or value == 0 else f"{value:.4f}"
