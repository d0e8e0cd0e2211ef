"""The control hands over another position than that of the trigger: the stand-off, or the end of the search."""

from __future__ import annotations

from collections.abc import Iterator

from ...texts import say
from ._case import Case, Hypothesis, with_probe


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → readings that were taken at the stand-off or at the end of the search."""
    approach, radius = case.cell.strategy.approach, case.machine.probe.tip_radius
    for way, what in (
        (approach.standoff, say("mistake.another_point.stand_off")),
        (-approach.search, say("mistake.another_point.end_search")),
    ):
        yield Hypothesis(
            say("mistake.another_point.readings_fit_they_were_taken", what=what),
            "readings",
            ", ".join(case.machine.linear),
            say("mistake.another_point.record_position_control_latches_at"),
            machine=with_probe(case.machine, tip_radius=radius + way),
            price=0.5,
        )
