"""The tip radius is another: a diameter given for it, another stylus, or readings from which it has been taken off already."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...records import Machine
from ._case import Case, Hypothesis

NEAR = 0.05  # mm


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a tip of any radius."""
    yield Hypothesis(
        "the readings fit if the tip has another radius",
        "machine",
        "probe.tip_radius",
        "",
        free=["radius"],
        words=partial(_words, case.machine),
        price=1.5,
        least={"radius": case.artefact.tolerances.common},
    )


def _words(machine: Machine, values: Mapping[str, float]) -> tuple[str, str]:
    given = machine.probe.tip_radius
    radius = given + values["radius"]
    if abs(radius) < NEAR:
        return (
            "the readings fit if they are contact points: the tip radius has been taken off already",
            "record the tip centre, without radius compensation",
        )
    why = ": the diameter is given for the radius" if abs(2 * radius - given) < NEAR else ""
    why = ": the radius is given as a part of it" if abs(radius - 2 * given) < NEAR else why
    return f"the readings fit if the tip has a radius of {radius:.2f} mm{why}", f"write tip_radius: {radius:.2f}, and measure it"
