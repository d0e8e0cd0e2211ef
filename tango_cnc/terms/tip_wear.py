"""The tip becomes smaller, or the probe triggers later and later: every touch reads `a f(t)` early, in all directions alike."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, Variants, early, grown, label, settling, slow


def variants(touches: Touches) -> Variants:
    """touches → time constants, a straight line; no temperature sensor is at a tip."""
    yield from (setting for setting in slow(touches) if "sensor" not in setting)


def make(machine: Machine, shape: str = "exponential", tau: float = HOUR) -> list[Coefficient]:
    """machine, value × (1 − e^(−t/tau) or t/tau) → coefficient in mm; negative where the tip becomes smaller."""
    return [early(label("tip_wear", shape, tau), grown(shape, tau))]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → a tip that changes, without its name."""
    yield from settling(touches, "none", "settling", np.ones(len(touches)))


TERM = Cause(
    text="the tip wears or gathers dirt, or the probe triggers later and later",
    source="ISO 230-10:2022 clause 6, repeated: the effective radius of the tip changes",
    frame="probe",
    mistaken=("table_growth", "thermal_drift"),
    says="every touch reads {size} {early}{course}, whatever its direction",
    meaning="a matter of the probe, not of parts; what is measured late is off by this towards or away from its surface",
    advice="clean the tip, look at it under a glass, change the battery, qualify the probe before and after, or keep the term",
    refine={"tau": "log"},
    over="time",
    once=True,  # two of them together follow any curve
    variants=variants,
    units={"tau": "s"},
    make=make,
    unnamed=unnamed,
)
