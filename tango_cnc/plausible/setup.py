"""What is inside its tolerance and yet far beyond its uncertainty: the length of the stylus, or the height of a pivot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..records import Cell
from ..texts import say
from .bounds import Bound
from .data import Remark

LARGE = 0.2  # of the tolerance
CERTAIN = 20.0  # standard deviations


def stylus(cell: Cell, known: Sequence[Bound]) -> Iterator[Remark]:
    """cell, quantities beside their tolerances → a remark where the stylus is clearly not as long as stated."""
    for b in known:
        if b.name != "EZt" or b.beyond or abs(b.value) < max(LARGE * b.tolerance, CERTAIN * b.std):
            continue
        machine = cell.machine
        spindle = np.array(machine.spindle.direction)
        tilting = [f"axes.{n}.point" for n in machine.rotary if abs(float(spindle @ np.array(machine.axis(n).direction))) < 0.99]
        yield Remark(
            "trustworthy",
            say(
                "plausible.setup.stylus_or_pivot" if tilting else "plausible.setup.stylus",
                points=", ".join(tilting),
                size=f"{abs(b.value):.3f}",
                spread=f"{2 * b.std:.2g}",
                key=b.key,
                tolerance=f"{b.tolerance:g}",
            ),
        )
