"""The scale bar has another length, or a ball another radius, than artefact.yaml says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...texts import say
from ._case import Case, Hypothesis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a bar of another length, then each ball with another radius."""
    bar = case.artefact.scale_bar
    if bar is not None:
        touched = {case.artefact.facets[f].ball for f in case.readings.facet}
        if set(bar.balls) <= touched:
            yield Hypothesis(
                say("mistake.scale_bar.readings_fit_scale_bar_has"),
                "artefact",
                "scale_bar.length",
                say("mistake.scale_bar.compare_with_certificate_bar_see"),
                free=["bar"],
            )
    for key, ball in case.artefact.balls.items():
        if any(case.artefact.facets[f].ball == key for f in case.readings.facet):
            yield Hypothesis("", "artefact", f"balls.{key}.radius", "", free=[f"ballradius@{key}"], price=2.0,
                             words=partial(_words, key, ball.radius), least={f"ballradius@{key}": 0.05})  # fmt: skip


def _words(key: str, radius: float, values: Mapping[str, float]) -> tuple[str, str]:
    found = radius + values[f"ballradius@{key}"]
    return say("mistake.scale_bar.readings_fit_ball_has_radius", key=key, found=f"{found:.3f}"), say(
        "mistake.scale_bar.write_radius_measure", found=f"{found:.3f}"
    )
