"""A few touches are wrong by themselves: a chip, a slip in a number, somebody at the machine."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis

WRONG = 0.05  # mm
PRICE = 5.0  # of each touch: a mistake that explains several at once is dearer than none of them


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the readings without the touches that do not fit, where they are few."""
    wrong = np.abs(case.stated.gaps) + np.maximum(case.stated.beside - 1.0, 0.0) > max(WRONG, 30 * case.machine.probe.repeatability)
    if not wrong.any() or wrong.mean() > 0.2:
        return
    touches = tuple(int(t) for t in case.readings.touch[wrong])
    first = ", ".join(map(str, touches[:8]))
    listed = first if len(touches) <= 8 else say("mistake.single_touches.more", first=first, count=len(touches) - 8)
    yield Hypothesis(
        say(f"mistake.single_touches.without_{'many' if len(touches) > 1 else 'one'}", listed=listed),
        "readings",
        "touch",
        say("mistake.single_touches.look_for_chips_there_for"),
        readings=case.readings.rows(~wrong),
        touches=touches,
        price=1.0 + PRICE * len(touches),
    )
