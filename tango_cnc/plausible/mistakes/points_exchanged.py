"""The points of two rotary axes are exchanged in machine.yaml: somebody copied a line."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from ...records import Vector
from ...texts import say
from ._case import Case, Hypothesis, with_axis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each pair of rotary axes with the points of each other."""
    machine = case.machine
    for one, other in combinations(machine.rotary, 2):
        a, b = machine.axis(one), machine.axis(other)
        if a.point == b.point:
            continue
        yield Hypothesis(
            say("mistake.points_exchanged.fit", one=one, other=other),
            "machine",
            f"axes.{one}.point",
            say("mistake.points_exchanged.write", one=one, other=other, point=_shown(b.point), point2=_shown(a.point)),
            machine=with_axis(with_axis(machine, one, point=b.point), other, point=a.point),
            price=6.0,  # a single point that is elsewhere may move every touch alike, and is commoner
        )


def _shown(v: Vector) -> str:
    return "[" + ", ".join(f"{c:g}" for c in v) + "]"
