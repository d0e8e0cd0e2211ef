"""Pairs of covariates that are no places of axes: sides of the table, places on it, sides of the probe, history.

They have few functions each. What a machine does may depend on any two things that a touch knows; where such a pair is not
compared, a name that only resembles it has no rival.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..records import Array
from ..terms._shape import LEGENDRE, ONE, SIDE, TURN, WAVES, Factor, Form

FEW = 2  # functions of a covariate in a pair
COURSE = 4  # functions of time in a pair
EASES = 8  # functions of the time since an indexation: what eases does it at first
LOBES = 6  # functions of the direction around the stylus
WHOLE = 4.0  # rad: what an axis turns beyond this is a wave


def crossed(known: Mapping[str, Array], linear: Sequence[str], rotary: Sequence[str]) -> Iterator[Form]:
    """covariates (n,) by name, axes that move → shapes of pairs."""

    def line(name: str, count: int) -> Factor:
        v = known[name]
        return Factor(name, LEGENDRE, float(v.min()), float(v.max()), count)

    def slow(axis: str, count: int = FEW) -> Factor:
        return Factor(axis, TURN, -1e3, 1e3, 2 * FEW) if np.ptp(known[axis]) > WHOLE else line(axis, count)

    sides = [name for name in known if name.startswith("normal")]
    places = [name for name in known if name.startswith("place")]
    turned = [slow(axis) for axis in rotary]
    course = [line("time", COURSE)] if "time" in known else []
    for side in sides:  # an angle of an axis with a side of the machine is one with a side of the table
        for other in [*course, *(turned if side.endswith("table") else ())]:
            yield Form((line(side, FEW), other), ONE)
    for place in places:
        for other in [*course[:1], *turned]:
            few = line("time", FEW) if other.covariate == "time" else other
            yield from (Form((line(place, FEW), few), felt) for felt in ("table", *(f"table {c}" for c in "xyz")))
    if "probe direction along" in known:
        yield from (Form((line("probe direction along", FEW), other), ONE) for other in course)
    if "probe direction" in known:
        yield from (Form((Factor("probe direction", TURN, -1e3, 1e3, LOBES), other), "across") for other in course)
        for axis in (*linear, *rotary):
            if f"d{axis}" in known:
                yield Form((Factor(f"d{axis}", SIDE, -1.0, 1.0, 1), Factor("probe direction", TURN, -1e3, 1e3, LOBES)), "across")
    carried = any(_differ(known.get(f"normal {c}, table"), known.get(f"normal {c}, machine")) for c in "xyz")
    moving = [*([line("time", FEW)] if "time" in known else []), *turned] if carried else []
    for i, one in enumerate(moving):  # what the table carries
        for other in (*moving[i + 1 :], *(line(axis, FEW) for axis in linear)):
            yield from (Form((one, other), f"table {c}") for c in "xyz")
    if carried and len(rotary) == 2:  # a bearing that another axis loads
        yield Form((slow(rotary[0], 2 * FEW), slow(rotary[1], 2 * FEW)), "table")
    felt = (ONE, *(f"machine {c}" for c in "xyz"), *(f"axis {a}" for a in (*linear, *rotary)))
    for before in ("since indexation", "pause"):
        if before in known:
            for axis in (*linear, *rotary):
                for weight in felt:
                    yield Form((line(before, 1), line(axis, FEW)), weight)
    if "since indexation" in known:  # what was wound up, or clamped, eases from the side that it came from
        for axis in rotary:
            if f"d{axis}" in known:
                eases = line("since indexation", EASES)
                for weight in (f"axis {axis}", *(f"machine {c}" for c in "xyz")):
                    yield Form((Factor(f"d{axis}", SIDE, -1.0, 1.0, 1), replace(eases, kind=WAVES)), weight)
    for axis in rotary:  # the side from which an axis came, at its own places
        if f"d{axis}" in known:
            for weight in (f"axis {axis}", *(f"machine {c}" for c in "xyz")):
                yield Form((Factor(f"d{axis}", SIDE, -1.0, 1.0, 1), line(axis, FEW)), weight)


def _differ(one: Array | None, other: Array | None) -> bool:
    """covariate in two frames, None where it never changes → whether the table turned between touches."""
    return one is not other if one is None or other is None else not np.allclose(one, other, atol=1e-6)


__all__ = ["crossed"]
