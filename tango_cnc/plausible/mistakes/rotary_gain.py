"""A rotary axis turns further than its readings say, in proportion: a gear ratio, an encoder with another count, another unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from ...texts import joined, say
from ._case import Case, Hypothesis, moved_column, with_positions

RATIOS = (2.0, 0.5, 0.9, 1 / 0.9, 10.0, 0.1)  # 0.9: 400 gon are a turn
GON = 0.9


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each rotary axis that turned, in the ratios that people mix up, then in any ratio near 1."""
    machine, readings = case.machine, case.readings
    turning = [name for name in machine.rotary if np.ptp(readings.position[:, machine.column(name)])]
    if len(turning) > 1:
        for ratio in (GON, 1 / GON):
            position = np.array(readings.position)
            position[:, [machine.column(name) for name in turning]] *= ratio
            names = joined(say("mistake.unit.and"), turning)
            yield Hypothesis(
                say(f"mistake.rotary_gain.{'gon' if ratio == GON else 'taken_for_gon'}_many", names=names),
                "readings",
                ", ".join(turning),
                say("mistake.rotary_gain.see_units", names=names, ratio=f"{ratio:g}"),
                readings=with_positions(readings, position),
                price=1.5,
            )
    for name in machine.rotary:
        column = machine.column(name)
        angle = readings.position[:, column]
        if np.ptp(angle) == 0:
            continue
        for ratio in RATIOS:
            key = "mistake.rotary_gain.gon" if ratio == GON else "mistake.rotary_gain.ratio"
            yield Hypothesis(
                say(key, name=name, ratio=f"{ratio:g}"),
                "readings",
                name,
                say("mistake.rotary_gain.see_unit", name=name, ratio=f"{ratio:g}"),
                readings=moved_column(readings, column, angle * ratio),
                price=1.5,
            )
        least = machine.tolerances.motion_angle / 2 / float(np.abs(angle).max())
        yield Hypothesis("", "readings", name, "", free=[f"E{name}{name}1"], words=partial(_words, name), price=3.0,
                         least={f"E{name}{name}1": least})  # fmt: skip


def _words(name: str, values: Mapping[str, float]) -> tuple[str, str]:
    gain = values[f"E{name}{name}1"]
    turn = math.tau * gain
    return (
        say("mistake.rotary_gain.gain", name=name, ratio=f"{1 + gain:.6g}", turn=f"{math.degrees(turn):+.4f}"),
        say("mistake.rotary_gain.see_gear", name=name),
    )
