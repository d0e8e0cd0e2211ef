"""A name whose size changes: the pattern of a cause that grows along an axis, with time, or with the side of arrival.

A cause of the catalogue has one size. A pattern that grows, such as the waves of a screw that is bent, only resembles it. So
each name competes with itself, with a size that is a slow function of everything else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from .. import terms as families
from ..records import Array
from ..terms._shape import values
from ..touches import Touches
from ._candidates import Candidate, candidate
from ._catalogue import Chosen
from ._rows import Rows
from ._smooth import HALF, Kernel, moves, scaled

SLOW = 2  # functions of what the size depends on
FOLLOWS = {  # of a cause whose setting does not tell
    "backlash": "d{axis}",
    "rotary_backlash": "d{axis}",
    "first_touch": "first touch of an indexation",
    "indexation_seating": "indexation",
    "move_length_memory": "way of {axis}",
    "probe_hysteresis": "previous touch",
    "swapped_facets": "facet",
    "trigger_latency": "feed",
}


def changing(means: Rows, names: Sequence[Chosen], slow: Mapping[str, Array]) -> list[Kernel]:
    """rows, names that were found, slow functions → shapes: each name with a size that depends on one more thing.

    Two of one cause that differ in a number only, such as waves of nearly one period, may be one between them that grows.
    """
    found = []
    alone: list[tuple[Candidate, Candidate | None]] = [(c.candidate, c.candidate) for c in names if not c.candidate.learned]
    alone += [(middle, None) for one, other in combinations([c for c, _ in alone], 2) for middle in _between(means, one, other)]
    for like, name in alone:
        own = candidate(means.whole, like.cause, like.setting).columns
        own = own / np.maximum(np.sqrt(np.mean(own**2, axis=0)), 1e-300)
        for by, functions in slow.items():
            if by == like.setting.get("axis") and by in means.whole.machine.rotary:
                continue  # two orders of one axis are two names
            columns = (own[:, :, None] * functions[:, None, :]).reshape(len(own), -1)
            covariate = dict.fromkeys((over(like), by))
            setting = {"name": name, "like": like.cause, "covariate": " × ".join(covariate)}
            found.append(scaled(Kernel(None, "shape", means.of(columns), setting=setting)))
    return found


def _between(means: Rows, one: Candidate, other: Candidate) -> Iterator[Candidate]:
    """two names → the cause between them, where they differ in one positive number only."""
    a, b = one.setting, other.setting
    differ = [key for key in a if a[key] != b.get(key)]
    if one.cause != other.cause or a.keys() != b.keys() or len(differ) != 1:
        return
    low, high = a[differ[0]], b[differ[0]]
    if isinstance(low, float) and isinstance(high, float) and min(low, high) > 0:
        yield candidate(means.whole, one.cause, {**a, differ[0]: float(np.sqrt(low * high))})


def over(c: Candidate) -> str:
    """name → the covariate that it follows itself."""
    setting, drawn = c.setting, families.causes()[c.cause].over
    if c.cause in FOLLOWS:
        return FOLLOWS[c.cause].format(**{"axis": "", **setting})
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
            # A load may be as large to either side: the second order follows it.
            found[name] = np.column_stack([one, np.cos(v), np.sin(v), np.cos(2 * v) / 2, np.sin(2 * v) / 2])
        else:
            found[name] = np.polynomial.legendre.legvander(2 * (v - v.min()) / np.ptp(v) - 1, SLOW)
    return found


__all__ = ["changing", "over", "slow"]
