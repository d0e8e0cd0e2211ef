"""Two axes are exchanged: their columns in the readings, or their directions in machine.yaml."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis, with_axis, with_positions


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each pair of linear or of rotary axes, exchanged."""
    machine, position = case.machine, case.readings.position
    for group in (machine.linear, machine.rotary):
        for one, other in combinations(group, 2):
            i, j = machine.column(one), machine.column(other)
            swapped = np.array(position)
            swapped[:, [i, j]] = position[:, [j, i]]
            yield Hypothesis(
                say("mistake.axes_exchanged.readings_fit_exchanged", one=one, other=other),
                "readings",
                f"{one}, {other}",
                say("mistake.axes_exchanged.exchange_columns_directions_both_axes", one=one, other=other),
                readings=with_positions(case.readings, swapped),
            )
            a, b = machine.axis(one), machine.axis(other)
            changed = with_axis(machine, one, direction=b.direction)
            yield Hypothesis(
                say("mistake.axes_exchanged.readings_fit_exchanged_machine_yaml", one=one, other=other),
                "machine",
                f"axes.{one}.direction",
                say("mistake.axes_exchanged.exchange_directions_their_columns_readings", one=one, other=other),
                machine=with_axis(changed, other, direction=a.direction),
                price=0.5,
            )
