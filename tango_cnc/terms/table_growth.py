"""The table grows with its temperature: `n_w·p α(t)`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, Variants, early, grown, label, settling, slow


def variants(touches: Touches) -> Variants:
    """touches → time constants, a straight line, every temperature sensor."""
    yield from slow(touches)


def make(machine: Machine, shape: str = "exponential", tau: float = HOUR, sensor: str | None = None) -> list[Coefficient]:
    """machine, α(t) = value × (1 − e^(−t/tau) or t/tau) → coefficient in mm/mm (mm/mm/K for a sensor)."""
    growing = grown(shape, tau, sensor)
    stem = label("table_growth", *((sensor,) if sensor else (shape, tau)))
    return [early(stem, lambda t: np.sum(t.normal * t.point, axis=1) * growing(t), "mm/mm/K" if sensor else "mm/mm")]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → a table that grows, without its name."""
    yield from settling(touches, "table", "growth", np.sum(touches.normal * touches.point, axis=1))


TERM = Cause(
    text="the table grows as it warms up",
    source="ISO 230-3:2020 clause 5; steel grows 12 µm/m/K",
    frame="table",
    mistaken=("scale_drift",),
    says="the table grows{course}; the touch that feels it most is off by {size}",
    meaning="the artefact and the parts grow with the coolant and the room; "
    "diameters and distances are off in proportion to their size",
    advice="let table and coolant settle, measure the scale bar at the beginning and at the end, or keep the term",
    refine={"tau": "log"},
    once=True,  # of one axis: two of them together follow any curve
    variants=variants,
    units={"tau": "s"},
    make=make,
    unnamed=unnamed,
)
