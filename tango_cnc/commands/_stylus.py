"""A strategy with several styli: which one a command is about, and what is left for the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ..plan import by_stylus, last_motion
from ..records import Cell, InputError, Machine, Plan, TermItem
from ._common import Decorator

LONGER = 60.0  # mm

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


def with_second(made: Plan, terms: Sequence[TermItem], degree: int) -> tuple[float, tuple[str, ...]]:
    """plan with one stylus, terms, degree → length of another one, mm, ISO figures decided by every touch made again with it.

    That is the second one of machine.yaml, else one that is `LONGER` mm longer.
    """
    machine, n = made.machine, len(made.touches)
    other = machine.styli[1] if machine.styli else replace(machine.probe, length=machine.probe.length + LONGER)
    both = replace(machine, styli=(machine.probe, other))
    return other.length, _decided(made, both, np.repeat([1, 2], n), terms, degree)[0]


def bought(made: Plan, terms: Sequence[TermItem], degree: int) -> dict[str, Any]:
    """plan with one stylus, terms, degree → ISO figures that it decides, and those of `with_second`."""
    alone, withheld = _decided(made, made.machine, None, terms, degree)
    length, together = with_second(made, terms, degree)
    return {
        "length_mm": length,
        "figures": len(alone) + len(withheld),
        "alone": len(alone),
        "together": len(together),
        "more": [name for name in together if name not in alone],
    }


def _decided(
    made: Plan, machine: Machine, stylus: NDArray[np.int64] | None, terms: Sequence[TermItem], degree: int
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    from ..identify import select
    from ..iso230.signed import decided
    from ..touches import of_facets

    times = 1 if stylus is None else len(stylus) // len(made.touches)
    facets, moved = [t.facet for t in made.touches] * times, np.tile(last_motion(made), (times, 1))
    position = np.tile(np.array([t.contact for t in made.touches]), (times, 1))
    touches = of_facets(machine, made.artefact, facets, position, moved, stylus)
    return decided(select(touches if stylus is None else touches.nominal, terms, degree))


def folder_of(folder: Path, cell: Cell) -> Path:
    """program folder, cell with one stylus → where the programs of that stylus go."""
    return folder if cell.machine.stylus == 1 else folder / f"stylus{cell.machine.stylus}"
