"""What is inside its tolerance and yet far beyond its uncertainty: length of the stylus, height of a pivot, a work offset."""

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
        if b.name != "EZt" or not _large(b):
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


def offset(known: Sequence[Bound]) -> Iterator[Remark]:
    """quantities beside their tolerances → a remark where an axis line or the spindle is clearly not where it is stated."""
    large = [b for b in known if b.key.endswith("tolerances.location") and _large(b)]
    if large:
        sizes = ", ".join(f"{b.name} {b.value:.3f} mm" for b in large)
        yield Remark(
            "trustworthy", say("plausible.setup.offset", sizes=sizes, tolerance=f"{large[0].tolerance:g}", key=large[0].key)
        )


def _large(b: Bound) -> bool:
    return not b.beyond and abs(b.value) >= max(LARGE * b.tolerance, CERTAIN * b.std)
