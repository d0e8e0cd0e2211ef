"""Whether a straight probe can stand where a touch wants it: the stem and the body go from the tip towards the spindle.

Everything is judged in the table frame, where the table stands still. The approach comes down along the tool, so the probe
sweeps only its own extension upwards, then moves along the facet's normal: poses along that way, closer together than the
margin allows for, are judged one by one.

Of the table body only what the facet bounds is asked: a facet that lies within the body (a slot, a step, a bore) contradicts it.
But around the points of outer facets there is table all the same, and no part of the probe may be in there; and an inner facet
is open towards the nearest outside and where it faces, for a probe that leans, but not along the table.
A declared obstacle may be what is touched: a facet on its surface is touched like the table, every other facet keeps off it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..records import OFF, Approach, Array, Artefact, Facet, Id, Probe
from .solid import LEVEL, PATCH, Body, Solid, ring

SHANK = -0.02  # least cosine between normal and spindle direction: 1.1° of undercut is within what a table is out of square
GAP = 0.2  # mm between stem and surface while the tip touches
MARGIN = 1.0  # mm around stem and tip elsewhere
BODY_MARGIN = 2.0  # mm around the body
BEHIND = 1000.0  # mm: what carries the probe is at least as thick as its body
STEP = 1.0  # mm between the poses that are judged
ALIKE = 0.9  # least cosine between the normals of a facet and of the face that it lies on; round obstacles have few faces
SLANT = 1e-6  # cosine below which a way runs along a plane
LEAN = math.radians(60.0)  # of the probe from the shortest way out of a slot, or from the normal of what is touched in there
SIDES = 8  # of a patch
CHUNK = 4096  # touches judged at once, so that memory does not grow with their number

Mask = NDArray[np.bool_]
Kind = Literal["facing", "shank", "tip"]  # the facet looks away; stem or body would hit something; the tip would
Verdict = tuple[Mask, str, Kind]


@dataclass(frozen=True)
class Pose:
    """Touches in the table frame: tip centre at contact, outward normal, direction from the tip to the spindle."""

    facet: tuple[Id, ...]
    tip: Array  # (n, 3) mm
    normal: Array  # (n, 3)
    spindle: Array  # (n, 3)

    def rows(self, start: int, stop: int) -> Pose:
        """first row, row after the last → those touches."""
        part = slice(start, stop)
        return Pose(self.facet[part], self.tip[part], self.normal[part], self.spindle[part])


@dataclass(frozen=True)
class _Part:
    """A part of the probe: a cylinder along the tool from `low` to `high` mm above the tip centre."""

    name: str
    low: float
    high: float
    radius: float
    touching: float  # mm of air while the tip touches
    margin: float  # mm of air elsewhere

    def of(self, pose: Pose) -> tuple[Array, Array]:
        """touches → (n, 3) where its axis begins, (n, 3) mm from there to where it ends."""
        return pose.tip + self.low * pose.spindle, (self.high - self.low) * pose.spindle


@dataclass(frozen=True)
class Obstruction:
    """Why the probe cannot make a touch; at a facet that looks away only the tip is judged: the stem would have to be another."""

    why: str
    kind: Kind
    away: bool  # the facet looks away, whatever else is in the way


def obstruction(pose: Pose, probe: Probe, approach: Approach, artefact: Artefact, solid: Solid) -> dict[int, Obstruction]:
    """touches → {row: why the probe cannot make it}, empty when it can make all."""
    found: dict[int, Obstruction] = {}
    for start in range(0, len(pose.facet), CHUNK):
        for hit, why, kind in _verdicts(pose.rows(start, start + CHUNK), probe, approach, artefact, solid):
            for row in (start + np.flatnonzero(hit)).tolist():
                if (before := found.get(row)) is None:
                    found[row] = Obstruction(why, kind, kind == "facing")
                elif before.kind == "facing" and kind == "tip":
                    found[row] = Obstruction(f"{why}, and {before.why}", kind, True)
    return found


def _verdicts(pose: Pose, probe: Probe, approach: Approach, artefact: Artefact, solid: Solid) -> Iterator[Verdict]:
    stem = max(probe.length - probe.body_length, 0.0)
    parts: tuple[_Part, ...] = (
        _Part("stem", 0.0, stem, probe.stylus_radius, GAP, MARGIN),
        _Part("body", stem, probe.length + BEHIND, probe.body_radius, BODY_MARGIN, BODY_MARGIN),
    )
    if probe.nose_radius > probe.body_radius:
        nose = _Part("spindle nose", probe.length, probe.length + BEHIND, probe.nose_radius, BODY_MARGIN, BODY_MARGIN)
        parts = (*parts, nose)
    yield from _facing(pose, probe, stem)
    facets = [artefact.facets[f] for f in pose.facet]
    ball = np.array([f.ball is not None for f in facets], dtype=bool)
    farthest = approach.standoff + OFF  # where a contact right behind the stand-off sends the probe
    way = np.arange(-approach.search, farthest + STEP, STEP).clip(max=farthest)
    if solid.table is not None:
        bounding = ball | np.array([f.id in solid.outer for f in facets], dtype=bool)
        for part in parts:
            yield from (
                (bounding & hit, why, "shank") for hit, why in _touched(solid.table, "the table", part, pose, probe, approach)
            )
        if not bounding.all():
            yield from _inner(~bounding, solid, artefact, parts, pose, probe, approach)
        hit = _any(_crosses(solid.table, pose.tip + d * pose.normal, 0 * pose.tip, probe.tip_radius + MARGIN) for d in way)
        yield ball & hit, "the tip would hit the table", "tip"
    point = pose.tip - probe.tip_radius * pose.normal
    for number, body in enumerate(solid.obstacles, 1):
        name = f"obstacle {number}{artefact.obstacles[number - 1].name}"
        own = _lies_on(body, point, pose.normal)
        for part in parts:
            yield from ((own & hit, why, "shank") for hit, why in _touched(body, name, part, pose, probe, approach))
        for hit, why, kind in _obstacle(body, name, parts, pose, probe, way, approach.standoff):
            yield ~own & hit, why, kind
    for name, centre, size in zip(artefact.balls, solid.centre, solid.radius, strict=True):
        own = np.array([f.ball == name for f in facets], dtype=bool)
        yield from _ball(centre, float(size), f"ball {name}", own, parts, pose, probe, way, approach.standoff)


def _lies_on(body: Body, point: Array, normal: Array) -> Mask:
    """body, (n, 3) mm, (n, 3) → whether the facet there is a face of it: in its plane and turned like it."""
    outside = point @ body.normal.T - body.offset
    face = np.abs(outside) <= LEVEL
    alike = normal @ body.normal.T >= ALIKE
    return np.any(face & alike, axis=1) & (outside.max(axis=1) <= LEVEL)


def _inner(
    inner: Mask, solid: Solid, artefact: Artefact, parts: tuple[_Part, ...], pose: Pose, probe: Probe, approach: Approach
) -> Iterator[Verdict]:
    """Facets within the table body, which is not convex there: not by the patches of outer facets, nor far along the table."""
    assert solid.table is not None
    for outer in (artefact.facets[f] for f in sorted(solid.outer, key=str)):
        patch = _patch(solid.table, outer)
        for part in parts:
            for hit, _ in _touched(patch, "", part, pose, probe, approach):
                yield inner & hit, f"the probe would come through facet {outer.id}", "shank"
    for lift in (0.0, approach.standoff):
        why = f"the probe would come through the table: it leans more than {math.degrees(LEAN):.0f}° from every way out"
        yield inner & _buried(solid.table, pose, lift), why, "shank"


def _patch(table: Body, facet: Facet) -> Body:
    """table, outer facet → what of the table is within PATCH of the facet's normal line and of its plane."""
    normal, point = np.array(facet.normal), np.array(facet.point)
    around = ring(normal, SIDES)
    planes = np.vstack([table.normal, around, -normal])
    offset = np.concatenate([table.offset, around @ point + PATCH, [PATCH - normal @ point]])
    return Body(planes, offset, table.corner)


def _buried(table: Body, pose: Pose, lift: float) -> Mask:
    """touches, mm off their facets → whose way up through the table leans farther than LEAN from every way out."""
    begin = pose.tip + lift * pose.normal
    room, rate = table.offset - begin @ table.normal.T, pose.spindle @ table.normal.T
    way = np.where(rate > SLANT, room / np.where(rate > SLANT, rate, 1.0), np.inf).min(axis=1)
    depth = room.min(axis=1)
    facing = np.einsum("ij,ij->i", pose.normal, pose.spindle) >= math.cos(LEAN)
    return np.asarray((depth > 0) & (way * math.cos(LEAN) > depth) & ~facing)


def _facing(pose: Pose, probe: Probe, stem: float) -> Iterator[Verdict]:
    """The facet's own plane: the stem must leave it, not go through it."""
    cosine = np.einsum("ij,ij->i", pose.normal, pose.spindle)
    for row in np.flatnonzero(cosine < SHANK):
        angle = np.degrees(np.arccos(np.clip(cosine[row], -1, 1)))
        shown = f"{angle:.0f}" if angle >= 91.5 else f"{math.ceil(angle * 10) / 10:g}"  # never the 91 that is allowed
        yield (
            np.arange(len(cosine)) == row,
            f"the facet faces {shown}° away from the spindle, a straight stylus reaches up to 91°",
            "facing",
        )
    air = probe.tip_radius - probe.stylus_radius
    if air < GAP:
        grazing = cosine * max(stem, 1.0) < GAP - air
        yield (
            grazing,
            f"the stem (stylus_radius {probe.stylus_radius:g} mm) is not thinner than the tip ({probe.tip_radius:g} mm)",
            "shank",
        )


def _touched(body: Body, name: str, part: _Part, pose: Pose, probe: Probe, approach: Approach) -> Iterator[tuple[Mask, str]]:
    """The body that is touched: convex, and left along its own normal, so contact and stand-off decide for all between."""
    begin, run = part.of(pose)
    yield _crosses(body, begin, run, part.radius + part.touching), f"the {part.name} would hit {name} while the tip touches"
    lifted = begin + approach.standoff * pose.normal
    air = min(part.margin, approach.standoff / 2)
    # What comes down is as wide as the tip.
    wide = max(part.radius, probe.tip_radius if part.name == "stem" else 0.0) + air
    yield _crosses(body, lifted, run, wide), f"the {part.name} would hit {name} on the way to the stand-off"


def _obstacle(
    body: Body, name: str, parts: tuple[_Part, ...], pose: Pose, probe: Probe, way: Array, standoff: float
) -> Iterator[Verdict]:
    between = STEP / 2
    for part in parts:
        begin, run = part.of(pose)
        air = part.radius + part.margin + between
        yield _any(_crosses(body, begin + d * pose.normal, run, air) for d in way), f"the {part.name} would hit {name}", "shank"
    air = probe.tip_radius + MARGIN + between
    tall = (parts[0].high - parts[0].low) * pose.spindle
    yield _any(_crosses(body, pose.tip + d * pose.normal, 0 * tall, air) for d in way), f"the tip would hit {name}", "tip"
    yield (
        _crosses(body, pose.tip + standoff * pose.normal, tall, air),
        f"the tip would hit {name} on the way to the stand-off",
        "tip",
    )


def _ball(
    centre: Array,
    radius: float,
    name: str,
    own: Mask,
    parts: tuple[_Part, ...],
    pose: Pose,
    probe: Probe,
    way: Array,
    standoff: float,
) -> Iterator[Verdict]:
    """A ball: of its own touches only the contact counts, as the probe leaves it straight away from its centre."""
    between = STEP / 2
    for part in parts:
        begin, run = part.of(pose)
        near = np.min([_distance(centre, begin + d * pose.normal, run) for d in way], axis=0)
        clear = radius + part.radius
        hit = np.where(own, _distance(centre, begin, run) < clear + part.touching, near < clear + part.margin + between)
        yield hit, f"the {part.name} would hit {name}", "shank"
    down = _distance(centre, pose.tip + standoff * pose.normal, parts[0].high * pose.spindle)
    near = np.min([np.linalg.norm(pose.tip + d * pose.normal - centre, axis=1) for d in way], axis=0)
    clear = radius + probe.tip_radius
    yield ~own & (near < clear + MARGIN + between), f"the tip would hit {name}", "tip"
    yield (
        np.where(own, down < clear + GAP, down < clear + MARGIN + between),
        f"the tip would hit {name} on the way to the stand-off",
        "shank",
    )


def _any(masks: Iterator[Mask]) -> Mask:
    return np.logical_or.reduce(list(masks))


def _crosses(body: Body, begin: Array, run: Array, radius: float) -> Mask:
    """segments begin + t run, 0 ≤ t ≤ 1, (n, 3) each → (n,) whether they come nearer than `radius` to the body.

    The body's faces are moved out by the radius: exact at faces, a little too careful at corners (Cyrus–Beck clipping).
    """
    height = begin @ body.normal.T - (body.offset + radius)  # (n, f), negative is inside
    slope = run @ body.normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -height / slope
    enter = np.where(slope < 0, at, -np.inf).max(axis=1)
    leave = np.where(slope > 0, at, np.inf).min(axis=1)
    apart = ((slope == 0) & (height >= 0)).any(axis=1)
    return np.asarray(~apart & (np.maximum(enter, 0.0) < np.minimum(leave, 1.0)))


def _distance(point: Array, begin: Array, run: Array) -> Array:
    """(3,), segments (n, 3) → (n,) mm, distance of the point from each segment."""
    length = np.maximum(np.einsum("ij,ij->i", run, run), 1e-12)
    t = np.clip(np.einsum("ij,ij->i", point - begin, run) / length, 0.0, 1.0)
    distance: Array = np.linalg.norm(begin + t[:, None] * run - point, axis=1)
    return distance
