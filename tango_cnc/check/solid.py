"""Artefact → the bodies that the probe must not hit.

The facets say where the table's surface is, not what is between them. Whatever lies behind every outer facet is taken to
be table: a convex body, cut off where the facets end. A facet that other facets look over (a step, a slot, a bore) is an inner one;
there the convex body says nothing and only the facet itself, the balls and the declared obstacles count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Artefact, Facet, Id, Obstacle

SIDES = 16  # of the prism around a cylinder
FACES = 150  # of a hull
THIN = 0.01  # mm: nothing is thinner
LEVEL = 0.5  # mm: as unevenly may facets of one plane be entered, or lie on the surface of an obstacle
OVERHANG = 50.0  # mm that the table may go on beyond its facets, for clearances
PATCH = 15.0  # mm around the point of a facet where there surely is table behind it


@dataclass(frozen=True)
class Body:
    """A convex body in the table frame: the points x with `normal` @ x <= `offset`; its corners."""

    normal: Array  # (f, 3) outward unit normals
    offset: Array  # (f,) mm
    corner: Array  # (v, 3) mm


@dataclass(frozen=True)
class Solid:
    """Everything on the table, table frame: the convex table body (if facets define one), obstacles, balls."""

    table: Body | None
    obstacles: tuple[Body, ...]
    centre: Array  # (b, 3) mm of balls
    radius: Array  # (b,) mm
    outer: frozenset[Id]  # facets that bound the table body

    @property
    def corners(self) -> tuple[Array, ...]:
        """→ (v, 3) mm, corners of the table, with its possible overhang, and of each obstacle."""
        return tuple(body.corner for body in (*([self.table] if self.table else []), *self.obstacles))

    @cached_property
    def corner(self) -> Array:
        """→ (v, 3) mm, corners of table and obstacles, with the table's possible overhang."""
        return np.concatenate([np.zeros((0, 3)), *self.corners])

    def top(self, direction: Array) -> Array:
        """(m, 3) unit vectors → (m,) mm, how far anything on the table reaches in that direction; −inf for an empty table."""
        corners = (self.corner @ direction.T).max(axis=0, initial=-np.inf)
        balls = (self.centre @ direction.T + self.radius[:, None]).max(axis=0, initial=-np.inf)
        return np.maximum(corners, balls)


def solid(artefact: Artefact) -> Solid:
    """artefact → the bodies on the table."""
    flat = [f for f in artefact.facets.values() if f.ball is None and not (f.surface and f.surface.inside)]
    table, outer = _table(flat) if flat else (None, np.zeros(0, dtype=bool))
    balls = list(artefact.balls.values())
    return Solid(
        table,
        tuple(body_of(o) for o in artefact.obstacles),
        np.array([b.centre for b in balls]).reshape(-1, 3),
        np.array([b.radius for b in balls]),
        frozenset(f.id for f, bounds in zip(flat, outer, strict=True) if bounds),
    )


def _table(facets: list[Facet]) -> tuple[Body, NDArray[np.bool_]]:
    point = np.array([f.point for f in facets])
    normal = np.array([f.normal for f in facets])
    offset = np.einsum("ij,ij->i", normal, point)
    beyond = np.array([(point @ n).max() for n in normal]) - offset
    outer = beyond <= LEVEL
    planes = np.column_stack([normal, offset + np.maximum(beyond, 0.0)])[outer]
    planes = planes[np.unique(np.round(planes, 6), axis=0, return_index=True)[1]]
    low, high = point.min(axis=0), point.max(axis=0)
    sides = np.vstack([np.eye(3), -np.eye(3)])
    tight = np.vstack([planes, np.column_stack([sides, np.concatenate([high, -low])])])
    loose = np.vstack([planes, np.column_stack([sides, np.concatenate([high + OVERHANG, OVERHANG - low])])])
    return Body(tight[:, :3], tight[:, 3], _corners(loose)), outer


def grown(table: Body, by: float) -> Array:
    """table, mm → (v, 3) mm, its corners where it goes on so far beyond its facets."""
    beyond = np.concatenate([np.zeros(len(table.offset) - 6), np.full(6, by)])  # the box around the facets stands last
    return _corners(np.column_stack([table.normal, table.offset + beyond]))


def _corners(planes: Array) -> Array:
    """(f, 4) normal and offset → (v, 3) corners of the bounded body."""
    return _worked_out(np.ascontiguousarray(planes, dtype=float).tobytes())


@lru_cache(maxsize=32)
def _worked_out(data: bytes) -> Array:
    """Planes as bytes → corners. One table is asked for by plan, check and read-back of every part, and takes 20 ms."""
    from scipy.optimize import linprog  # slow to load; who imports a plan's records need not wait for it
    from scipy.spatial import HalfspaceIntersection

    planes = np.frombuffer(data).reshape(-1, 4)
    inside = linprog([0, 0, 0, -1], np.column_stack([planes[:, :3], np.ones(len(planes))]), planes[:, 3], bounds=(None, None)).x
    half = np.column_stack([planes[:, :3], -planes[:, 3]])
    corners: Array = HalfspaceIntersection(half, inside[:3]).intersections
    corners.setflags(write=False)
    return corners


def _hull(points: Array) -> Body:
    """(n, 3) mm → their convex hull; of a round one a body with fewer faces around it, a little larger and never smaller."""
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    hull = ConvexHull(points)
    planes = np.unique(np.round(hull.equations, 9), axis=0)
    corner = points[hull.vertices]
    if len(planes) > FACES:
        turn = np.arange(FACES - 6) * np.pi * (3 - np.sqrt(5))  # a spiral: directions evenly spread over the sphere
        height = np.linspace(1, -1, FACES - 6)
        across = np.sqrt(1 - height**2)
        normal = np.vstack([np.column_stack([across * np.cos(turn), across * np.sin(turn), height]), np.eye(3), -np.eye(3)])
        planes = np.column_stack([normal, -(corner @ normal.T).max(axis=0)])
        corner = HalfspaceIntersection(planes, points[hull.vertices].mean(axis=0)).intersections
    return Body(planes[:, :3], -planes[:, 3], corner)


def body_of(obstacle: Obstacle) -> Body:
    """obstacle → the convex body in the frame it is stated in; a cylinder is a prism around it."""
    if obstacle.points is not None:
        return _hull(np.array(obstacle.points))
    if obstacle.kind == "box":
        low, high = np.minimum(obstacle.low, obstacle.high), np.maximum(obstacle.low, obstacle.high)  # type: ignore[arg-type]
        high = np.maximum(high, low + THIN)
        normal = np.vstack([np.eye(3), -np.eye(3)])
        corner = np.array(
            [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        )
        return Body(normal, np.concatenate([high, -low]), corner)
    assert obstacle.base is not None and obstacle.axis is not None and obstacle.radius is not None and obstacle.height is not None
    axis, base = np.array(obstacle.axis), np.array(obstacle.base)
    around = ring(axis, SIDES)
    normal = np.vstack([around, axis, -axis])
    offset = np.concatenate([around @ base + obstacle.radius, [axis @ base + obstacle.height, -axis @ base]])
    foot = base + obstacle.radius * rim(axis, SIDES, 0.5)
    return Body(normal, offset, np.vstack([foot, foot + obstacle.height * axis]))


def ring(axis: Array, count: int, first: float = 0.0) -> Array:
    """unit vector, how many, of their steps by how many the first is turned → (count, 3) unit vectors at right angles to it."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, math.tau, count, endpoint=False) + first * math.tau / count
    return np.asarray(np.column_stack([np.cos(angle), np.sin(angle)]) @ np.array([across, np.cross(axis, across)]))


def rim(axis: Array, count: int, first: float = 0.0) -> Array:
    """unit vector, how many, as in `ring` → (count, 3) corners around a circle of radius 1: between them it touches the sides."""
    return ring(axis, count, first) / math.cos(math.pi / count)
