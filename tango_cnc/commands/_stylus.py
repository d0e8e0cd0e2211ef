"""A strategy with several styli: which one a command is about, and what is left for the others."""

from __future__ import annotations

from pathlib import Path

import click

from ..plan import by_stylus
from ..records import Cell, InputError
from ._common import Decorator

stylus_option: Decorator = click.option(
    "--stylus",
    "stylus",
    type=click.IntRange(1),
    metavar="N",
    help="Of a strategy with several styli: the touches of stylus N [default: the first of the strategy].",
)


def of_stylus(cell: Cell, number: int | None) -> Cell:
    """cell, --stylus → the cell with that stylus in its spindle and its indexations alone. Raises InputError for another number."""
    parts = by_stylus(cell)
    if number is None:
        return parts[0]
    found = next((part for part in parts if part.machine.stylus == number), None)
    if found is None:
        known = ", ".join(str(part.machine.stylus) for part in parts)
        raise InputError(f"--stylus: found {number}; allowed: {known}, the styli that the strategy states")
    return found


def left(cell: Cell, part: Cell, command: str) -> list[str]:
    """whole cell, the part with one stylus, command → a sentence on each stylus that comes after it."""
    return [
        f"the touches with stylus {other.machine.stylus} ({other.machine.probe.length:g} mm) are a program of their own: "
        f"'{command} --stylus {other.machine.stylus}'"
        for other in by_stylus(cell)
        if other.strategy.before > part.strategy.before
    ]


def folder_of(folder: Path, cell: Cell) -> Path:
    """program folder, cell with one stylus → where the programs of that stylus go."""
    return folder if cell.machine.stylus == 1 else folder / f"stylus{cell.machine.stylus}"
