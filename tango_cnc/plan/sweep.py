"""What rotary axes sweep: everything on the table, and everything of a swivelling probe.

Whatever the angles: a sphere on the rotary axis nearest the foundation. A body on the outermost rotary axis keeps its distance
from a point of that axis, and that point keeps its distance from the first axis; so the radius is the sum.

Within the angles of one turn: how far anything gets in a direction, in whichever order the axes turn. By the outermost axis a point
gets as far as a sine over an interval. Cosine and sine of the other one's angle are a point of an arc; the arc lies within the
polygon of its two ends and of corners of tangents, and how far a body gets is linear in that point, hence farthest at a corner.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from .. import check
from ..check.solid import rim
from ..records import Array, Axis, Machine, Vector

PIECE = math.radians(10)  # of an arc for each corner of its polygon: that is 0.4 % wider than the arc
RIM = 24  # corners around a part of the probe
BEHIND = 300.0  # mm of what carries the probe, as thick as the spindle nose
ROOMY = math.radians(359)  # travel that some call a whole turn

UNIT = np.eye(3)

Spans = Mapping[str, tuple[float, float]]  # rotary axis → rad between which it is while axes turn
Balls = tuple[Array, Array]  # (n, 3) mm centres, (n,) mm radii


def spans(machine: Machine, start: Array, end: Array) -> Spans:
    """machine, (k,) and (k,) between which axes turn → what they pass on the way, on every control."""
    columns = {name: machine.column(name) for name in machine.rotary}
    return {name: _span(machine.axis(name), float(start[column]), float(end[column])) for name, column in columns.items()}


def _span(axis: Axis, start: float, end: float) -> tuple[float, float]:
    """axis, rad, rad → the smaller and the larger one; all round where there is room for a whole turn, and the axis turns at all.

    There a control may take the other way round, and a program may command the same place by another number.
    """
    low, high = min(start, end), max(start, end)
    roomy = axis.travel is None or axis.travel[1] - axis.travel[0] > ROOMY
    return (low, low + math.tau) if roomy and high > low else (low, high)


def probe(machine: Machine) -> Balls:
    """machine → (n, 3), (n,) mm: balls, machine frame at the zero pose, whose hull holds the probe and what carries it."""
    own, up = machine.probe, np.array(machine.spindle.direction)
    around = rim(up, RIM)
    tip = np.array(machine.spindle.point) - own.length * up
    nose = max(own.nose_radius, own.body_radius)
    rims = (
        (max(own.length - own.body_length, 0.0), own.body_radius),
        (own.length, nose),
        (own.length + BEHIND, nose),
    )
    balls = np.vstack([tip, *(tip + height * up + radius * around for height, radius in rims)])
    size = np.zeros(len(balls))
    size[0] = max(own.tip_radius, own.stylus_radius)
    return balls, size


def table(solid: check.Solid) -> Balls:
    """bodies → (n, 3), (n,) mm: balls, table frame, whose hull holds everything on the table."""
    return np.vstack([solid.corner, solid.centre]), np.concatenate([np.zeros(len(solid.corner)), solid.radius])


def reach(machine: Machine, branch: Sequence[str], position: Array, within: Spans | None, balls: Balls, way: Array) -> float:
    """branch, (k,), spans of its rotary axes or None for all angles, what it carries, direction → mm: nothing gets farther.

    The direction is one of the machine frame. Linear axes stand as they are.
    """
    sweeps = any(machine.axis(name).kind == "rotary" for name in branch)
    found = []
    if sweeps:
        centre, radius = sphere(machine, branch, position, balls)
        found.append(float(way @ centre) + radius)
    if within is not None or not sweeps:
        found.append(_farthest(machine, branch, position, within or {}, balls, way))
    return min(found)


def _farthest(machine: Machine, branch: Sequence[str], position: Array, within: Spans, balls: Balls, way: Array) -> float:
    """→ mm: how far anything gets while the rotary axes are within their spans."""
    rotary = [i for i, name in enumerate(branch) if machine.axis(name).kind == "rotary"]
    inner, beyond = (branch[: rotary[-1]], branch[rotary[-1] + 1 :]) if rotary else ([], branch)
    direction, height = way[None], np.zeros(1)  # (n, 3), (n,): a point of the next body gets direction @ point + height far
    for name in inner:
        axis = machine.axis(name)
        if axis.kind == "linear":
            height = height + position[machine.column(name)] * (direction @ np.array(axis.direction))
        else:
            point, foot = np.array(axis.point), height + direction @ np.array(axis.point)
            turned = _turned(direction, axis, *_polygon(*within[name])[:, :, None, None])
            height, direction = (foot - turned @ point).ravel(), turned.reshape(-1, 3)
    centre, radius = balls[0] + _offset(machine, beyond, position), balls[1]
    if not len(centre):
        return -math.inf
    if not rotary:
        return float((direction @ centre.T + radius).max())
    name = branch[rotary[-1]]
    return float((_by_one(machine.axis(name), within[name], direction, centre) + height[:, None] + radius).max())


def _by_one(axis: Axis, span: tuple[float, float], direction: Array, centre: Array) -> Array:
    """axis, rad, (n, 3), (v, 3) mm → (n, v) mm: how far in each direction each point gets by that axis."""
    low, high = span
    around = np.array(axis.point)
    along, cosine, sine = (_turned(direction, axis, *corner) @ (centre - around).T for corner in ((0, 0), (1, 0), (0, 1)))
    cosine, sine = cosine - along, sine - along
    ends = np.maximum(*(cosine * math.cos(angle) + sine * math.sin(angle) for angle in span))
    passes = (np.arctan2(sine, cosine) - low) % math.tau <= high - low
    return along + (direction @ around)[:, None] + np.where(passes, np.hypot(cosine, sine), ends)


def _turned(direction: Array, axis: Axis, cosine: Array | float, sine: Array | float) -> Array:
    """(n, 3) directions, axis, numbers or (m, 1, 1) → (n, 3) or (m, n, 3): as the body on it sees them when it is turned."""
    onto, across = _parts(axis.direction)
    along = direction @ onto
    return along + cosine * (direction - along) + sine * (direction @ across)


@lru_cache(maxsize=64)
def _parts(direction: Vector) -> tuple[Array, Array]:
    """unit vector u → two (3, 3): v @ the first is the part of v along u, v @ the second is v × u."""
    x, y, z = direction
    onto, across = np.outer(direction, direction), np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    onto.flags.writeable = across.flags.writeable = False
    return onto, across


def _polygon(low: float, high: float) -> Array:
    """rad → (2, n) cosine and sine of a polygon's corners that holds the arc: its ends, and between them corners of tangents."""
    pieces = max(math.ceil((high - low) / PIECE), 1)
    half = (high - low) / pieces / 2
    angle = np.concatenate([[low, high], low + half * (2 * np.arange(pieces) + 1)])
    size = np.concatenate([[1.0, 1.0], np.full(pieces, 1 / math.cos(half))])
    return size * np.array([np.cos(angle), np.sin(angle)])


def swept(machine: Machine, solid: check.Solid) -> tuple[Array, float] | None:
    """machine, bodies → centre (table frame, all axes at zero) and radius mm of what the table sweeps; None when it never turns."""
    if not any(machine.axis(name).kind == "rotary" for name in machine.workpiece_branch):
        return None
    return sphere(machine, machine.workpiece_branch, np.zeros(len(machine.names)), table(solid))


def pose(machine: Machine, branch: Sequence[str], position: Array) -> tuple[Array, Array]:
    """axes from the foundation outwards, (k,) → rotation (3, 3) and shift (3,): body frame at the zero pose → machine frame."""
    rotation, shift = np.eye(3), np.zeros(3)
    for name in branch:
        axis, value = machine.axis(name), position[machine.column(name)]
        if axis.kind == "linear":
            shift = shift + value * (rotation @ np.array(axis.direction))
        elif axis.kind == "rotary":
            turn, point = _turn(axis, value), np.array(axis.point)
            shift = shift + rotation @ (point - turn @ point)
            rotation = rotation @ turn
    return rotation, shift


def _turn(axis: Axis, angle: float) -> Array:
    """axis, rad → (3, 3) rotation about its direction (Rodrigues)."""
    onto, across = _parts(axis.direction)  # across @ v is u × v
    cosine = math.cos(angle)
    return cosine * UNIT + (1 - cosine) * onto + math.sin(angle) * across


def sphere(machine: Machine, branch: Sequence[str], position: Array, balls: Balls) -> tuple[Array, float]:
    """branch with a rotary axis, (k,), what it carries → centre (machine frame), radius mm for all rotary angles.

    Linear axes between and beyond the rotary ones count as they stand.
    """
    rotary = [i for i, name in enumerate(branch) if machine.axis(name).kind == "rotary"]
    inner = branch[: rotary[0]]
    rotation, shift = pose(machine, inner, position)
    axis = machine.axis(branch[rotary[0]])
    if len(rotary) == 1:
        beyond = _offset(machine, branch[rotary[0] + 1 :], position)
        centre = _halfway(axis, beyond, balls)
        return rotation @ centre + shift, _around(centre - beyond, balls)
    outer = machine.axis(branch[rotary[1]])
    between = _offset(machine, branch[rotary[0] + 1 : rotary[1]], position)
    beyond = _offset(machine, branch[rotary[1] + 1 :], position)
    centre, nearest = _closest(axis, np.array(outer.point) + between, np.array(outer.direction))
    return rotation @ centre + shift, float(np.linalg.norm(nearest - centre)) + _around(nearest - between - beyond, balls)


def _halfway(axis: Axis, beyond: Array, balls: Balls) -> Array:
    """axis, (3,) mm that linear axes beyond it shift what it carries → the point of its line in the middle of that, along it.

    Which point of its line machine.yaml states says nothing of the size of what turns.
    """
    point, direction = np.array(axis.point), np.array(axis.direction)
    if not len(balls[0]):
        return point
    along = (balls[0] + beyond - point) @ direction
    return np.asarray(point + ((along - balls[1]).min() + (along + balls[1]).max()) / 2 * direction)


def _around(point: Array, balls: Balls) -> float:
    """→ mm, radius of the sphere around the point that holds all of them."""
    return float((np.linalg.norm(balls[0] - point, axis=1) + balls[1]).max(initial=0.0))


def _offset(machine: Machine, names: Sequence[str], position: Array) -> Array:
    """axes, of which the linear ones count → (3,) mm, what they shift together at the zero pose of the rotary ones."""
    linear = (name for name in names if machine.axis(name).kind == "linear")
    return sum((position[machine.column(name)] * np.array(machine.axis(name).direction) for name in linear), np.zeros(3))


def _closest(axis: Axis, point: Array, direction: Array) -> tuple[Array, Array]:
    """axis and a line → the point of the axis and the point of the line that are nearest to each other."""
    p, d = np.array(axis.point), np.array(axis.direction)
    across = np.cross(d, direction)
    if across @ across < 1e-12:
        return p + ((point - p) @ d) * d, point
    s, t = np.linalg.lstsq(np.column_stack([d, -direction]), point - p, rcond=None)[0]
    return p + s * d, point + t * direction
