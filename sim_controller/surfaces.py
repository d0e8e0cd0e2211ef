"""The true surfaces of the table: how far the probe ball is from touching each of them.

A facet is a patch of material under a plane, cylinder or sphere that ends `EXTENT` from the facet's point, or before that at
another side of the table; a facet on a ball is that part of the ball which is nearer to it than to the ball's other facets; an
obstacle is a solid without a name. What is between the facets is in `solids.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tango_cnc.nearest import suggestion
from tango_cnc.records import Array, Artefact, Facet, Id, InputError, Obstacle, World

from . import solids

EXTENT = 15.0  # mm, radius of the patch around a facet's point
OBLIQUE = 0.98  # cosine: facets that lie more alike than this are one side of the table, not two


@dataclass(frozen=True)
class Surfaces:
    """m surfaces, one row each; a plane has radius 0, a sphere no axis. `sign` is −1 for a bore."""

    facets: tuple[Id, ...]
    point: Array  # (m, 3) mm, nominal, table frame
    normal: Array  # (m, 3)
    centre: Array  # (m, 3) mm, a point on the plane, on the cylinder's axis, or the sphere's centre
    axis: Array  # (m, 3)
    radius: Array  # (m,)
    sign: Array  # (m,)
    offset: Array  # (m,) mm of material more than nominal on a facet of a ball; other facets are shifted along their normal
    extent: Array  # (m,) mm, inf for a ball
    ball: NDArray[np.int64]  # (m,) number of the ball, −1 for none
    edge: Array  # (f, 4) planes at which patches end: normal and mm
    ends: NDArray[np.bool_]  # (m, f) whether a patch ends at a plane
    obstacles: tuple[Obstacle, ...]
    table: solids.Table | None
    tip_radius: float


def surfaces(artefact: Artefact, world: World, tip_radius: float, extent: float = EXTENT) -> Surfaces:
    """artefact, world, mm, mm → true surfaces. Raises InputError for an offset of a facet that the artefact lacks."""
    for name in world.facets:
        if name not in artefact.facets:
            allowed = f"{', '.join(artefact.facets)}.{suggestion(name, artefact.facets)}"
            raise InputError(f"facets: found {name!r}; allowed: facets of artefact {artefact.name!r}: {allowed}")
    balls = list(artefact.balls)
    facets = list(artefact.facets.values())
    bare = [Facet("", (0, 0, 0), (0, 0, 1), ball) for ball in balls if all(f.ball != ball for f in facets)]
    rows = [(f, *_shape(f, artefact, world.facets.get(f.id, 0.0))) for f in [*facets, *bare]]
    own = [f for f in facets if f.ball is None]
    truly = np.array([np.array(f.point) + world.facets.get(f.id, 0.0) * np.array(f.normal) for f in own])
    edge = solids.edges(own, truly)
    across = np.array([f.normal for f, *_ in rows]) @ edge[:, :3].T < OBLIQUE
    return Surfaces(
        tuple(f.id for f, *_ in rows),
        np.array([f.point for f, *_ in rows]),
        np.array([f.normal for f, *_ in rows]),
        np.array([centre for _, centre, *_ in rows]),
        np.array([axis for _, _, axis, *_ in rows]),
        np.array([radius for *_, radius, _ in rows]),
        np.array([sign for *_, sign in rows]),
        np.array([world.facets.get(f.id, 0.0) if f.ball is not None else 0.0 for f, *_ in rows]),
        np.array([extent if f.ball is None else np.inf for f, *_ in rows]),
        np.array([-1 if f.ball is None else balls.index(f.ball) for f, *_ in rows], dtype=np.int64),
        edge,
        across & np.array([f.ball is None for f, *_ in rows])[:, None],
        artefact.obstacles,
        solids.table(own, truly, extent, tip_radius),
        tip_radius,
    )


def _shape(facet: Facet, artefact: Artefact, offset: float) -> tuple[Array, Array, float, float]:
    """facet, mm that it stands out → centre, axis, radius, sign."""
    normal, nothing = np.array(facet.normal, dtype=float), np.zeros(3)
    point = np.array(facet.point, dtype=float) + offset * normal
    if facet.ball is not None:
        ball = artefact.balls[facet.ball]
        return np.array(ball.centre), nothing, ball.radius, 1.0
    if facet.surface is None:
        return point, nothing, 0.0, 1.0
    sign = -1.0 if facet.surface.inside else 1.0
    axis = nothing if facet.surface.axis is None else np.array(facet.surface.axis)
    return point - sign * facet.surface.radius * normal, axis, facet.surface.radius, sign


def gap(s: Surfaces, rows: Any, tip: Array) -> Array:
    """rows of surfaces (…), (…, 3) mm tip in the table frame → (…) mm between ball and surface, positive = apart (One touch)."""
    out, distance = _outward(s, rows, tip)
    return np.where(s.radius[rows] > 0, s.sign[rows] * (distance - s.radius[rows]), out) - s.offset[rows] - s.tip_radius


def _outward(s: Surfaces, rows: Any, tip: Array) -> tuple[Array, Array]:
    """→ (…) mm above the plane, (…) mm from centre or axis."""
    away = tip - s.centre[rows]
    sideways = away - s.axis[rows] * np.sum(away * s.axis[rows], axis=-1, keepdims=True)
    return np.sum(away * s.normal[rows], axis=-1), np.linalg.norm(sideways, axis=-1)


def true_normal(s: Surfaces, rows: Any, tip: Array) -> Array:
    """rows of surfaces (n,), (n, 3) mm → (n, 3) outward unit normal where the ball touches, table frame."""
    away = tip - s.centre[rows]
    sideways = away - s.axis[rows] * np.sum(away * s.axis[rows], axis=-1, keepdims=True)
    length = np.linalg.norm(sideways, axis=-1, keepdims=True)
    curved = s.sign[rows][:, None] * sideways / np.where(length > 0, length, 1.0)
    return np.where((s.radius[rows] > 0)[:, None], curved, s.normal[rows])


def gaps(s: Surfaces, tip: Array) -> Array:
    """(n, 3) mm → (n, m + obstacles + table) mm between the ball and every patch, obstacle and the table, positive = apart."""
    rows = np.arange(len(s.facets))
    near = np.linalg.norm(tip[:, None, :] - s.point[rows], axis=-1)
    result = np.maximum(gap(s, rows, tip[:, None, :]), near - s.extent - s.tip_radius)
    beyond = tip @ s.edge[:, :3].T - s.edge[:, 3] - s.tip_radius
    result = np.maximum(result, np.where(s.ends, beyond[:, None, :], -np.inf).max(axis=-1, initial=-np.inf))
    for ball in set(s.ball.tolist()) - {-1}:
        mine = np.flatnonzero(s.ball == ball)
        nearest = mine[np.argmin(near[:, mine], axis=1)]
        result[:, mine] = np.where(mine[None, :] == nearest[:, None], result[:, mine], np.inf)
    beside = [_outside(obstacle, tip)[:, None] - s.tip_radius for obstacle in s.obstacles]
    table = [] if s.table is None else [s.table.gap(tip, s.tip_radius)[:, None]]
    return np.hstack([result, *beside, *table])


@lru_cache(maxsize=64)
def _planes(obstacle: Obstacle) -> Array:
    """solid with corners → (f, 4) normal and offset of its faces, normal @ x + offset <= 0 within."""
    from scipy.spatial import ConvexHull  # slow to load, and few tables have such an obstacle

    return np.asarray(ConvexHull(np.array(obstacle.points)).equations)


def _outside(obstacle: Obstacle, tip: Array) -> Array:
    """solid, (n, 3) mm → (n,) mm from its surface, negative inside."""
    if obstacle.kind == "hull":
        planes = _planes(obstacle)
        return np.asarray((tip @ planes[:, :3].T + planes[:, 3]).max(axis=1))  # less than the distance before edges and corners
    if obstacle.kind == "box":
        low, high = np.array(obstacle.low), np.array(obstacle.high)
        beyond = np.abs(tip - (low + high) / 2) - (high - low) / 2
    else:
        assert obstacle.axis is not None and obstacle.height is not None and obstacle.radius is not None
        axis = np.array(obstacle.axis)
        away = tip - np.array(obstacle.base)
        along = away @ axis
        around = np.linalg.norm(away - along[:, None] * axis, axis=1)
        beyond = np.column_stack([around - obstacle.radius, np.abs(along - obstacle.height / 2) - obstacle.height / 2])
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
