"""The tip of the stylus creeps sideways in its holder: `n_s·a f(t)` with the normal in the spindle frame, a across the spindle.

Pre-travel that grows with time on one side of the probe is the same pattern.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, Variants, displaced, grown, label, settling, slow


def variants(touches: Touches) -> Variants:
    """touches → time constants, a straight line; no temperature sensor is in a holder."""
    yield from (setting for setting in slow(touches) if "sensor" not in setting)


def make(
    machine: Machine, shape: str = "exponential", tau: float = HOUR, direction: Sequence[float] | None = None
) -> list[Coefficient]:
    """machine, f(t) = 1 − e^(−t/tau) or t/tau, tau in s → coefficients in mm, x and y of the spindle frame."""
    found = displaced(label("stylus_creep", shape, tau), "spindle", grown(shape, tau), direction)
    return found if direction is not None else found[:2]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → a stylus that settles, without its name."""
    yield from settling(touches, "spindle", "settling", touches.spindle_normal[:, :2])


TERM = Cause(
    text="the stylus tip creeps sideways in its holder",
    source="ISO 230-10:2022 clause 6, repeated; a tip that moves turns with the spindle, as its offset EXt EYt does",
    frame="spindle",
    mistaken=("thermal_drift", "table_drift"),
    plainer=("thermal_drift", "table_drift"),  # while the spindle stands as it mostly does, all three read alike
    says="the stylus tip creeps {size} sideways{toward}{course}",
    meaning="a matter of the probe, not of parts; what is measured late is off sideways by this against what is measured early",
    advice="clean and fix the stylus and its holder, touch one facet at several angles of the spindle, or keep the term",
    refine={"tau": "log"},
    over="time",
    once=True,  # two of them together follow any curve
    variants=variants,
    units={"tau": "s"},
    make=make,
    unnamed=unnamed,
)
