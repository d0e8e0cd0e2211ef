"""Plan of a cell → a plan that touches a few facets, to see what no move in the air shows: points of rotary axes, late readings.

Theory. Where the point of a rotary axis in machine.yaml is wrong by d, the tip is elsewhere in the table frame, by a way that turns
with the axis. A facet that is elsewhere than its file says shifts all of its touches alike. So with the gap g of a touch, along
the normal of its facet,

    g = offset of the facet + Σ over the axes of S d        S: change of g for a point that is shifted by 1 mm

and d is the smallest that fits, of the directions that these touches tell. A position that is read t late is deeper by t v: the
same touches at two feeds tell t.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from .. import kinematics
from ..plan import part
from ..records import Array, InputError, Machine, Plan, Touch

PAIRS = 5  # of touches of one facet at two angles
EACH = 12  # touches of a facet that are looked at
TOLD = 0.9  # part of a direction that the touches tell
WEAK = 0.1  # of the largest singular value: less tells nothing
QUICK, FASTEST, AGAIN = 4.0, 500.0, 3  # times the feed of the plan, mm/min at most; touches made once more


@dataclass(frozen=True)
class Pivot:
    """How far the point of a rotary axis is from where machine.yaml has it, mm, and how many of two directions tell it."""

    off: float
    told: int


def touching(whole: Plan) -> Plan:
    """plan of a cell → its part with up to `PAIRS` pairs of touches of one facet, which tell most of the points of rotary axes.

    Its first touches where no facet is touched at two angles. Raises InputError for a plan without touches of facets.
    """
    numbers = _chosen(whole) or [touch.number for touch, _ in zip(whole.touches, range(AGAIN), strict=False)]
    if not numbers:
        raise InputError(f"{whole.strategy.name}: found no touch; allowed: a strategy with touches")
    return _at(part(whole, sorted(numbers)), whole.strategy.approach.feed)


def quicker(made: Plan) -> Plan:
    """plan that touches → its first touches once more at another feed: four times as fast, at most 500 mm/min, else a quarter."""
    feed = made.strategy.approach.feed
    other = min(QUICK * feed, FASTEST)
    return _at(part(made, [touch.number for touch in made.touches][:AGAIN]), other if other > 1.5 * feed else feed / QUICK)


def pivots(made: Plan, place: Mapping[int, Array]) -> dict[str, Pivot]:
    """plan, {touch: (k,) mm rad at its contact} → {rotary axis: how far its point is from where machine.yaml has it}."""
    touches = [touch for touch in made.touches if touch.number in place]
    directions = _directions(made.machine)
    if not directions or not touches:
        return {}
    at = np.array([place[touch.number] for touch in touches])
    gap, slopes = _gap(made.machine, made, touches, at), _slopes(made, touches, at)
    facets = [touch.facet for touch in touches]
    gap, slopes = (_without_offsets(values, facets) for values in (gap, slopes))
    left, sizes, right = np.linalg.svd(slopes, full_matrices=False)
    kept = sizes > max(WEAK * sizes.max(initial=0.0), 1e-3)
    d = right[kept].T @ ((left.T @ gap)[kept] / sizes[kept])
    told = np.einsum("ij,ij->j", right[kept], right[kept])
    found: dict[str, Pivot] = {}
    for name in made.machine.rotary:
        own = [i for i, (axis, _) in enumerate(directions) if axis == name]
        found[name] = Pivot(float(np.linalg.norm(d[own])), int(np.count_nonzero(told[own] > TOLD)))
    return found


def late(made: Plan, slow: Mapping[int, Array], quick: Plan, fast: Mapping[int, Array]) -> float | None:
    """two plans of the same touches with another feed, {touch: (k,) mm rad} of each → s that positions are late; None: unknown."""
    both = [touch for touch in quick.touches if touch.number in slow and touch.number in fast]
    if not both:
        return None
    gaps = [_gap(made.machine, made, both, np.array([seen[t.number] for t in both])) for seen in (slow, fast)]
    faster = (quick.strategy.approach.feed - made.strategy.approach.feed) / 60.0
    return float(np.median(gaps[0] - gaps[1])) / faster


def _at(made: Plan, feed: float) -> Plan:
    """plan, mm/min → the same with single touches at this feed."""
    return replace(made, strategy=replace(made.strategy, approach=replace(made.strategy.approach, feed=feed, find=None)))


def _directions(machine: Machine) -> list[tuple[str, Array]]:
    """→ two directions across each rotary axis: along it, its point has no meaning."""
    found = []
    for name in machine.rotary:
        along = np.array(machine.axis(name).direction)
        across = np.linalg.svd(along[None])[2][1:]
        found += [(name, way) for way in across]
    return found


def _gap(machine: Machine, made: Plan, touches: Sequence[Touch], at: Array) -> Array:
    """machine, plan, touches, (n, k) mm rad → (n,) mm of the tip centre from the plane of its facet, outwards positive."""
    normal = np.array([made.artefact.facets[touch.facet].normal for touch in touches])
    point = np.array([made.artefact.facets[touch.facet].point for touch in touches])
    gaps: Array = np.einsum("ni,ni->n", normal, kinematics.tip(kinematics.chain(machine), at) - point)
    return gaps


def _slopes(made: Plan, touches: Sequence[Touch], at: Array) -> Array:
    """→ (n, 2 axes) change of the gap when a point is 1 mm off in each of `_directions`."""
    nominal, columns = _gap(made.machine, made, touches, at), []
    for name, way in _directions(made.machine):
        x, y, z = (float(v) for v in np.array(made.machine.axis(name).point) + way)
        axes = tuple(replace(axis, point=(x, y, z)) if axis.name == name else axis for axis in made.machine.axes)
        columns.append(nominal - _gap(replace(made.machine, axes=axes), made, touches, at))
    return np.array(columns).T


def _without_offsets(values: Array, facets: Sequence[str]) -> Array:
    """(n, …), facet of each row → the same without the mean of each facet."""
    found = np.array(values, dtype=float)
    for facet in set(facets):
        rows = [i for i, name in enumerate(facets) if name == facet]
        found[rows] -= found[rows].mean(axis=0)
    return found


def _chosen(whole: Plan) -> list[int]:
    """→ numbers of the touches of up to `PAIRS` pairs of one facet, those that tell most; none where there is no pair."""
    by_facet: dict[str, list[Touch]] = {}
    for touch in whole.touches:
        same = by_facet.setdefault(touch.facet, [])
        if len(same) < EACH and whole.artefact.facets[touch.facet].ball is None:
            same.append(touch)
    touches = [touch for same in by_facet.values() for touch in same]
    if not touches or not whole.machine.rotary:
        return []
    slopes = _slopes(whole, touches, np.array([touch.contact for touch in touches]))
    row = {touch.number: i for i, touch in enumerate(touches)}
    pairs = [pair for same in by_facet.values() for pair in combinations((row[touch.number] for touch in same), 2)]
    if not pairs:
        return []
    ways = np.array([slopes[a] - slopes[b] for a, b in pairs])
    information, found = 1e-6 * np.eye(ways.shape[1]), set[int]()
    for _ in range(PAIRS):
        best = int(np.argmax(np.einsum("ni,ni->n", ways @ np.linalg.inv(information), ways)))
        information += np.outer(ways[best], ways[best])
        found |= {touches[i].number for i in pairs[best]}
    return list(found)
