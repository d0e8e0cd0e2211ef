"""What stands on other bodies of the machine than the table (yoke, bed, column …), and whether anything runs into it.

Each body has the pose that the chain of its own axes gives it, errors included. The probe is looked at from the body of an obstacle
like from the table: the ball by its distance from the solid, the rest by `shank.py`. Two solids are looked at along the move: where
a face of one of them has the other beyond it at both ends of a piece, they are apart in it; else the piece is cut, and the last
pieces are asked for a point that both have in common (a linear program).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tango_cnc.records import Array, Artefact, Machine

from . import solids, transforms
from .shank import SKIN, STYLUS, TURN, Entry, Shank, enters
from .solids import Hull, Table
from .world import TrueMachine, body

LONG = 20.0  # mm between two looks at first
SHORT = 0.5  # mm between the last ones
PIECES = 8


@dataclass(frozen=True)
class Solid:
    """A solid on a body: its name, its hull (machine frame, zero pose), what moves it; a ball is a corner with a radius."""

    name: str
    hull: Hull
    moved_by: tuple[str, ...]
    radius: float = 0.0


@dataclass(frozen=True)
class Bystanders:
    """Obstacles of the machine, what may run into them, and the probe as each of them meets it."""

    obstacles: tuple[Solid, ...]
    pairs: tuple[tuple[Solid, Solid], ...]
    probes: tuple[Shank | None, ...]  # for each obstacle; None: nothing moves between it and the probe
    tip_radius: float


def bystanders(machine: Machine, artefact: Artefact, table: Table | None, shank: Shank) -> Bystanders:
    """machine, what is on its table, the table, the probe → what is looked at; nothing where the machine has no obstacle."""
    hulls = solids.hulls(machine.obstacles)
    own = [
        Solid(f"obstacle {i} of the machine{o.name}", hull, machine.carriers(o.on or "f"))
        for i, (o, hull) in enumerate(zip(machine.obstacles, hulls, strict=True), 1)
    ]
    if not own:
        return Bystanders((), (), (), 0.0)
    work = machine.workpiece_branch
    stands = [Solid("the table", table.hull, work)] if table else []
    stands += [Solid(f"obstacle {i}", hull, work) for i, hull in enumerate(solids.obstacles(artefact), 1)]
    empty = np.zeros((0, 3))
    stands += [
        Solid(f"ball {b.id}", Hull(empty, np.zeros(0), np.array([b.centre]), np.zeros((0, 2, 3))), work, b.radius)
        for b in artefact.balls.values()
    ]
    pairs = [(one, other) for other in own for one in stands] + list(combinations(own, 2))
    return Bystanders(
        tuple(own),
        tuple((one, other) for one, other in pairs if one.moved_by != other.moved_by),
        tuple(_probe(machine, shank, obstacle) for obstacle in own),
        machine.probe.tip_radius,
    )


def _probe(machine: Machine, shank: Shank, obstacle: Solid) -> Shank | None:
    """→ the parts of the probe that an obstacle may meet: the nose comes out of what carries it, and is within that."""
    if obstacle.moved_by == machine.tool_branch[:-1]:
        return None
    if not obstacle.moved_by or obstacle.moved_by[0] not in machine.tool_branch:
        return shank
    kept = [i for i, name in enumerate(shank.names) if name != "spindle nose"]
    names = tuple(shank.names[i] for i in kept)
    return replace(shank, names=names, low=shank.low[kept], high=shank.high[kept], radius=shank.radius[kept])


def first_strike(
    k: Bystanders, true: TrueMachine, start: Array, end: Array, direction: Array, after: float, until: float
) -> Entry | None:
    """ends (k,) mm rad and directions of a move, s from which and up to which → the first that anything runs into, or None."""
    if not k.obstacles:
        return None
    found = [*_probed(k, true, start, end, direction, after, until), *_solid(k, true, start, end, direction, after, until)]
    return min(found, key=lambda entry: entry.s, default=None)


def _nodes(true: TrueMachine, start: Array, end: Array, after: float, until: float) -> Array:
    change = np.abs(end - start) * (until - after)
    turning = [true.machine.column(name) for name in (*true.machine.rotary, "S")]
    linear = [true.machine.column(name) for name in true.machine.linear]
    return np.linspace(after, until, 2 + int(max(change[turning].max() / TURN, np.linalg.norm(change[linear]) / LONG)))


def _poses(true: TrueMachine, moved_by: tuple[str, ...], start: Array, end: Array, direction: Array, s: Array) -> Array:
    positions = start + s[:, None] * (end - start)
    return body(true, moved_by, positions, np.broadcast_to(direction, positions.shape))


def _probed(
    k: Bystanders, true: TrueMachine, start: Array, end: Array, direction: Array, after: float, until: float
) -> Iterator[Entry]:
    s = _nodes(true, start, end, after, until)
    spindle = _poses(true, true.machine.tool_branch, start, end, direction, s)
    tip = spindle @ np.append(true.stylus_tip_out, 1.0)
    up = spindle[:, :3, :3] @ np.array(true.machine.spindle.direction)
    for obstacle, probe in zip(k.obstacles, k.probes, strict=True):
        if probe is None:
            continue
        seen = transforms.inverse(_poses(true, obstacle.moved_by, start, end, direction, s))
        tips = np.einsum("nij,nj->ni", seen, tip)[:, :3]
        ups = np.einsum("nij,nj->ni", seen[:, :3, :3], up)
        if (entry := enters(probe, obstacle.hull, None, obstacle.name, s, tips, ups)) is not None:
            yield entry
        if (at := _ball(obstacle.hull, k.tip_radius, s, tips)) is not None:
            yield Entry(at, STYLUS, obstacle.name)


def _ball(hull: Hull, radius: float, s: Array, tip: Array) -> float | None:
    """hull, mm, (n,) s, (n, 3) tips → the first s at which the ball touches it."""
    gap = distance(hull, tip) - radius
    way = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    for i in np.flatnonzero(gap[:-1] + gap[1:] <= way):
        part = np.linspace(0.0, 1.0, 2 + int(way[i] / (SHORT / 2)))
        near = distance(hull, tip[i] + part[:, None] * (tip[i + 1] - tip[i])) <= radius
        if near.any():
            return float(s[i] + part[int(np.argmax(near))] * (s[i + 1] - s[i]))
    return None


def distance(hull: Hull, point: Array) -> Array:
    """hull, (n, 3) mm → (n,) mm from it, 0 or less within: to the face it is straight above, or to the nearest edge."""
    above = point @ hull.normal.T - hull.offset
    foot = point[:, None, :] - above[..., None] * hull.normal
    on = (np.einsum("nfi,gi->nfg", foot, hull.normal) <= hull.offset + 1e-9).all(axis=-1) & (above > 0)
    begin, run = hull.edge[:, 0], hull.edge[:, 1] - hull.edge[:, 0]
    along = np.einsum("nei,ei->ne", point[:, None, :] - begin, run) / np.maximum(np.einsum("ei,ei->e", run, run), 1e-12)
    nearest = begin + np.clip(along, 0.0, 1.0)[..., None] * run
    edge = np.linalg.norm(point[:, None, :] - nearest, axis=-1).min(axis=1)
    outside = np.minimum(np.where(on, above, np.inf).min(axis=1), edge)
    return np.asarray(np.where((above <= 0).all(axis=1), above.max(axis=1), outside))


def _solid(
    k: Bystanders, true: TrueMachine, start: Array, end: Array, direction: Array, after: float, until: float
) -> Iterator[Entry]:
    moving = {true.machine.names[i] for i in np.flatnonzero(np.abs(end - start) > 1e-9)}
    for one, other in k.pairs:
        if not moving & (set(one.moved_by) ^ set(other.moved_by)):
            continue
        if (at := _meet(one, other, true, start, end, direction, _nodes(true, start, end, after, until))) is not None:
            yield Entry(at, one.name, other.name)


def _meet(one: Solid, other: Solid, true: TrueMachine, start: Array, end: Array, direction: Array, s: Array) -> float | None:
    """two solids, a move, (n,) s → the first s at which they have a point in common."""

    def seen(at: Array) -> Array:
        """→ (n, v, 3) corners of the one as the body of the other sees them."""
        own, others = (_poses(true, solid.moved_by, start, end, direction, at) for solid in (one, other))
        relative = transforms.inverse(others) @ own
        return np.einsum("nij,vj->nvi", relative[:, :3, :3], one.hull.corner) + relative[:, None, :3, 3]

    corner = seen(s)
    reach = np.linalg.norm(one.hull.corner - one.hull.corner.mean(axis=0), axis=1).max() + one.radius
    centre = other.hull.corner.mean(axis=0)
    radius = np.linalg.norm(other.hull.corner - centre, axis=1).max()
    gap = np.linalg.norm(corner.mean(axis=1) - centre, axis=1) - reach - radius
    way = np.linalg.norm(np.diff(corner, axis=0), axis=-1).max(axis=1)
    for i in np.flatnonzero(gap[:-1] + gap[1:] <= way):
        if (at := _between(one, other, seen, s[i : i + 2])) is not None:
            return at
    return None


def _between(one: Solid, other: Solid, seen: object, ends: Array) -> float | None:
    """one piece of a move → the first s in it at which the two have a point in common."""
    corner = seen(ends)  # type: ignore[operator]
    long = np.linalg.norm(corner[1] - corner[0], axis=-1).max()
    if one.radius:
        for s in np.linspace(ends[0], ends[1], 2 + int(long / SHORT)):
            if distance(other.hull, seen(np.array([s]))[0])[0] < one.radius - SKIN:  # type: ignore[operator]
                return float(s)
        return None
    if (_beyond(one, other, corner) > 0).all(axis=0).any():
        return None
    if long > SHORT:
        inner = np.linspace(ends[0], ends[1], PIECES + 1)
        for i in range(PIECES):
            if (at := _between(one, other, seen, inner[i : i + 2])) is not None:
                return at
        return None
    return next((float(s) for s, at in zip(ends, corner, strict=True) if _common(one, other, at)), None)


def _turned(one: Solid, corner: Array) -> tuple[Array, Array]:
    """solid, (n, v, 3) its corners where it is → (n, f, 3), (n, f) its faces there."""
    base, now = one.hull.corner - one.hull.corner.mean(axis=0), corner - corner.mean(axis=1, keepdims=True)
    turn = np.einsum("nvi,vj->nij", now, base) @ np.linalg.inv(base.T @ base)
    shift = corner.mean(axis=1) - turn @ one.hull.corner.mean(axis=0)
    normal = np.einsum("nij,fj->nfi", turn, one.hull.normal)
    return normal, one.hull.offset + np.einsum("nfi,ni->nf", normal, shift)


def _beyond(one: Solid, other: Solid, corner: Array) -> Array:
    """→ (n, faces of both) mm that all of the one is beyond a face of the other."""
    normal, offset = _turned(one, corner)
    first = np.einsum("nvi,fi->nvf", corner, other.hull.normal).min(axis=1) - other.hull.offset
    second = np.einsum("nfi,vi->nvf", normal, other.hull.corner).min(axis=1) - offset
    return np.hstack([first, second])


def _common(one: Solid, other: Solid, corner: Array) -> bool:
    """→ whether the two have a point in common, deeper than SKIN."""
    from scipy.optimize import linprog  # slow to load, and few controls have two bodies that come this close

    normal, offset = (v[0] for v in _turned(one, corner[None]))
    planes, within = np.vstack([normal, other.hull.normal]), np.concatenate([offset, other.hull.offset]) - SKIN / 2
    return bool(linprog(np.zeros(3), planes, within, bounds=(None, None)).status == 0)
