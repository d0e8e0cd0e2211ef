"""The scale bar has another length, or a ball or all balls another radius, than artefact.yaml says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...texts import say
from ._case import Case, Hypothesis

SEEN = 0.05  # mm


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a bar of another length, then all balls, and each ball, with another radius."""
    bar, used = case.artefact.scale_bar, {case.artefact.facets[f].ball for f in case.readings.facet}
    if bar is not None and set(bar.balls) <= used:
        yield Hypothesis(
            say("mistake.scale_bar.readings_fit_scale_bar_has"),
            "artefact",
            "scale_bar.length",
            say("mistake.scale_bar.compare_with_certificate_bar_see"),
            free=["bar"],
        )
    balls = {key: ball.radius for key, ball in case.artefact.balls.items() if key in used}
    if len(balls) > 1:
        names = [f"ballradius@{key}" for key in balls]
        words, least = partial(_all, balls), dict.fromkeys(names, SEEN)
        yield Hypothesis("", "artefact", "balls", "", free=names, price=2.5, words=words, least=least)
    for key, radius in balls.items():
        name = f"ballradius@{key}"
        words, least = partial(_words, key, radius), {name: SEEN}
        yield Hypothesis("", "artefact", f"balls.{key}.radius", "", free=[name], price=2.0, words=words, least=least)


def _words(key: str, radius: float, values: Mapping[str, float]) -> tuple[str, str]:
    found = radius + values[f"ballradius@{key}"]
    return say("mistake.scale_bar.readings_fit_ball_has_radius", key=key, found=f"{found:.3f}"), say(
        "mistake.scale_bar.write_radius_measure", found=f"{found:.3f}"
    )


def _all(radii: Mapping[str, float], values: Mapping[str, float]) -> tuple[str, str]:
    found = ", ".join(f"{key}: {radius + values[f'ballradius@{key}']:.3f}" for key, radius in radii.items())
    return say("mistake.scale_bar.all_balls", found=found), say("mistake.scale_bar.measure_all")
