"""The stylus is longer or shorter than `probe.length`: another stylus, another unit, measured to the end of its ball."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...kinematics import axis_frame
from ...records import Machine
from ...texts import say
from ._case import Case, Hypothesis

NEAR = 0.1  # mm


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a stylus of any length."""
    yield Hypothesis(
        say("mistake.stylus_length.readings_fit_stylus_has_another"),
        "machine",
        "probe.length",
        "",
        free=["EZt"],
        words=partial(_words, case.machine),
        price=1.5,
        least={"EZt": case.machine.tolerances.stylus},
    )


def _words(machine: Machine, values: Mapping[str, float]) -> tuple[str, str]:
    length = machine.probe.length - axis_frame("S", machine.spindle.direction)[2] * values["EZt"]
    why = ""
    radius = machine.probe.tip_radius
    if abs(abs(length - machine.probe.length) - radius) < NEAR:
        why = say("mistake.stylus_length.length_counts_centre_its_ball")
    for factor, unit in ((25.4, "inch"), (1000.0, "m"), (10.0, "cm")):
        if abs(length / factor - machine.probe.length) < 0.01 * machine.probe.length:
            why = say("mistake.stylus_length.number", unit=unit)
    return say("mistake.stylus_length.readings_fit_stylus_mm_long", length=f"{length:.2f}", why=why), say(
        "mistake.stylus_length.write_length_measure", length=f"{length:.2f}"
    )
