"""An axis goes the other way than machine.yaml says, or a column of the readings has the other sign."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ._case import Case, Hypothesis, with_axis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis that moved, the other way round."""
    for axis in case.machine.axes:
        if not np.ptp(case.readings.position[:, case.machine.column(axis.name)]):
            continue
        x, y, z = (0.0 - c for c in axis.direction)
        goes = "runs" if axis.kind == "linear" else "turns"
        yield Hypothesis(
            f"the readings fit if {axis.name} {goes} the other way",
            "machine",
            f"axes.{axis.name}.direction",
            f"write [{x:g}, {y:g}, {z:g}], or see whether the column {axis.name} of the readings has the sign of the control",
            machine=with_axis(case.machine, axis.name, direction=(x, y, z)),
        )
