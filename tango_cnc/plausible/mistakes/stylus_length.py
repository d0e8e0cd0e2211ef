"""The stylus is longer or shorter than `probe.length`: another stylus, another unit, measured to the end of its ball."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from ...kinematics import axis_frame
from ...records import Machine
from ._case import Case, Hypothesis

NEAR = 0.1  # mm


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → a stylus of any length."""
    yield Hypothesis(
        "the readings fit if the stylus has another length",
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
        why = ": the length counts to the centre of its ball, not to its end"
    for factor, unit in ((25.4, "inch"), (1000.0, "m"), (10.0, "cm")):
        if abs(length / factor - machine.probe.length) < 0.01 * machine.probe.length:
            why = f": the number is in {unit}"
    return f"the readings fit if the stylus is {length:.2f} mm long{why}", f"write length: {length:.2f}, and measure it"
