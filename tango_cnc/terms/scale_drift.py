"""A linear scale or screw grows with its temperature: the axis is off by `(q_k − z) α(t)`, from the reading z where it is held."""

from __future__ import annotations

from collections.abc import Iterator

from ..kinematics import Slot
from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import HOUR, WIDE, Variants, grown, label, moved_axes, need, places, settling, slow


def variants(touches: Touches) -> Variants:
    """touches → every linear axis with time constants, a straight line, every sensor; the same held elsewhere than at its zero."""
    for axis in touches.machine.linear:
        for setting in slow(touches, 5):
            yield {"axis": axis, **setting}
    for axis in moved_axes(touches, touches.machine.linear, WIDE):
        for zero in places(touches, axis):  # the search looks between them
            yield from ({"axis": axis, **setting, "zero": zero} for setting in slow(touches, 3) if "sensor" not in setting)


def make(
    machine: Machine, axis: str, shape: str = "exponential", tau: float = HOUR, sensor: str | None = None, zero: float = 0.0
) -> list[Coefficient]:
    """machine, linear axis, α(t) = value × (1 − e^(−t/tau) or t/tau), reading mm where it is held → coefficient in mm/mm."""
    need("scale_drift", "axis", axis, machine.linear)
    growing = grown(shape, tau, sensor)
    stem = label("scale_drift", axis, *((sensor,) if sensor else (shape, tau)), *((zero,) if zero else ()))
    unit = "mm/mm/K" if sensor else "mm/mm"
    return [Coefficient(stem, unit, Slot(axis, "motion"), lambda t: (t.axis(axis) - zero) * growing(t))]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → scales that grow, without its name."""
    for axis in touches.machine.linear:
        yield from settling(touches, f"axis {axis}", "growth", touches.lever(axis) * touches.axis(axis))


TERM = Cause(
    text="the scale of an axis grows as it warms up",
    source="ISO 230-3:2020 clause 7; steel and glass scales grow 8 to 12 µm/m/K",
    frame="axis",
    mistaken=("table_growth", "screw_heat"),
    says="the scale of {axis} grows{course}; the touch that feels it most is off by {size}",
    meaning="a part made cold and one made warm differ along this axis in proportion to their length",
    advice="warm the axis up by moving it, check the compensation of its scale temperature, or keep the term",
    refine={"tau": "log", "zero": "linear"},
    once=True,  # of one axis: two of them together follow any curve
    variants=variants,
    units={"tau": "s", "zero": "mm"},
    over="time",
    make=make,
    unnamed=unnamed,
)
