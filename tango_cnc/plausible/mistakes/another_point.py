"""The control hands over another position than that of the trigger: the stand-off, or the end of the search."""

from __future__ import annotations

from collections.abc import Iterator

from ._case import Case, Hypothesis, with_probe


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → readings that were taken at the stand-off or at the end of the search."""
    approach, radius = case.cell.strategy.approach, case.machine.probe.tip_radius
    for way, what in ((approach.standoff, "the stand-off"), (-approach.search, "the end of the search")):
        yield Hypothesis(
            f"the readings fit if they were taken at {what} and not where the probe tripped",
            "readings",
            ", ".join(case.machine.linear),
            "record the position that the control latches at the trigger (docs/link.md)",
            machine=with_probe(case.machine, tip_radius=radius + way),
            price=0.5,
        )
