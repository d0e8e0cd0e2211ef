"""LocatingWays above a table that may stand elsewhere than its file says: in which order, and how high above what is on it.

Everything on the table may be some millimeters away in any direction. A way between two touches is as high as the highest of it
that can come under this one way, and a margin more; before the first touch and after the last the probe is at the clear level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import check, kinematics
from ..records import Array, Artefact, Cell, Facet, Id, InputError, Plan, Strategy, Touch
from .guarded import refuse
from .places import Rows, Scene, scene
from .travel import MARGIN, Roof, Travels


def farthest(plan: Plan | Cell) -> float:
    """plan → mm from the origin of the table to the farthest corner of what is on it: the lever of a table that is turned."""
    solid = scene(plan.machine, plan.artefact, plan.strategy).solid
    corners = np.linalg.norm(solid.corner, axis=1).max(initial=0.0)
    return float(max(corners, (np.linalg.norm(solid.centre, axis=1) + solid.radius).max(initial=0.0)))


def swollen(artefact: Artefact, by: float) -> Artefact:
    """artefact, mm → one whose facets and balls reach so much farther out: its plan keeps off the true one wherever that is.

    Its touches are not those of the true one. Obstacles stay as they are declared.
    """
    facets = {name: _outward(facet, by) for name, facet in artefact.facets.items()}
    balls = {name: replace(ball, radius=ball.radius + by) for name, ball in artefact.balls.items()}
    return replace(artefact, facets=facets, balls=balls)


def _outward(facet: Facet, by: float) -> Facet:
    x, y, z = (float(v) for v in np.add(facet.point, by * np.array(facet.normal)))
    if facet.surface is None:
        return replace(facet, point=(x, y, z))
    radius = facet.surface.radius - by if facet.surface.inside else facet.surface.radius + by
    return replace(facet, point=(x, y, z), surface=replace(facet.surface, radius=max(radius, 1.0)))


def within_travels(cell: Cell) -> Strategy:
    """cell → its strategy without touches that need an axis beyond its travel, and indexations of which none is left."""
    shared, kept = scene(cell.machine, cell.artefact, cell.strategy), []
    for number, indexation in enumerate(cell.strategy.indexations):
        rows = np.array([shared.facet.index(name) for name in indexation.facets], dtype=np.int32)
        at = np.full(len(rows), number, dtype=np.int32)
        (standoff, up), normal = shared.standoff(rows, at), shared.normal[rows]
        height = shared.top[at] + MARGIN + cell.machine.probe.tip_radius - np.einsum("ij,ij->i", standoff, up)
        tips = np.array([standoff, shared.tip[rows] - cell.strategy.approach.search * normal, standoff + height[:, None] * up])
        beyond = check.outside(cell.machine, shared.axes(at, tips).reshape(-1, len(cell.machine.names))).reshape(
            len(tips), len(rows), -1
        )
        reached = np.flatnonzero(~beyond.any(axis=(0, 2)))
        names = tuple(indexation.facets[row] for row in reached.tolist())
        kept += [replace(indexation, facets=names)] if names else []
    return replace(cell.strategy, indexations=tuple(kept))


@dataclass(frozen=True)
class LocatingWays:
    """Every way between two touches of one indexation, and those from the clear level: mm that the probe goes."""

    facets: tuple[Id, ...]  # n
    between: Array  # (n, n)
    ends: Array  # (n,) from the clear level down, or up to there

    def shortest(self, facets: Sequence[Id]) -> tuple[Id, ...]:
        """facets → the same in the order of the shortest way past all of them."""
        rows = [self.facets.index(name) for name in facets]
        return tuple(facets[row] for row in _shortest(self.between[np.ix_(rows, rows)], self.ends[rows]))

    def length(self, order: Sequence[Id]) -> float:
        """facets in their order → mm from the clear level past all of them and back there."""
        rows = [self.facets.index(name) for name in order]
        return float(self.ends[rows[0]] + self.between[rows[:-1], rows[1:]].sum() + self.ends[rows[-1]])

    def inserted(self, order: Sequence[Id], other: Id) -> tuple[Id, ...]:
        """facets in their order, one more → the same with it where the way grows least."""
        return min(((*order[:at], other, *order[at:]) for at in range(len(order) + 1)), key=self.length)


def ways(plan: Plan, away: float) -> LocatingWays:
    """plan of one indexation, mm by which what is on the table may be elsewhere → the ways between its touches, each with each."""
    shared, facet, at = _rows(plan)
    here, up = shared.standoff(facet, at)
    level = _levels(shared, plan.touches)
    first, second = (each.ravel() for each in np.indices((len(here), len(here))))
    rise, fall = _lifts(shared, away, here[first], here[second], up[first], np.minimum(level[first], level[second]))
    aside = here[second] + fall[:, None] * up[first] - here[first] - rise[:, None] * up[first]
    between = (rise + fall + np.linalg.norm(aside, axis=1)).reshape(len(here), len(here))
    return LocatingWays(tuple(touch.facet for touch in plan.touches), between, level - np.einsum("ij,ij->i", here, up))


def raised(plan: Plan, by: float) -> Plan:
    """plan, mm → the same with its clear level, and every way, so much higher. Raises InputError where the travels end."""
    first = plan.touches[0]
    linear = [plan.machine.column(name) for name in plan.machine.linear]
    up = np.zeros(len(plan.machine.names))
    up[linear] = (np.array(first.over) - np.array(first.standoff))[linear]
    up /= np.linalg.norm(up)
    room = by
    for touch in plan.touches:
        for column in linear:
            travel = plan.machine.axes[column].travel
            if travel is not None and abs(up[column]) > 1e-9:
                end = travel[1] if up[column] > 0 else travel[0]
                room = min(room, (end - touch.over[column]) / up[column])
    if room < by:
        raise InputError(
            f"{plan.machine.name}: {room:.0f} mm of way are left above the clear level; allowed: {by:.0f} mm, as the table may be "
            "that much higher than its file says"
        )
    higher = tuple(
        replace(touch, over=tuple(float(v) for v in np.array(touch.over) + by * up), enter=None, leave=None)
        for touch in plan.touches
    )
    return replace(plan, touches=higher, turns=plan.turns)


def lowered(plan: Plan, away: float) -> Plan:
    """plan of one indexation, mm as of `ways` → the same, its ways between touches as low as is safe.

    They stay at the clear level where something of the machine is in a lower one. Raises InputError where it is in these too.
    """
    shared, facet, at = _rows(plan)
    here, up = shared.standoff(facet, at)
    level = _levels(shared, plan.touches)
    rise, fall = _lifts(shared, away, here[:-1], here[1:], up[:-1], np.minimum(level[:-1], level[1:]))
    leave = shared.axes(at[:-1], (here[:-1] + rise[:, None] * up[:-1])[None])[0]
    enter = shared.axes(at[1:], (here[1:] + fall[:, None] * up[1:])[None])[0]
    touches = list(plan.touches)
    for row, (one, other) in enumerate(zip(leave.tolist(), enter.tolist(), strict=True)):
        touches[row] = replace(touches[row], leave=tuple(one))
        touches[row + 1] = replace(touches[row + 1], enter=tuple(other))
    found = replace(plan, touches=tuple(touches))
    try:
        refuse(found)
    except InputError:
        refuse(plan)
        return plan
    return found


def _rows(plan: Plan) -> tuple[Scene, Rows, Rows]:
    """plan → what its touches have in common, (n,) facets, (n,) indexations."""
    shared = scene(plan.machine, plan.artefact, plan.strategy)
    names = {name: row for row, name in enumerate(shared.facet)}
    return shared, np.array([names[touch.facet] for touch in plan.touches]), np.array([t.indexation for t in plan.touches])


def _levels(shared: Scene, touches: Sequence[Touch]) -> Array:
    """→ (n,) mm, how high along the tool the tip is at the clear level above each touch."""
    tip = kinematics.tip(shared.chain, np.array([touch.over for touch in touches]))
    found: Array = np.einsum("ij,ij->i", tip, shared.up[[touch.indexation for touch in touches]])
    return found


def _lifts(shared: Scene, away: float, start: Array, end: Array, up: Array, most: Array) -> tuple[Array, Array]:
    """(n, 3) stand-offs from and to, directions to the spindle, (n,) mm at most → (n,), (n,) mm to go up, to come down."""
    return Roof(shared.solid, shared.machine.probe, MARGIN + away).lifts(Travels(start, end, up), most)


def _shortest(way: Array, ends: Array) -> list[int]:
    """(n, n) mm from each touch to each, (n,) mm from the clear level to each and back → the order of the shortest whole way.

    By Held and Karp: the shortest way through every set of touches to each that it may end with.
    """
    count = len(ends)
    least = np.full((1 << count, count), np.inf)
    came = np.zeros((1 << count, count), dtype=int)
    least[1 << np.arange(count), np.arange(count)] = ends
    for seen in range(1, 1 << count):
        to = [row for row in range(count) if not seen >> row & 1]
        if not to or not np.isfinite(least[seen]).any():
            continue
        over = least[seen][:, None] + way[:, to]
        best = over.argmin(axis=0)
        for column, row in enumerate(to):
            then = seen | 1 << row
            if over[best[column], column] < least[then, row]:
                least[then, row], came[then, row] = over[best[column], column], best[column]
    seen = (1 << count) - 1
    found = [int((least[seen] + ends).argmin())]
    while seen != 1 << found[-1]:
        last = found[-1]
        found.append(int(came[seen, last]))
        seen ^= 1 << last
    return found
