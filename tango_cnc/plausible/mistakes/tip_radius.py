"""The tip radius is another: a diameter given for it, another stylus, or readings from which it has been taken off already."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...records import Machine
from ...texts import say
from ._case import Case, Hypothesis

NEAR = 0.05  # mm
SEEN = 0.02  # mm: balls of a known radius are touched from all sides and show a tip that is off by this


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a tip of any radius."""
    balls = any(case.artefact.facets[f].ball is not None for f in case.readings.facet)
    yield Hypothesis(
        say("mistake.tip_radius.readings_fit_tip_has_another"),
        "machine",
        "probe.tip_radius",
        "",
        free=["radius"],
        words=partial(_words, case.machine),
        price=1.5,
        least={"radius": SEEN if balls else case.artefact.tolerances.common},
    )


def _words(machine: Machine, values: Mapping[str, float]) -> tuple[str, str]:
    given = machine.probe.tip_radius
    radius = given + values["radius"]
    if abs(radius) < NEAR:
        return (
            say("mistake.tip_radius.readings_fit_they_contact_points"),
            say("mistake.tip_radius.record_tip_centre_without_radius"),
        )
    why = say("mistake.tip_radius.diameter_given_for_radius") if abs(2 * radius - given) < NEAR else ""
    why = say("mistake.tip_radius.radius_given_as_part") if abs(radius - 2 * given) < NEAR else why
    return say("mistake.tip_radius.readings_fit_tip_has_radius", radius=f"{radius:.3g}", why=why), say(
        "mistake.tip_radius.write_tip_radius_measure", radius=f"{radius:.3g}"
    )
