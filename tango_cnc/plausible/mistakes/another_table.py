"""The readings belong to another table, or to another file of its facets: each facet is somewhere else along its normal."""

from __future__ import annotations

from collections.abc import Iterator

from ...texts import say
from ._case import Case, Hypothesis

PRICE = 2.0  # of each facet: as many numbers of their own explain much
FEWEST = 4  # facets


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the facets wherever the touches put them; none where balls are touched too, whose places say more."""
    facets = [f for f in dict.fromkeys(case.readings.facet) if case.artefact.facets[f].ball is None]
    if len(facets) < FEWEST or any(case.artefact.facets[f].ball is not None for f in case.readings.facet):
        return
    free = [f"EZf{f}" for f in facets]
    yield Hypothesis(
        say("mistake.another_table.every_facet_elsewhere", count=len(facets)),
        "artefact",
        "facets",
        say("mistake.another_table.take_its_file"),
        free=free,
        price=PRICE * len(facets),
        least=dict.fromkeys(free, case.artefact.tolerances.facet),
    )
