"""Two axes are exchanged: their columns in the readings, or their directions in machine.yaml."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

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
                f"the readings fit if {one} and {other} are exchanged",
                "readings",
                f"{one}, {other}",
                f"exchange the columns {one} and {other}, or the directions of both axes in machine.yaml",
                readings=with_positions(case.readings, swapped),
            )
            a, b = machine.axis(one), machine.axis(other)
            changed = with_axis(machine, one, direction=b.direction)
            yield Hypothesis(
                f"the readings fit if {one} and {other} are exchanged in machine.yaml",
                "machine",
                f"axes.{one}.direction",
                f"exchange the directions of {one} and {other}, or their columns in the readings",
                machine=with_axis(changed, other, direction=a.direction),
                price=0.5,
            )
