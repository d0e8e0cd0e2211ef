"""The shortest safe way between two touches of one indexation: up along the tool, straight over, down along the tool.

Seen along the tool, a travel sweeps a strip; what has to be known is how high the table reaches under that strip. A part of the
probe is a cylinder that goes on upwards as far as anything matters, so it keeps its margin from a convex body when its lower end
stays above the highest point of the body within the strip, the strip being wider than the part by the margin. That point is a
corner of the body, or where an edge of it enters the strip, or where a face of it stands above a corner of the strip: all are
looked at, which makes the result a proof. A slanted travel is the same question about a sheared body.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..check import Solid
from ..check.bodies import TRAVEL
from ..records import Array, Probe

MARGIN = TRAVEL  # mm between the probe and everything on the table on its way between touches of one indexation
DROP = 5.0  # mm that every touch is approached down the tool at least: an axis' last motion has the same sense at all of them
CHUNK = 1024  # travels looked at at once, so that memory does not grow with their number
LEVEL = 1e-9  # sine of the angle at which a face counts as upright


@dataclass(frozen=True)
class Travels:
    """n travels in the table frame: tip centres (mm) at the stand-offs that they lead from and to, direction to the spindle."""

    start: Array  # (n, 3)
    end: Array  # (n, 3)
    spindle: Array  # (n, 3)


@dataclass(frozen=True)
class _Hull:
    """A convex body: corners, edges as pairs of corners, faces."""

    corner: Array  # (v, 3)
    edge: Array  # (e, 2) rows of `corner`
    normal: Array  # (f, 3)
    offset: Array  # (f,)


@dataclass(frozen=True)
class _Strip:
    """Travels seen along the tool: unit vectors along, across and up, where they begin, how long they are, mm per mm they rise."""

    frame: Array  # (n, 3, 3) rows along, across, up
    start: Array  # (n, 3)
    length: Array  # (n,)
    slope: Array  # (n,)


class Roof:
    """What stands on a table, seen from a probe that travels above it."""

    def __init__(self, solid: Solid, probe: Probe, margin: float = MARGIN) -> None:
        """bodies on the table, probe, mm to keep from them."""
        self._hulls = [_hull(corners) for corners in solid.corners]
        self._balls = list(zip(solid.centre, solid.radius, strict=True))
        self._parts = [(low, radius + margin, margin) for low, radius in parts(probe)]

    def lifts(self, travels: Travels, most: Array) -> tuple[Array, Array]:
        """n travels, (n,) highest lift at either end → (n,), (n,) mm to go up from the one stand-off and to come down to the other.

        The smaller sum of two: the travel keeps its slant, or it is level. Neither goes higher than `most` allows, mm of height.
        """
        low, high = (np.einsum("ij,ij->i", p, travels.spindle) for p in (travels.start, travels.end))
        slanted, level = (np.empty(len(low)) for _ in range(2))
        for begin in range(0, len(low), CHUNK):
            rows = slice(begin, begin + CHUNK)
            for found, rise in ((slanted, high[rows] - low[rows]), (level, np.zeros(len(low[rows])))):
                strip = _strip(travels.start[rows], travels.end[rows], travels.spindle[rows], rise)
                found[rows] = self._height(strip)
        up = np.maximum(slanted - low, DROP)
        height = np.minimum(np.maximum(level, np.maximum(low, high) + DROP), most)
        keeps = (2 * up < 2 * height - low - high) & (np.maximum(low, high) + up <= most)
        return np.where(keeps, up, height - low), np.where(keeps, up, height - high)

    def _height(self, strip: _Strip) -> Array:
        """→ (n,) least height of the tip centre where the travels begin; −inf where nothing is under them."""
        height = np.full(len(strip.length), -np.inf)
        for low, wide, margin in self._parts:
            for hull in self._hulls:
                height = np.maximum(height, _highest(hull, strip, wide) - low + margin)
            for centre, radius in self._balls:
                height = np.maximum(height, _ball_height(centre, float(radius), strip, wide) - low + margin)
        return height


def parts(probe: Probe) -> Iterator[tuple[float, float]]:
    """probe → (mm above the tip centre where it begins, radius mm) of every part; each goes on up to what carries the machine."""
    yield -probe.tip_radius, max(probe.tip_radius, probe.stylus_radius)
    yield max(probe.length - probe.body_length, 0.0), probe.body_radius
    yield probe.length, max(probe.nose_radius, probe.body_radius)


def _hull(corner: Array) -> _Hull:
    from scipy.spatial import ConvexHull  # slow to load; who imports a plan's records need not wait for it

    found = ConvexHull(corner)
    pairs = np.sort(np.vstack([found.simplices[:, [i, j]] for i, j in ((0, 1), (1, 2), (0, 2))]), axis=1)
    planes = np.unique(np.round(found.equations, 9), axis=0)
    return _Hull(corner, np.unique(pairs, axis=0), planes[:, :3], -planes[:, 3])


def _strip(start: Array, end: Array, spindle: Array, rise: Array) -> _Strip:
    way = end - start
    way = way - np.einsum("ij,ij->i", way, spindle)[:, None] * spindle
    length = np.linalg.norm(way, axis=1)
    other = np.cross(spindle, np.eye(3)[np.argmin(np.abs(spindle), axis=1)])  # a travel of no length may have any direction
    other /= np.linalg.norm(other, axis=1)[:, None]
    along = np.where(length[:, None] > 1e-9, way / np.maximum(length, 1e-9)[:, None], other)
    frame = np.stack([along, np.cross(spindle, along), spindle], axis=1)
    return _Strip(frame, start, length, np.where(length > 1e-9, rise / np.maximum(length, 1e-9), 0.0))


def _sheared(strip: _Strip, points: Array) -> tuple[Array, Array, Array]:
    """(v, 3) → (n, v) each: mm along, across, and how high a level travel from the same start would have to be."""
    seen = np.einsum("nij,vj->inv", strip.frame, points)
    begin = np.einsum("nij,nj->in", strip.frame, strip.start)
    along, across = seen[0] - begin[0][:, None], seen[1] - begin[1][:, None]
    return along, across, seen[2] - strip.slope[:, None] * along


def _highest(hull: _Hull, strip: _Strip, wide: float) -> Array:
    """→ (n,) mm, the highest of the body within `wide` of the strips, sheared; −inf where it is beside them."""
    along, across, up = _sheared(strip, hull.corner)
    bounds = ((along, -wide, strip.length[:, None] + wide), (across, -wide, wide))
    first, last = hull.edge.T
    enter, leave = np.zeros((len(up), len(first))), np.ones((len(up), len(first)))
    for value, low, high in bounds:
        begin, run = value[:, first], value[:, last] - value[:, first]
        still = np.abs(run) < 1e-12
        within = still & (begin >= low) & (begin <= high)
        with np.errstate(divide="ignore", invalid="ignore"):
            one, two = (low - begin) / run, (high - begin) / run
        enter = np.maximum(enter, np.where(still, np.where(within, 0.0, np.inf), np.minimum(one, two)))
        leave = np.minimum(leave, np.where(still, np.where(within, 1.0, -np.inf), np.maximum(one, two)))
    foot, rise = up[:, first], up[:, last] - up[:, first]
    met = enter <= leave
    with np.errstate(invalid="ignore"):
        ends = np.maximum(foot + enter * rise, foot + leave * rise)
    edges = np.where(met, ends, -np.inf).max(axis=1)
    return np.maximum(edges, _above_corners(hull, strip, wide)) + np.abs(strip.slope) * wide


def _above_corners(hull: _Hull, strip: _Strip, wide: float) -> Array:
    """→ (n,) mm, the highest of the body right above a corner of the strips, sheared; −inf where it is beside them all."""
    along, across, up = (strip.frame[:, i] for i in range(3))
    lean = up @ hull.normal.T  # (n, f)
    base = strip.start - np.einsum("ij,ij->i", strip.start, up)[:, None] * up
    highest = np.full(len(lean), -np.inf)
    for ahead in (-wide, strip.length + wide):
        for aside in (-wide, wide):
            foot = base + np.broadcast_to(ahead, strip.length.shape)[:, None] * along + aside * across
            room = hull.offset - foot @ hull.normal.T
            with np.errstate(divide="ignore", invalid="ignore"):
                at = room / lean
            top = np.where(lean > LEVEL, at, np.inf).min(axis=1)
            bottom = np.where(lean < -LEVEL, at, -np.inf).max(axis=1)
            beside = ((np.abs(lean) <= LEVEL) & (room < 0)).any(axis=1)
            highest = np.maximum(highest, np.where(beside | (bottom > top), -np.inf, top - strip.slope * ahead))
    return highest


def _ball_height(centre: Array, radius: float, strip: _Strip, wide: float) -> Array:
    """→ (n,) mm, the highest of the ball within `wide` of the strips, sheared (its top, if any of it is there); else −inf."""
    along, across, up = (value[:, 0] for value in _sheared(strip, centre[None]))
    ahead = np.maximum(np.maximum(-along, along - strip.length), 0.0)
    away = np.maximum(np.hypot(ahead, across) - wide, 0.0)
    with np.errstate(invalid="ignore"):
        cap = np.sqrt(radius**2 - away**2)
    return np.where(away < radius, up + cap + np.abs(strip.slope) * (wide + radius), -np.inf)
