"""The scale bar has another length, or a ball another radius, than artefact.yaml says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ._case import Case, Hypothesis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a bar of another length, then each ball with another radius."""
    bar = case.artefact.scale_bar
    if bar is not None:
        touched = {case.artefact.facets[f].ball for f in case.readings.facet}
        if set(bar.balls) <= touched:
            yield Hypothesis(
                "the readings fit if the scale bar has another length",
                "artefact",
                "scale_bar.length",
                "compare it with the certificate of the bar, and see which bar is on the table",
                free=["bar"],
            )
    for key, ball in case.artefact.balls.items():
        if any(case.artefact.facets[f].ball == key for f in case.readings.facet):
            yield Hypothesis("", "artefact", f"balls.{key}.radius", "", free=[f"ballradius@{key}"], price=2.0,
                             words=partial(_words, key, ball.radius), least={f"ballradius@{key}": 0.05})  # fmt: skip


def _words(key: str, radius: float, values: Mapping[str, float]) -> tuple[str, str]:
    found = radius + values[f"ballradius@{key}"]
    return f"the readings fit if ball {key} has a radius of {found:.3f} mm", f"write radius: {found:.3f}, and measure it"
