"""The table drifts and takes the drift along as it turns: `n_w·a f(t)` with the normal in the table frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, Variants, displaced, grown, label, settling, slow, turns


def variants(touches: Touches) -> Variants:
    """touches → time constants, a straight line, every temperature sensor; nothing where the table never turns."""
    if turns(touches):
        yield from slow(touches)


def make(
    machine: Machine,
    shape: str = "exponential",
    tau: float = HOUR,
    sensor: str | None = None,
    direction: Sequence[float] | None = None,
) -> list[Coefficient]:
    """machine, f(t) = 1 − e^(−t/tau) or t/tau, tau in s → coefficients in mm (mm/K for a sensor), table frame."""
    stem = label("table_drift", *((sensor,) if sensor else (shape, tau)))
    return displaced(stem, "table", grown(shape, tau, sensor), direction, "mm/K" if sensor else "mm")


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → a table that settles, without its name."""
    yield from settling(touches, "table", "settling", touches.normal)


TERM = Cause(
    text="the table creeps on its turntable",
    source="ISO 230-3:2020 clause 5, seen from the table",
    frame="table",
    mistaken=("thermal_drift",),
    says="the table creeps {size} {towards}{course}",
    meaning="parts on the table move with it between operations by this",
    advice="check the table's clamping and coolant temperature, or keep the term",
    refine={"tau": "log"},
    once=True,  # of one axis: two of them together follow any curve
    variants=variants,
    units={"tau": "s"},
    make=make,
    unnamed=unnamed,
)
