"""The scale bar has another length, or a ball or all balls another radius, than artefact.yaml says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...texts import say
from ._case import Case, Hypothesis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a bar of another length, then all balls, and each ball, with another radius."""
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
    balls = {
        key: b for key, b in case.artefact.balls.items() if any(case.artefact.facets[f].ball == key for f in case.readings.facet)
    }
    if len(balls) > 1:
        names = [f"ballradius@{key}" for key in balls]
        yield Hypothesis("", "artefact", "balls", "", free=names, price=2.5,
                         words=partial(_all, {key: b.radius for key, b in balls.items()}), least=dict.fromkeys(names, 0.05))  # fmt: skip
    for key, ball in balls.items():
        yield Hypothesis("", "artefact", f"balls.{key}.radius", "", free=[f"ballradius@{key}"], price=2.0,
                             words=partial(_words, key, ball.radius), least={f"ballradius@{key}": 0.05})  # fmt: skip


def _words(key: str, radius: float, values: Mapping[str, float]) -> tuple[str, str]:
    found = radius + values[f"ballradius@{key}"]
    return say("mistake.scale_bar.readings_fit_ball_has_radius", key=key, found=f"{found:.3f}"), say(
        "mistake.scale_bar.write_radius_measure", found=f"{found:.3f}"
    )


def _all(radii: Mapping[str, float], values: Mapping[str, float]) -> tuple[str, str]:
    found = ", ".join(f"{key}: {radius + values[f'ballradius@{key}']:.3f}" for key, radius in radii.items())
    return say("mistake.scale_bar.all_balls", found=found), say("mistake.scale_bar.measure_all")
