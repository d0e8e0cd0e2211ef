"""A name whose size changes: the pattern of a cause that grows along an axis, with time, or with the side of arrival.

A cause of the catalogue has one size. A pattern that grows, such as the waves of a screw that is bent, only resembles it. So
each name competes with itself, with a size that is a slow function of everything else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .. import terms as families
from ..records import Array
from ..terms._shape import values
from ..touches import Touches
from ._candidates import candidate
from ._catalogue import Chosen
from ._rows import Rows
from ._smooth import HALF, Kernel, moves, scaled

SLOW = 2  # functions of what the size depends on


def changing(means: Rows, names: Sequence[Chosen], slow: Mapping[str, Array]) -> list[Kernel]:
    """rows, names that were found, slow functions → shapes: each name with a size that depends on one more thing."""
    found = []
    for c in names:
        if c.candidate.learned:
            continue
        own = candidate(means.whole, c.candidate.cause, c.candidate.setting).columns
        own = own / np.maximum(np.sqrt(np.mean(own**2, axis=0)), 1e-300)
        for by, functions in slow.items():
            if by == c.candidate.setting.get("axis") and by in means.whole.machine.rotary:
                continue  # two orders of one axis are two names
            columns = (own[:, :, None] * functions[:, None, :]).reshape(len(own), -1)
            covariate = dict.fromkeys((over(c), by))
            setting = {"like": c.candidate.cause, "covariate": " × ".join(covariate)}
            found.append(scaled(Kernel(None, "shape", means.of(columns), setting=setting)))
    return found


def over(c: Chosen) -> str:
    """name → the covariate that it follows itself."""
    setting, drawn = c.candidate.setting, families.causes()[c.candidate.cause].over
    if drawn:
        return {"probe": "probe direction"}.get(drawn, drawn)
    place = next((str(setting[key])[-1] for key in ("axis", "by", "name") if key in setting), "time")
    return "facet" if "facet" in setting else place


def slow(touches: Touches) -> dict[str, Array]:
    """touches → covariate: 1 and slow functions of it, (n, k)."""
    found: dict[str, Array] = {}
    machine = touches.machine
    known = values(touches)
    one = np.ones(len(touches))
    for name, v in known.items():
        if name.startswith(("facet", "place", "normal", "probe")) or not moves(touches, name, v):
            continue
        if len(name) == 2 and name[0] == "d":
            found[name] = np.column_stack([one, np.sign(v)])
        elif name in machine.rotary and np.ptp(v) > HALF:
            found[name] = np.column_stack([one, np.cos(v), np.sin(v)])
        else:
            found[name] = np.polynomial.legendre.legvander(2 * (v - v.min()) / np.ptp(v) - 1, SLOW)
    return found


__all__ = ["changing", "over", "slow"]
