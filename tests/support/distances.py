"""How far a probe is from what stands on a table: the true distance of convex bodies, by nothing that the planner uses.

A plane between two bodies proves that they are as far apart as what they reach towards it. The planes of a body's faces and the one
across the tool often are enough; where they are not, the two nearest points are searched for (Gilbert, Johnson and Keerthi).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog, nnls
from scipy.spatial import HalfspaceIntersection

from tango_cnc.records import Array, Probe

NOSE = 300.0  # mm of spindle above the probe
CLOSE = 1e-4  # mm within which the nearest points are found
WEIGHT = 1e4  # mm: shares of corners sum up to one as nearly as this is larger than what is left
STEPS = 200


@dataclass(frozen=True)
class Part:
    """Of a probe: a cylinder along the tool from `low` to `high` above the tip centre, or, without height, the ball there; mm."""

    low: float
    high: float
    radius: float


@dataclass(frozen=True)
class Body:
    """On the table: a polytope by its corners (v, 3) and the unit normals (f, 3) of its faces; a ball is a corner with a radius."""

    corner: Array
    normal: Array
    radius: float = 0.0


def parts(probe: Probe) -> tuple[Part, ...]:
    """probe → ball, stem, body, nose."""
    stem = max(probe.length - probe.body_length, 0.0)
    nose = max(probe.body_radius, probe.nose_radius)
    return (
        Part(0.0, 0.0, probe.tip_radius),
        Part(0.0, stem, probe.stylus_radius),
        Part(stem, probe.length, probe.body_radius),
        Part(probe.length, probe.length + NOSE, nose),
    )


def corners(normal: Array, offset: Array) -> Array:
    """(f, 3) unit normals, (f,) mm → (v, 3) mm corners of the body behind all these planes."""
    deepest = linprog([0, 0, 0, -1], np.column_stack([normal, np.ones(len(normal))]), offset, bounds=(None, None)).x
    found: Array = HalfspaceIntersection(np.column_stack([normal, -offset]), deepest[:3]).intersections
    return found


def distance(tip: Array, tool: Array, probe: Probe, bodies: Sequence[Body], enough: float) -> float:
    """(n, 3) mm tip centres, (n, 3) directions to the spindle, table frame → mm, the least there is, or more than `enough`."""
    least = math.inf
    for part in parts(probe):
        for body in bodies:
            ways = [tool, *(np.broadcast_to(normal, tool.shape) for normal in body.normal)]
            proven = np.max([_between(part, body, tip, tool, way) for way in ways], axis=0)
            way = None  # what parts the bodies at one place nearly always does so at the next
            for row in np.flatnonzero(proven < enough):
                found, way = _nearest(part, body, tip[row], tool[row], enough, way)
                proven[row] = max(proven[row], found)
            least = min(least, float(proven.min()))
    return least


def _between(part: Part, body: Body, tip: Array, tool: Array, way: Array) -> Array:
    """(n, 3) unit vectors from the body to the part → (n,) mm between the planes across them that touch the two."""
    lean = np.einsum("ij,ij->i", tool, way)
    low = np.einsum("ij,ij->i", tip, way) + np.minimum(part.low * lean, part.high * lean)
    round_ = part.radius * (np.sqrt(np.maximum(1 - lean**2, 0.0)) if part.high > part.low else 1.0)
    result: Array = low - round_ - (way @ body.corner.T).max(axis=1) - body.radius
    return result


def _nearest(part: Part, body: Body, tip: Array, tool: Array, enough: float, way: Array | None) -> tuple[float, Array]:
    """One place of the tip, mm that are asked about, a direction that may part the two → mm, and the direction that parts them.

    mm between part and body: 0 where they meet, at most CLOSE less than it is, and no more than a proof where that is enough.
    """

    def farthest(way: Array) -> Array:
        """→ the point of the part less one of the body that is farthest in that direction."""
        size = math.sqrt(way @ way)
        lean = float(tool @ way)
        aside = way - lean * tool
        width = math.sqrt(aside @ aside)
        own = tip + (part.high if lean > 0 else part.low) * tool
        if part.high > part.low:
            own = own + (part.radius / width * aside if width > 1e-7 * size else 0.0)
        else:
            own = own + part.radius / size * way
        other = body.corner[int((body.corner @ way).argmin())] - body.radius / size * way
        return np.asarray(own - other)

    if way is not None and (proven := float(farthest(-way) @ way) / math.sqrt(way @ way)) >= enough:
        return proven, way
    found = [farthest(body.corner.mean(axis=0) - tip)]
    at, proven = found[0], 0.0
    for _ in range(STEPS):
        size = math.sqrt(at @ at)
        if size < CLOSE:
            return 0.0, at
        new = farthest(-at)
        proven = max(proven, float(new @ at) / size)
        if size - proven < CLOSE or proven >= enough:
            break
        found.append(new)
        share, _ = nnls(np.vstack([np.array(found).T, np.full(len(found), WEIGHT)]), np.array([0.0, 0.0, 0.0, WEIGHT]))
        share /= share.sum()
        found = [point for point, much in zip(found, share, strict=True) if much > 0]
        at = share[share > 0] @ np.array(found)
    return proven, at
