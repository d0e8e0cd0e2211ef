"""The last motion before a touch leads towards its facet: what the readings say of it is compared with the normals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..records import Cell, Readings
from ..touches import from_readings
from .data import FEW, Remark

ALONG = 0.7  # mm of gap that a mm of an axis makes where it carries the approach


def approaches(cell: Cell, readings: Readings) -> Iterator[Remark]:
    """cell, readings → remarks on directions that lead away from the facets: every backlash has the wrong sign then."""
    touches = from_readings(cell.machine, cell.artefact, readings)
    against, towards = {}, {}
    for name in cell.machine.linear:
        lever, sign = touches.lever(name), touches.sign(name)
        seen = (np.abs(lever) > ALONG) & (sign != 0)
        against[name], towards[name] = int((sign * lever > 0)[seen].sum()), int((sign * lever < 0)[seen].sum())
    wrong = [n for n in against if against[n] >= FEW and against[n] > 9 * towards[n]]
    unsure = [n for n in against if n not in wrong and against[n] >= FEW and 3 * against[n] > towards[n]]
    if wrong:
        columns = ", ".join(f"d{name}" for name in wrong)
        change = f"give {columns} the sign of the axis' motion before the touch"
        yield Remark(
            "doubtful",
            f"by {columns} the axis moved away from the facet in {sum(against[n] for n in wrong)} of "
            f"{sum(against[n] + towards[n] for n in wrong)} touches: every backlash of {', '.join(wrong)} "
            "has the wrong sign then",
            (),
            "directions",
            columns,
            change,
        )
    if unsure:
        yield Remark(
            "trustworthy",
            f"the last motion of {', '.join(unsure)} leads away from the facet in {sum(against[n] for n in unsure)} of "
            f"{sum(against[n] + towards[n] for n in unsure)} touches: without columns dX dY dZ it is derived from "
            "contact to contact, which leaves out the approach; record them, or do not rely on backlashes",
            (),
            "directions",
            ", ".join(f"d{name}" for name in unsure),
        )
