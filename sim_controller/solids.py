"""What is solid on the table beside the facets themselves: convex bodies, and whether the probe's ball is in one.

Between facets there is table. It is taken to be what lies behind every flat facet, and no farther out than a facet's patch goes.
A facet that others look over (a slot, a step, a bore) says that this is not all of the truth: around such a facet and where it
faces nobody knows what is there, and nothing is, but for the patches of the other facets. Over a patch the facet decides, and not
the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Array, Artefact, Facet, Id, Obstacle

LEVEL = 1.0  # mm: so unevenly may facets of one plane lie
CONE = 0.5  # cosine of the angle from its normal within which an inner facet is open
SIDES = 12  # of a patch
ROUND = 48  # corners around a cylinder: of 100 mm radius 0.2 mm are not seen


@dataclass(frozen=True)
class Hull:
    """A convex body in the table frame: x with normal @ x <= offset. Its corners and edges."""

    normal: Array  # (f, 3)
    offset: Array  # (f,) mm
    corner: Array  # (v, 3) mm
    edge: Array  # (e, 2, 3) mm, ends


@dataclass(frozen=True)
class Table:
    """The body between the facets, the patches over which it says nothing, and the openings into it."""

    hull: Hull
    patch: Array  # (p, 3) mm, points of the facets
    extent: float  # mm, radius of the patches
    into: Array  # (i, 3) mm, points of facets that lie within the body
    facing: Array  # (i, 3) their normals
    reach: Array  # (i,) mm around each of them in which the body is open
    patches: tuple[tuple[Id, Hull], ...]  # of the other facets, when there are openings

    def gap(self, tip: Array, radius: float) -> Array:
        """(n, 3) mm, radius of the ball → (n,) mm from it to the body, positive = apart; no more than that before an edge."""
        body = (tip @ self.hull.normal.T - self.hull.offset).max(axis=1) - radius
        near = np.linalg.norm(tip[:, None, :] - self.patch, axis=-1).min(axis=1)
        return np.maximum(np.maximum(body, self.extent + radius - near), self.inward(tip))

    def inward(self, tip: Array) -> Array:
        """(n, 3) mm → (n,) mm within an opening, negative outside all of them."""
        away = tip[:, None, :] - self.into
        far, ahead = np.linalg.norm(away, axis=-1), np.einsum("nij,ij->ni", away, self.facing)
        inside = np.maximum(np.minimum(self.reach - far, ahead), (ahead - CONE * far) / 2)  # halved, it is no more than a distance
        return np.asarray(inside.max(axis=1, initial=-np.inf))


def table(facets: Sequence[Facet], point: Array, extent: float, tip_radius: float) -> Table | None:
    """facets that lie on no ball, (p, 3) mm their true points, mm → the table; None where the facets enclose nothing."""
    normal = np.array([f.normal for f in facets], dtype=float)
    outer = _outer(facets, point)
    if not outer.any():
        return None
    sides = np.vstack([np.eye(3), -np.eye(3)])
    room = np.concatenate([point.max(axis=0), -point.min(axis=0)]) + extent
    planes = np.vstack([normal[outer], sides])
    offset = np.concatenate([np.einsum("ij,ij->i", normal[outer], point[outer]), room])
    hull = _between(planes, offset)
    if hull is None:
        return None
    depth = (offset - point @ planes.T).min(axis=1)
    into = depth > LEVEL
    # How wide a slot is and how deep a bore, nobody says: as wide as a probe may need that leans by 60 deg.
    reach = 3 * (depth[into] + tip_radius) + 2 * extent
    bounding = np.flatnonzero(outer).tolist() if into.any() else []
    patches = [(facets[i].id, _patch(planes, offset, normal[i], point[i], extent)) for i in bounding]
    known = tuple((name, patch) for name, patch in patches if patch is not None)
    return Table(hull, point, extent, point[into], normal[into], reach, known)


def _outer(facets: Sequence[Facet], point: Array) -> NDArray[np.bool_]:
    """facets, (p, 3) mm → (p,) which of them bound the table: no other one looks over them."""
    bounds = np.array([not (f.surface is not None and f.surface.inside) for f in facets], dtype=bool)
    if not bounds.any():
        return bounds
    normal = np.array([f.normal for f in facets], dtype=float)
    beyond = normal @ point.T - np.einsum("ij,ij->i", normal, point)[:, None]
    return np.asarray(bounds & (beyond.max(axis=1, initial=0.0, where=bounds[None, :]) <= LEVEL))


def edges(facets: Sequence[Facet], point: Array) -> Array:
    """facets that lie on no ball, (p, 3) mm their true points → (f, 4) normal and mm of the planes beyond which is no table.

    Each lies `LEVEL` farther out than the facets do: what stands out by less is table still.
    """
    flat = _outer(facets, point) & np.array([f.surface is None for f in facets], dtype=bool)
    normal = np.array([f.normal for f, is_flat in zip(facets, flat, strict=True) if is_flat], dtype=float).reshape(-1, 3)
    return np.column_stack([normal, (normal @ point.reshape(-1, 3).T).max(axis=1, initial=-np.inf) + LEVEL])


def _patch(planes: Array, offset: Array, normal: Array, point: Array, extent: float) -> Hull | None:
    """planes of a body, normal and point of a facet of it → the body within the facet's patch."""
    one = np.linalg.svd(normal[None])[2][1]
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    sides = np.vstack([np.outer(np.cos(turn), one) + np.outer(np.sin(turn), np.cross(normal, one)), -normal])
    return _between(np.vstack([planes, sides]), np.concatenate([offset, sides @ point + extent]))


def _between(normal: Array, offset: Array) -> Hull | None:
    """planes → the body behind all of them; None when there is none."""
    return _worked_out(np.column_stack([normal, offset]).astype(float).tobytes())


@lru_cache(maxsize=1024)
def _worked_out(data: bytes) -> Hull | None:
    """Planes as bytes → the body. A table has one for every facet, and each takes some milliseconds."""
    from scipy.optimize import linprog  # slow to load, and a control that has not touched yet needs neither
    from scipy.spatial import HalfspaceIntersection, QhullError

    planes = np.frombuffer(data).reshape(-1, 4)
    normal, offset = planes[:, :3], planes[:, 3]
    found = linprog([0, 0, 0, -1], np.column_stack([normal, np.ones(len(normal))]), offset, bounds=(None, None))
    if found.status != 0 or found.x[3] < 0.01:
        return None
    try:
        body = hull(HalfspaceIntersection(np.column_stack([normal, -offset]), found.x[:3]).intersections)
    except QhullError:
        return None
    for array in vars(body).values():
        array.setflags(write=False)  # it is given out again
    return body


def hull(points: Array) -> Hull:
    """(n, 3) mm → what they enclose."""
    from scipy.spatial import ConvexHull

    found = ConvexHull(points)
    pairs = np.unique(np.sort(np.vstack([found.simplices[:, [i, j]] for i, j in ((0, 1), (1, 2), (0, 2))]), axis=1), axis=0)
    planes = np.unique(np.round(found.equations, 9), axis=0)
    return Hull(planes[:, :3], -planes[:, 3], points[found.vertices], points[pairs])


def obstacles(artefact: Artefact) -> tuple[Hull, ...]:
    """artefact → its obstacles; a cylinder is a prism that fits into it."""
    return hulls(artefact.obstacles)


def hulls(declared: Sequence[Obstacle]) -> tuple[Hull, ...]:
    """obstacles → their hulls, each in the frame it is stated in."""
    return tuple(hull(_corners(obstacle)) for obstacle in declared)


def _corners(obstacle: Obstacle) -> Array:
    if obstacle.points is not None:
        return np.array(obstacle.points)
    if obstacle.kind == "box":
        low, high = np.array(obstacle.low), np.array(obstacle.high)
        choice = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        return np.where(choice == 0, low, high)
    assert obstacle.axis is not None and obstacle.height is not None and obstacle.radius is not None
    axis, turn = np.array(obstacle.axis), np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    one = np.linalg.svd(axis[None])[2][1]
    ring = np.array(obstacle.base) + obstacle.radius * (np.outer(np.cos(turn), one) + np.outer(np.sin(turn), np.cross(axis, one)))
    return np.vstack([ring, ring + obstacle.height * axis])
