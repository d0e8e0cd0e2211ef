"""The control recorded where the tool center point is on the table, not machine coordinates: G43.4, TRAORI or TCPM was active."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ... import kinematics
from ...texts import say
from ._case import Case, Hypothesis, with_positions


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the machine coordinates at which the tip would be where X, Y and Z of the readings are on the table."""
    machine, position = case.machine, case.readings.position
    linear = [machine.column(name) for name in ("X", "Y", "Z") if name in machine.linear]
    if len(linear) < 3 or not any(np.ptp(position[:, machine.column(name)]) for name in machine.rotary):
        return
    yield Hypothesis(
        say("mistake.tool_centre_point.fit"),
        "readings",
        "X, Y, Z",
        say("mistake.tool_centre_point.see"),
        readings=with_positions(case.readings, kinematics.inverse(kinematics.chain(machine), position, position[:, linear])),
        price=1.0,
    )
