"""Every shape that is compared: each covariate as a touch may feel it, and pairs of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..kinematics import Slot
from ..terms._shape import CYCLE, EVEN, LEGENDRE, ONE, SIDE, WAVES, Factor, Form, values
from ..touches import Touches
from ._crossed import crossed
from ._ground import HALF, OFTEN, Ground, around, moves, side

FAST, SLOW = 14, 4  # functions of a shape of one covariate, and of each one of two
STEEP = (6, 10)  # functions of time, for what grows ever faster towards the end
CYCLES = (*np.arange(1.5, 6, 0.15), *np.arange(6, 12, 0.25))  # over the test, of what repeats in time
PLAIN = 1  # function of each covariate of a pair that is a product; two beside a side from which an axis came
CURVED = 2  # functions of each covariate of a pair that bends: four of each follow more, and pay for it
JOINTS = 12  # places of a linear axis, among the touched ones, beyond which another axis may stand otherwise
APART = ("probe", "normal", "path", "place")  # covariates that have shapes of their own below


def forms(touches: Touches) -> Iterator[Form]:
    """touches → every shape that is compared: each covariate as it may be felt, and pairs of them."""
    known = {name: v for name, v in values(touches).items() if not name.startswith("facet ") and moves(touches, name, v)}
    g = Ground(known, touches.machine)
    for name in known:
        if not name.startswith(APART):
            yield from _of_one(g, name, touches)
    yield from _rests(g)
    yield from _paths(g)
    yield from _probe(g)
    yield from _sides(g)
    yield from _pairs(g)
    yield from _joints(g)
    yield from _lost_motion(g)
    yield from _faces(g, touches)
    yield from crossed(g)


def _of_one(g: Ground, name: str, touches: Touches) -> Iterator[Form]:
    """ground, covariate → its shapes, as each way to feel it has them."""
    turns = name in g.rotary
    for weight in (*g.felt, "machine"):
        yield from _single(g, name, weight)
    if name == "time" or turns:
        yield from _single(g, name, "table")
    if name == "time":
        yield from _cycles(g)
    if g.rotary and (name == "time" or turns):
        yield from (f for c in "xyz" for f in _single(g, name, f"table {c}"))
    if name in g.axes:
        for axis in g.axes:
            for i, c in enumerate("ABC"):
                if Slot(axis, "intra", 3 + i) in touches.seen.slots and (name == axis or name in g.linear):
                    yield from _single(g, name, f"tilt {c} of {axis}")


def _single(g: Ground, name: str, weight: str) -> Iterator[Form]:
    """ground, covariate, how it is felt → shapes of it alone."""
    if name[0] == "d":
        yield Form((side(name),), weight)
        return
    few = len(np.unique(np.round(g.known[name], 6)))
    if name not in g.linear:  # a straight line; what a place does in proportion is a scale, or square
        yield Form((g.line(name, PLAIN),), weight)
    if few > 3:
        yield Form((g.line(name, 3),), weight)
    if name == "time" and weight == ONE:  # a probe that fails ever faster: a pair must not follow it better than time alone
        yield from (Form((g.line(name, count),), weight) for count in STEEP)
    yield Form((g.line(name, min(FAST, few - 1), WAVES),), weight)
    if name in g.machine.rotary and np.ptp(g.known[name]) > HALF:
        yield Form((around(name, 8),), weight)


def _cycles(g: Ground) -> Iterator[Form]:
    """ground → what repeats in time."""
    for cycles in CYCLES:
        for weight in ("machine", "table") if g.rotary else ("machine",):
            yield Form((replace(g.line("time", 10, CYCLE), cycles=float(cycles)),), weight)


def _rests(g: Ground) -> Iterator[Form]:
    """ground → beyond an angle something rests on another pad: a knock to a plan that goes there once."""
    for name in g.rotary:
        for beyond in g.beyond(name):
            yield from (Form((beyond,), weight) for weight in ("machine", "table", f"axis {name}"))


def _paths(g: Ground) -> Iterator[Form]:
    """ground → what follows the way of the probe to a touch."""
    for name in (p for p in g.known if p.startswith("path")):
        for weight in (*g.felt, "machine", "table"):
            yield from (Form((g.line(name, count),), weight) for count in (1, 3))


def _probe(g: Ground) -> Iterator[Form]:
    """ground → what follows the direction in which the stylus is bent."""
    if "probe direction" in g.known:
        yield from (Form((around("probe direction", count),), "across") for count in (6, 12))
    if "probe direction along" in g.known:
        yield Form((g.line("probe direction along", 4),), ONE)
        yield Form((g.line("probe direction along", 2),), "across")


def _sides(g: Ground) -> Iterator[Form]:
    """ground → what follows the direction of the touched face in the machine."""
    sides = [name for name in g.known if name.startswith("normal") and name.endswith("machine")]
    for i, one in enumerate(sides):
        yield Form((g.line(one, SLOW),), ONE)
        yield from (Form((g.line(one, SLOW), g.line(other, SLOW)), ONE) for other in sides[i + 1 :])


def _places(g: Ground) -> list[str]:
    """ground → covariates of which pairs are compared: axes, time, spindle, temperatures."""
    return [name for name in g.known if name in ("time", "S", *g.axes) or name.startswith("T_")]


def _pairs(g: Ground) -> Iterator[Form]:
    """ground → pairs of places, time and temperatures: as they bend, and as plain products."""
    places = _places(g)
    for i, one in enumerate(places):
        for other in places[i + 1 :]:
            pair = (g.slow(one, SLOW, SLOW), g.slow(other, SLOW, SLOW))
            for weight in g.felt:
                yield Form(pair, weight)
                yield from (Form((g.line(one, n), g.line(other, n)), weight) for n in (PLAIN, CURVED))


def _joints(g: Ground) -> Iterator[Form]:
    """ground → what a place does abruptly, such as a joint of the bed, may grow with another one."""
    for one in g.linear:
        for other in (p for p in _places(g) if p not in (one, "S")):
            plain = g.line(other, PLAIN)
            for weight in (f"axis {one}", *g.directions):
                yield Form((g.line(one, FAST, WAVES), plain), weight)
                if other in g.linear and weight != f"axis {one}":
                    yield from (Form((beyond, plain), weight) for beyond in g.beyond(one, JOINTS))


def _lost_motion(g: Ground) -> Iterator[Form]:
    """ground → the side from which an axis came, times a place elsewhere."""
    for name in (d for d in g.known if d[0] == "d"):
        for other in _places(g):
            if other == name[1:] and other not in g.linear:
                continue
            for weight in (f"axis {name[1:]}", *g.directions):
                yield Form((side(name), g.slow(other, SLOW, SLOW)), weight)
                yield Form((side(name), g.line(other, 2 * PLAIN)), weight)
                if other in g.rotary and g.known[other].min() < 0 < g.known[other].max():  # under a load that tilts
                    most = float(np.abs(g.known[other]).max())
                    yield Form((side(name), Factor(other, EVEN, 0.0, most, CURVED)), weight)


def _faces(g: Ground, touches: Touches) -> Iterator[Form]:
    """ground, touches → a face that is warm, or wears: its offset is known already, and no facet once touched tells a course."""
    if "time" not in g.known:
        return
    for facet, often in Counter(touches.facet).items():
        if often >= OFTEN:
            own = Factor(f"facet {facet}", SIDE, 0.0, 1.0, 1)
            yield from (Form((own, g.line("time", count, LEGENDRE)), ONE) for count in (PLAIN, SLOW))
