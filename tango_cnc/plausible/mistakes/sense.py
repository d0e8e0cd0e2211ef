"""An axis goes the other way than machine.yaml says, or a column of the readings has the other sign."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis, with_axis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis that moved, the other way round."""
    for axis in case.machine.axes:
        if not np.ptp(case.readings.position[:, case.machine.column(axis.name)]):
            continue
        x, y, z = (0.0 - c for c in axis.direction)
        goes = "runs" if axis.kind == "linear" else "turns"
        yield Hypothesis(
            say(f"mistake.sense.{goes}", name=axis.name),
            "machine",
            f"axes.{axis.name}.direction",
            say("mistake.sense.write_see_whether_column_readings", x=f"{x:g}", y=f"{y:g}", z=f"{z:g}", name=axis.name),
            machine=with_axis(case.machine, axis.name, direction=(x, y, z)),
        )
