"""At one indexation a rotary axis was elsewhere than the readings say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from ...texts import say
from ...touches import from_readings
from ._case import Case, Hypothesis

WORST = 3  # indexations that are looked at


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the indexations that fit worst, each rotary axis and the spindle in turn."""
    number = from_readings(case.machine, case.artefact, case.readings).indexation
    if number.max(initial=0) < 2:
        return
    loss = np.bincount(number, np.log1p((case.stated.gaps / 0.01) ** 2)) / np.maximum(np.bincount(number), 1)
    for index in np.argsort(-loss)[:WORST]:
        touches = tuple(int(t) for t in case.readings.touch[number == index])
        for name in (*case.machine.rotary, "S"):
            yield Hypothesis("", "readings", name, "", free=[f"E_zero_{name}@{index}"], touches=touches, price=8.0,
                             words=partial(_words, name, int(index), touches),
                             least={f"E_zero_{name}@{index}": math.radians(0.002)})  # fmt: skip


def _words(name: str, index: int, touches: tuple[int, ...], values: Mapping[str, float]) -> tuple[str, str]:
    off = math.degrees(values[f"E_zero_{name}@{index}"])
    return (
        say(
            "mistake.indexation.readings_fit_was_from_where", name=name, off=f"{off:+.4f}", touches=touches[0], touches2=touches[-1]
        ),
        say("mistake.indexation.see_whether_was_clamped_whether"),
    )
