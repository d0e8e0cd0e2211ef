"""The line of a rotary axis is elsewhere than machine.yaml says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from ...kinematics import axis_frame
from ...records import Axis
from ...texts import say
from ._case import Case, Hypothesis

ROUND = 0.05  # mm: less than this of a coordinate is no mistake


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each rotary axis, its line anywhere."""
    for name in case.machine.rotary:
        axis = case.machine.axis(name)
        free = [f"E_point_{name}{c}" for c in "XYZ"]
        yield Hypothesis(
            say("mistake.pivot.readings_fit_line_elsewhere", name=name),
            "machine",
            f"axes.{name}.point",
            "",
            free=free,
            words=partial(_words, axis),
            price=5.0,
            least=dict.fromkeys(free, case.machine.tolerances.location),
        )
        for i, c in enumerate("XYZ"):
            yield Hypothesis(
                say("mistake.pivot.readings_fit_line_elsewhere_2", name=name, lower=c.lower()),
                "machine",
                f"axes.{name}.point",
                "",
                free=[f"E_point_{name}{c}"],
                words=partial(_words, axis),
                price=3.0 - 0.01 * i,
                least={f"E_point_{name}{c}": case.machine.tolerances.location},
            )


def _words(axis: Axis, values: Mapping[str, float]) -> tuple[str, str]:
    frame = axis_frame(axis.name, axis.direction)[0]
    own = np.array([values.get(f"E_point_{axis.name}{c}", 0.0) for c in "XYZ"])
    shift = own if frame is None else frame.T @ own
    shift -= (shift @ np.array(axis.direction)) * np.array(axis.direction)
    shift = np.where(np.abs(shift) < ROUND, 0.0, shift)
    x, y, z = np.array(axis.point) + shift + 0.0
    return (
        say("mistake.pivot.readings_fit_line_mm_from", name=axis.name, norm=f"{np.linalg.norm(shift):.2f}"),
        say("mistake.pivot.point_at_measure_take_from", name=axis.name, x=f"{x:.2f}", y=f"{y:.2f}", z=f"{z:.2f}"),
    )
