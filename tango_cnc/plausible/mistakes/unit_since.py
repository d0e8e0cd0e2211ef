"""From one touch on, or in one part of the run, an axis is in another unit: a program or a display was switched."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...texts import say
from ._case import Case, Hypothesis, with_positions
from ._midway import away, best_part, cost

LENGTHS = (25.4, 1 / 25.4, 1000.0, 1e-3, 10.0, 0.1, 2.0, 0.5)
ANGLES = (180 / math.pi, math.pi / 180)


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis, and all linear ones, times the factor that takes a part of the run to its facets."""
    machine, position = case.machine, case.readings.position
    before = cost(away(case, position))
    for names in (*((name,) for name in (*machine.linear, *machine.rotary)), tuple(machine.linear)):
        columns = [machine.column(name) for name in names]
        factors = np.array(ANGLES if names[0] in machine.rotary else LENGTHS)
        tried = np.repeat(position[None], len(factors), axis=0)
        tried[:, :, columns] *= factors[:, None, None]
        found = best_part((before - cost(away(case, tried))).T)
        if found is None:
            continue
        choice, part = found
        right = np.array(position)
        right[part.first : part.end] = tried[choice, part.first : part.end]
        number = case.readings.touch[part.first : part.end]
        on = part.end == len(position)
        yield Hypothesis(
            say(
                f"mistake.unit_since.{'from' if on else 'between'}",
                names=", ".join(names),
                factor=f"{1 / factors[choice]:g}",
                first=int(number[0]),
                last=int(number[-1]),
            ),
            "readings",
            ", ".join(names),
            say("mistake.unit_since.change", names=", ".join(names), factor=f"{factors[choice]:g}", first=int(number[0])),
            readings=with_positions(case.readings, right),
            touches=tuple(int(t) for t in number),
            price=6.0,
        )
