"""Warm-up: everything on the table drifts against the tool, `n·a f(t)` with the normal in the machine frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, Variants, displaced, grown, label, settling, slow


def variants(touches: Touches) -> Variants:
    """touches → time constants, a straight line, every temperature sensor."""
    yield from slow(touches)


def make(
    machine: Machine,
    shape: str = "exponential",
    tau: float = HOUR,
    sensor: str | None = None,
    direction: Sequence[float] | None = None,
) -> list[Coefficient]:
    """machine, f(t) = 1 − e^(−t/tau) or t/tau, tau in s → coefficients in mm (mm/K for a sensor), machine frame."""
    stem = label("thermal_drift", *((sensor,) if sensor else (shape, tau)))
    return displaced(stem, "machine", grown(shape, tau, sensor), direction, "mm/K" if sensor else "mm")


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → a machine that settles, without its name."""
    yield from settling(touches, "machine", "settling", touches.machine_normal)


TERM = Cause(
    text="the machine drifts as it warms up",
    source="ISO 230-3:2020 clause 5; thesis section 7.3, procedure I",
    frame="machine",
    mistaken=("table_drift", "step", "stylus_creep"),
    says="the machine drifts {size} {towards}{course}",
    meaning="parts made in the first hour differ by this from parts made later",
    advice="warm the machine up before calibrating, mix the order of indexations, or keep the term",
    refine={"tau": "log"},
    once=True,  # of one axis: two of them together follow any curve
    expected=True,  # every machine does it (ISO 230-3 is about nothing else): it may be tested for itself
    variants=variants,
    units={"tau": "s"},
    make=make,
    role="warm-up",
    unnamed=unnamed,
)
