"""A rotary axis turns about another direction than machine.yaml says."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis, with_axis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis along every base vector that it does not have now."""
    for axis in case.machine.axes:
        if axis.kind == "spindle":
            continue
        for base in (*np.eye(3), *-np.eye(3)):
            if abs(float(base @ np.array(axis.direction))) > 0.99:
                continue
            x, y, z = (float(c) + 0.0 for c in base)
            yield Hypothesis(
                say("mistake.axis_direction.readings_fit_goes_along_about", name=axis.name, x=f"{x:g}", y=f"{y:g}", z=f"{z:g}"),
                "machine",
                f"axes.{axis.name}.direction",
                f"write [{x:g}, {y:g}, {z:g}]",
                machine=with_axis(case.machine, axis.name, direction=(x, y, z)),
                price=1.0,
            )
