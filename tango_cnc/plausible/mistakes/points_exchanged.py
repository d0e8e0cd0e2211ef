"""The points of two rotary axes are exchanged in machine.yaml: somebody copied a line."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from ...records import Vector
from ._case import Case, Hypothesis, with_axis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each pair of rotary axes with the points of each other."""
    machine = case.machine
    for one, other in combinations(machine.rotary, 2):
        a, b = machine.axis(one), machine.axis(other)
        if a.point == b.point:
            continue
        yield Hypothesis(
            f"the readings fit if the points of {one} and {other} are exchanged in machine.yaml",
            "machine",
            f"axes.{one}.point",
            f"write point: {_shown(b.point)} for {one} and point: {_shown(a.point)} for {other}",
            machine=with_axis(with_axis(machine, one, point=b.point), other, point=a.point),
        )


def _shown(v: Vector) -> str:
    return "[" + ", ".join(f"{c:g}" for c in v) + "]"
