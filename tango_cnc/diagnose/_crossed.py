"""Pairs of covariates that are no places of axes: sides of the table, places on it, sides of the probe, history.

They have few functions each. What a machine does may depend on any two things that a touch knows; where such a pair is not
compared, a name that only resembles it has no rival.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..records import Array
from ..terms._shape import ONE, WAVES, Factor, Form
from ._ground import Ground, around, side

FEW = 2  # functions of a covariate in a pair
COURSE = 4  # functions of time in a pair
EASES = 8  # functions of the time since an indexation: what eases does it at first
LOBES = 6  # functions of the direction around the stylus


def crossed(g: Ground) -> Iterator[Form]:
    """ground → shapes of pairs."""
    turned = [g.slow(axis, FEW, 2 * FEW) for axis in g.rotary]
    course = [g.line("time", COURSE)] if "time" in g.known else []
    yield from _of_sides(g, turned, course)
    yield from _of_places(g, turned, course)
    yield from _of_the_probe(g, course)
    yield from _carried(g, turned)
    yield from _since(g)
    yield from _from_a_side(g)


def _of_sides(g: Ground, turned: Sequence[Factor], course: Sequence[Factor]) -> Iterator[Form]:
    """→ sides of machine and table; an angle of an axis with a side of the machine is one with a side of the table."""
    for face in (name for name in g.known if name.startswith("normal")):
        for other in [*course, *(turned if face.endswith("table") else ())]:
            yield Form((g.line(face, FEW), other), ONE)


def _of_places(g: Ground, turned: Sequence[Factor], course: Sequence[Factor]) -> Iterator[Form]:
    """→ places on the table, with time and angles."""
    for place in (name for name in g.known if name.startswith("place")):
        for other in [*(replace(x, count=FEW) for x in course), *turned]:
            yield from (Form((g.line(place, FEW), other), felt) for felt in ("table", *_table()))


def _of_the_probe(g: Ground, course: Sequence[Factor]) -> Iterator[Form]:
    """→ sides of the probe, with time and the side from which an axis came."""
    if "probe direction along" in g.known:
        yield from (Form((g.line("probe direction along", FEW), other), ONE) for other in course)
    if "probe direction" in g.known:
        lobes = around("probe direction", LOBES)
        yield from (Form((lobes, other), "across") for other in course)
        yield from (Form((came, lobes), "across") for _, came in _came(g, g.axes))


def _carried(g: Ground, turned: Sequence[Factor]) -> Iterator[Form]:
    """→ what the table carries; a bearing that another axis loads. Nothing where no axis turns the table."""
    if not any(_differ(g.known.get(f"normal {c}, table"), g.known.get(f"normal {c}, machine")) for c in "xyz"):
        return
    moving = [*([g.line("time", FEW)] if "time" in g.known else []), *turned]
    for i, one in enumerate(moving):
        for other in (*moving[i + 1 :], *(g.line(axis, FEW) for axis in g.linear)):
            yield from (Form((one, other), felt) for felt in _table())
    if len(g.rotary) == 2:
        one, other = (g.slow(axis, 2 * FEW, 2 * FEW) for axis in g.rotary)
        yield Form((one, other), "table")


def _since(g: Ground) -> Iterator[Form]:
    """→ what was wound up, or clamped: it eases with the time since an indexation or a pause."""
    for before in ("since indexation", "pause"):
        if before in g.known:
            yield from (Form((g.line(before, 1), g.line(axis, FEW)), felt) for axis in g.axes for felt in g.felt)
    if "since indexation" in g.known:  # from the side that it came from
        eases = g.line("since indexation", EASES, WAVES)
        for axis, came in _came(g, g.rotary):
            yield from (Form((came, eases), felt) for felt in (f"axis {axis}", *g.directions))


def _from_a_side(g: Ground) -> Iterator[Form]:
    """→ the side from which a rotary axis came, at its own places."""
    for axis, came in _came(g, g.rotary):
        yield from (Form((came, g.line(axis, FEW)), felt) for felt in (f"axis {axis}", *g.directions))


def _came(g: Ground, axes: Iterable[str]) -> Iterator[tuple[str, Factor]]:
    """axes → those that came from both sides, with their sides."""
    yield from ((axis, side(f"d{axis}")) for axis in axes if f"d{axis}" in g.known)


def _table() -> Iterator[str]:
    """→ how a touch may feel what moves the table along an axis of its own."""
    return (f"table {c}" for c in "xyz")


def _differ(one: Array | None, other: Array | None) -> bool:
    """covariate in two frames, None where it never changes → whether the table turned between touches."""
    return one is not other if one is None or other is None else not np.allclose(one, other, atol=1e-6)


__all__ = ["crossed"]
