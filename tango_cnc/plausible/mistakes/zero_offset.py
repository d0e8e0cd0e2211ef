"""An axis counts from another zero: work coordinates, a tool length still active, a rotary axis that was referenced elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from ...records import Machine
from ...texts import joined, say
from ._case import Case, Hypothesis, moved_column

NEAR = 1.0  # mm
LEAST = math.radians(0.1)
ALONG = 0.99  # cosine between an axis and the spindle


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis, and all linear axes together, from another zero."""
    machine, readings = case.machine, case.readings
    least = machine.tolerances.location
    for name in machine.linear:
        yield Hypothesis("", "readings", name, "", free=[f"E_zero_{name}"], words=partial(_linear, machine), price=3.0,
                         least={f"E_zero_{name}": least})  # fmt: skip
    yield from _tool_length(case)
    names = [f"E_zero_{name}" for name in machine.linear]
    yield Hypothesis("", "readings", ", ".join(machine.linear), "", free=names, words=partial(_linear, machine), price=5.5,
                     least=dict.fromkeys(names, least))  # fmt: skip
    for name in machine.rotary:
        column = machine.column(name)
        for turn in (0.0, 90.0, 180.0, 270.0):
            yield Hypothesis(
                "",
                "readings",
                name,
                "",
                readings=moved_column(readings, column, readings.position[:, column] + math.radians(turn)),
                free=[f"E_zero_{name}"],
                words=partial(_rotary, name, turn),
                price=2.5,
                least={} if turn else {f"E_zero_{name}": LEAST},
            )


def _tool_length(case: Case) -> Iterator[Hypothesis]:
    """The axis along the spindle is off by just the length of the probe: no table is shifted by that."""
    machine, readings = case.machine, case.readings
    spindle, length = np.array(machine.spindle.direction), machine.probe.length
    for name in machine.linear:
        along = abs(float(np.array(machine.axis(name).direction) @ spindle))
        for off in (length, -length) if along > ALONG else ():
            text, change = _linear(machine, {f"E_zero_{name}": off})
            column = machine.column(name)
            counted = moved_column(readings, column, readings.position[:, column] + off)
            yield Hypothesis(text, "readings", name, change, readings=counted, price=1.0)


def _linear(machine: Machine, values: Mapping[str, float]) -> tuple[str, str]:
    own = {name: values[f"E_zero_{name}"] for name in machine.linear if f"E_zero_{name}" in values}
    said = joined(", ", (say("mistake.zero_offset.mm", name=name, value=f"{value:.2f}") for name, value in own.items()))
    length = machine.probe.length
    if any(abs(abs(value) - length) < NEAR for value in own.values()):
        why = say("mistake.zero_offset.tool_length_still_active_record")
    else:
        why = say("mistake.zero_offset.record_machine_coordinates_no_work")
    return say("mistake.zero_offset.readings_fit_they_count_from", said=said), why


def _rotary(name: str, turn: float, values: Mapping[str, float]) -> tuple[str, str]:
    value = (turn + math.degrees(values[f"E_zero_{name}"]) + 180) % 360 - 180
    return (
        say("mistake.zero_offset.readings_fit_counts_from_another", name=name, value=f"{value:.3f}"),
        say("mistake.zero_offset.record_machine_coordinates_see_whether", name=name),
    )
