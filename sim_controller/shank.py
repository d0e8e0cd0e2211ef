"""Whether stylus, probe body or spindle nose run into something while the ball is still free.

The ball has a search of its own (`search.py`). What carries it is three cylinders along the tool. They are looked at between
points of the move that a straight line joins: where one plane stands between a cylinder and a body at both ends, nothing happens
on the way. Elsewhere the move is cut into steps of STEP, and each is asked exactly whether the two have a point in common.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Array, Artefact, Machine

from . import solids
from .solids import Hull, Table
from .world import TrueMachine, place

STEP = 0.5  # mm that any point of the probe moves between two looks
SKIN = 0.5  # mm: the cylinders that are looked at are thinner by this, since no table is as its drawing
TURN = np.radians(1.0)  # the most of a turn that counts as a straight line: at 700 mm it bulges by 0.03 mm
NOSE = 300.0  # mm of spindle above the probe
RIM = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
STYLUS = "stylus"  # the part whose contact the probe feels

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Shank:
    """The parts of the probe as cylinders from `low` to `high` mm above the tip centre, and what they may run into."""

    names: tuple[str, ...]
    low: Array  # (p,)
    high: Array  # (p,)
    radius: Array  # (p,)
    bodies: tuple[tuple[str, Hull, Table | None], ...]  # the table knows where it is open
    balls: tuple[tuple[str, Array, float], ...]


@dataclass(frozen=True)
class Entry:
    """Where on a move (s from 0 to 1) which part enters what."""

    s: float
    part: str
    body: str


def shank(machine: Machine, artefact: Artefact, table: Table | None) -> Shank:
    """machine, artefact, table → what is looked at."""
    probe = machine.probe
    stem = max(probe.length - probe.body_length, 0.0)
    parts = (
        (STYLUS, 0.0, stem, probe.stylus_radius),
        ("probe body", stem, probe.length, probe.body_radius),
        ("spindle nose", probe.length, probe.length + NOSE, max(probe.body_radius, probe.nose_radius)),
    )
    names, low, high, radius = zip(*(part for part in parts if part[2] - part[1] > 2 * SKIN), strict=True)
    solid = [(f"obstacle {i}", hull) for i, hull in enumerate(solids.obstacles(artefact), 1)]
    solid += [(f"facet {name}", hull) for name, hull in (table.patches if table else ())]
    bodies = [(name, hull, None) for name, hull in solid]
    return Shank(
        names,
        np.array(low),
        np.array(high),
        np.array(radius),
        (*bodies, *([("the table", table.hull, table)] if table else [])),
        tuple((f"ball {name}", np.array(ball.centre), ball.radius) for name, ball in artefact.balls.items()),
    )


def first_entry(
    k: Shank, true: TrueMachine, start: Array, end: Array, direction: Array, after: float = 0.0, until: float = 1.0
) -> Entry | None:
    """ends (k,) mm rad and directions of a move, s from which and up to which → the first entry of anything, or None."""
    turning = [true.machine.column(name) for name in (*true.machine.rotary, "S")]
    turn = np.abs((end - start)[turning]).max() * (until - after)
    s = np.linspace(after, until, 2 + int(turn / TURN))
    positions = start + s[:, None] * (end - start)
    placed = place(true, positions, np.broadcast_to(direction, positions.shape))
    spindle = true.tool[-1].frame[0, :3, :3].T @ np.array(true.machine.spindle.direction)
    up = np.einsum("nji,nj->ni", placed.table, placed.spindle @ spindle)
    found = [enters(k, hull, table, name, s, placed.tip, up) for name, hull, table in k.bodies]
    found += [_meets(k, centre, radius, name, s, placed.tip, up) for name, centre, radius in k.balls]
    return min((entry for entry in found if entry is not None), key=lambda entry: entry.s, default=None)


def enters(k: Shank, hull: Hull, table: Table | None, name: str, s: Array, tip: Array, up: Array) -> Entry | None:
    """shank, convex body, (n,) s, tips, directions to the spindle → the first entry."""
    apart = _beyond_faces(k, hull, tip, up)
    free = ((apart[:-1] > 0) & (apart[1:] > 0)).any(axis=-1)
    if free.all():
        return None
    top = (up[:-1] @ hull.corner.T).max(axis=1)[:, None]
    free |= (_least(k, tip[:-1], up[:-1], up[:-1]) > top) & (_least(k, tip[1:], up[1:], up[:-1]) > top)
    for i in np.flatnonzero(~free.all(axis=1)):
        for at, tips, ups in _steps(k, s[i : i + 2], tip[i : i + 2], up[i : i + 2], ~free[i]):
            near = ~free[i] & ~(_beyond_faces(k, hull, tips, ups) > 0).any(axis=-1)
            if table is not None:
                near &= (table.inward(tips) <= 0)[:, None]
            rows, parts = np.nonzero(near)
            hit = _common(k, hull, tips[rows], ups[rows], parts)
            if hit.any():
                first = int(np.argmax(hit))
                return Entry(float(at[rows[first]]), k.names[parts[first]], name)
    return None


def _meets(k: Shank, centre: Array, radius: float, name: str, s: Array, tip: Array, up: Array) -> Entry | None:
    """shank, a ball, (n,) s, tips, directions to the spindle → the first entry."""
    gap = _to_point(k, centre, tip, up) - radius
    way = np.linalg.norm(np.diff(tip, axis=0), axis=1)[:, None] + k.high * np.linalg.norm(np.diff(up, axis=0), axis=1)[:, None]
    free = gap[:-1] + gap[1:] > way
    for i in np.flatnonzero(~free.all(axis=1)):
        for at, tips, ups in _steps(k, s[i : i + 2], tip[i : i + 2], up[i : i + 2], ~free[i]):
            hit = (_to_point(k, centre, tips, ups) - radius < -SKIN) & ~free[i]
            if hit.any():
                row, part = np.argwhere(hit)[0]
                return Entry(float(at[row]), k.names[part], name)
    return None


def _steps(k: Shank, s: Array, tip: Array, up: Array, parts: Mask) -> Iterator[tuple[Array, Array, Array]]:
    """two ends → (s, tips, directions) of looks at most STEP apart, some at a time."""
    way = np.linalg.norm(tip[1] - tip[0]) + k.high[parts].max() * np.linalg.norm(up[1] - up[0])
    inner = np.linspace(0.0, 1.0, 2 + int(way / STEP))
    for begin in range(0, len(inner), 64):
        t = inner[begin : begin + 64, None]
        yield s[0] + t[:, 0] * (s[1] - s[0]), tip[0] + t * (tip[1] - tip[0]), up[0] + t * (up[1] - up[0])


def _beyond_faces(k: Shank, hull: Hull, tip: Array, up: Array) -> Array:
    """→ (n, p, f) mm that each part is beyond the plane of each face."""
    lean, height = up @ hull.normal.T, tip @ hull.normal.T - hull.offset
    wide = np.sqrt(np.maximum(1 - lean**2, 0.0))[:, None, :]
    ends = np.minimum(k.low[:, None] * lean[:, None, :], k.high[:, None] * lean[:, None, :])
    return np.asarray(height[:, None, :] + ends - k.radius[:, None] * wide)


def _least(k: Shank, tip: Array, up: Array, direction: Array) -> Array:
    """→ (n, p) mm, how far down each part reaches along a direction each."""
    lean, height = (np.einsum("ij,ij->i", v, direction)[:, None] for v in (up, tip))
    return np.asarray(height + np.minimum(k.low * lean, k.high * lean) - k.radius * np.sqrt(np.maximum(1 - lean**2, 0.0)))


def _to_point(k: Shank, point: Array, tip: Array, up: Array) -> Array:
    """→ (n, p) mm from each part to a point, negative within."""
    away = point - tip
    along = np.einsum("ij,ij->i", away, up)
    around = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - along**2, 0.0))[:, None]
    beside, beyond = around - k.radius, np.maximum(k.low - along[:, None], along[:, None] - k.high)
    return np.asarray(np.hypot(np.maximum(beside, 0), np.maximum(beyond, 0)) + np.minimum(np.maximum(beside, beyond), 0))


def _common(k: Shank, hull: Hull, tip: Array, up: Array, part: NDArray[np.int64]) -> Mask:
    """(n, 3) tips and directions, (n,) parts → (n,) whether part and body have a point in common, deeper than SKIN.

    They have when an edge of the body passes through the cylinder, or the cylinder's axis or an end of it through the body.
    """
    low, high = k.low[part] + SKIN, k.high[part] - SKIN
    radius = np.maximum(k.radius[part] - SKIN, k.radius[part] / 2)
    return _edges(hull, tip, up, low, high, radius) | _axis(hull, tip, up, low, high) | _ends(hull, tip, up, low, high, radius)


def _edges(hull: Hull, tip: Array, up: Array, low: Array, high: Array, radius: Array) -> Mask:
    begin, run = hull.edge[:, 0] - tip[:, None, :], hull.edge[:, 1] - hull.edge[:, 0]  # (n, e, 3), (e, 3)
    height, rise = np.einsum("nej,nj->ne", begin, up), up @ run.T
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (low[:, None] - height) / rise, (high[:, None] - height) / rise
    within = (height >= low[:, None]) & (height <= high[:, None])
    level = np.abs(rise) < 1e-9
    first = np.where(level, np.where(within, 0.0, 2.0), np.maximum(np.minimum(one, two), 0.0))
    last = np.where(level, 1.0, np.minimum(np.maximum(one, two), 1.0))
    across = begin - height[..., None] * up[:, None, :]
    aside = run - rise[..., None] * up[:, None, :]
    square = np.maximum(np.einsum("nej,nej->ne", aside, aside), 1e-12)
    nearest = np.clip(-np.einsum("nej,nej->ne", across, aside) / square, first, np.maximum(first, last))
    distance = np.linalg.norm(across + nearest[..., None] * aside, axis=-1)
    return np.asarray(((first <= last) & (distance < radius[:, None])).any(axis=1))


def _axis(hull: Hull, tip: Array, up: Array, low: Array, high: Array) -> Mask:
    begin = tip + low[:, None] * up
    height, slope = begin @ hull.normal.T - hull.offset, (high - low)[:, None] * (up @ hull.normal.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -height / slope
    enter = np.where(slope < 0, at, -np.inf).max(axis=1)
    leave = np.where(slope > 0, at, np.inf).min(axis=1)
    beside = ((slope == 0) & (height > 0)).any(axis=1)
    return np.asarray(~beside & (np.maximum(enter, 0.0) < np.minimum(leave, 1.0)))


def _ends(hull: Hull, tip: Array, up: Array, low: Array, high: Array, radius: Array) -> Mask:
    one = np.cross(up, np.eye(3)[np.argmin(np.abs(up), axis=1)])
    one /= np.linalg.norm(one, axis=1)[:, None]
    ring = np.cos(RIM)[:, None] * one[:, None, :] + np.sin(RIM)[:, None] * np.cross(up, one)[:, None, :]
    found = np.zeros(len(tip), dtype=bool)
    for end in (low, high):
        rim = (tip + end[:, None] * up)[:, None, :] + radius[:, None, None] * ring
        found |= (rim @ hull.normal.T < hull.offset).all(axis=-1).any(axis=1)
    return found
