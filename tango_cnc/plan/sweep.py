"""What rotary axes sweep: everything on the table, and everything of a swivelling probe.

Whatever the angles: a sphere on the rotary axis nearest the foundation. A body on the outermost rotary axis keeps its distance
from a point of that axis, and that point keeps its distance from the first axis; so the radius is the sum.

Within the angles of one turn: how far anything gets in a direction. The cosine and sine of an angle are a point of an arc, and the
arc lies within the polygon of its two ends and of corners of tangents. How far a body gets is linear in that point, for each axis
by itself; so nothing gets farther within the arcs than at a corner of the polygons, in whichever order the axes turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from .. import check
from ..records import Array, Axis, Machine
from .preload import endless

PIECE = math.radians(10)  # of an arc between corners of its polygon: that is 0.4 % wider than the arc
RIM = 24  # corners around a part of the probe
BEHIND = 300.0  # mm of what carries the probe, as thick as the spindle nose
WHOLE = math.radians(359.99)  # from here on a program may round an angle of 0 … 360 to the next turn
SAME = math.radians(1e-6)

Spans = Mapping[str, tuple[float, float]]  # rotary axis → rad between which it is while axes turn


def spans(machine: Machine, *positions: Array) -> Spans:
    """machine, positions (k,) that axes turn between → what they pass on the way, on every control."""
    return {name: _span(machine.axis(name), [float(at[machine.column(name)]) for at in positions]) for name in machine.rotary}


def _span(axis: Axis, angles: Sequence[float]) -> tuple[float, float]:
    """axis, rad → from the smallest to the largest, or the whole circle where a control may go the other way round.

    That is where an axis has no limits, where half a turn or more is turned, and where the angle that a program has within 0 … 360
    is on the other side.
    """
    low, high = min(angles), max(angles)
    either = endless(axis) or high - low > math.pi - SAME
    travel = axis.travel or (-math.inf, math.inf)
    if travel[0] <= SAME and travel[1] >= math.tau - SAME:
        rolled = [math.radians(round(math.degrees(angle), 9) % 360.0) for angle in angles]
        either = either or max(rolled) > WHOLE or abs(max(rolled) - min(rolled) - (high - low)) > SAME
    return (low, low + math.tau) if either else (low, high)


def probe(machine: Machine) -> tuple[Array, Array]:
    """machine → (n, 3), (n,) mm: balls, machine frame at the zero pose, whose hull holds the probe and what carries it."""
    own, up = machine.probe, np.array(machine.spindle.direction)
    across = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    across /= np.linalg.norm(across)
    angle = 2 * np.pi * np.arange(RIM) / RIM
    rim = (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(up, across)) / np.cos(np.pi / RIM)
    tip = np.array(machine.spindle.point) - own.length * up
    nose = max(own.nose_radius, own.body_radius)
    rims = (
        (max(own.length - own.body_length, 0.0), own.body_radius),
        (own.length, nose),
        (own.length + BEHIND, nose),
    )
    balls = np.vstack([tip, *(tip + height * up + radius * rim for height, radius in rims)])
    size = np.zeros(len(balls))
    size[0] = max(own.tip_radius, own.stylus_radius)
    return balls, size


def table(solid: check.Solid) -> tuple[Array, Array]:
    """bodies → (n, 3), (n,) mm: balls, table frame, whose hull holds everything on the table."""
    return np.vstack([solid.corner, solid.centre]), np.concatenate([np.zeros(len(solid.corner)), solid.radius])


def farthest(
    machine: Machine, branch: Sequence[str], position: Array, within: Spans, balls: tuple[Array, Array], way: Array
) -> float:
    """branch, (k,), spans of its rotary axes, what it carries, direction in the machine frame → mm, as far as anything gets that way."""
    direction, height = way[None], np.zeros(1)
    for name in branch:
        axis = machine.axis(name)
        along = direction @ np.array(axis.direction)
        if axis.kind == "linear":
            height = height + position[machine.column(name)] * along
        elif axis.kind == "rotary":
            part = along[:, None] * np.array(axis.direction)
            corner = _polygon(*within[name])[:, :, None, None]
            turned = part + corner[0] * (direction - part) + corner[1] * np.cross(direction, axis.direction)
            height = (height + (direction - turned) @ np.array(axis.point)).ravel()
            direction = turned.reshape(-1, 3)
    centre, radius = balls
    return float((direction @ centre.T + height[:, None] + radius).max(initial=-np.inf))


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
    return sphere(machine, machine.workpiece_branch, np.zeros(len(machine.names)), solid.reach)


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
    x, y, z = axis.direction
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)


def sphere(machine: Machine, branch: Sequence[str], position: Array, reach: Callable[[Array], float]) -> tuple[Array, float]:
    """branch, (k,), point → radius of the outermost body around it → centre (machine frame), radius for all rotary angles.

    Linear axes between and beyond the rotary ones count as they stand.
    """
    rotary = [i for i, name in enumerate(branch) if machine.axis(name).kind == "rotary"]
    if not rotary:
        _, shift = pose(machine, branch, position)
        return shift, reach(np.zeros(3))
    inner = branch[: rotary[0]]
    rotation, shift = pose(machine, inner, position)
    axis = machine.axis(branch[rotary[0]])
    if len(rotary) == 1:
        beyond = _offset(machine, branch[rotary[0] + 1 :], position)
        centre = np.array(axis.point)
        return rotation @ centre + shift, reach(centre - beyond)
    outer = machine.axis(branch[rotary[1]])
    between = _offset(machine, branch[rotary[0] + 1 : rotary[1]], position)
    beyond = _offset(machine, branch[rotary[1] + 1 :], position)
    centre, nearest = _closest(axis, np.array(outer.point) + between, np.array(outer.direction))
    return rotation @ centre + shift, float(np.linalg.norm(nearest - centre)) + reach(nearest - between - beyond)


def _offset(machine: Machine, names: Sequence[str], position: Array) -> Array:
    """linear axes → (3,) mm, what they shift together at the zero pose of the rotary ones."""
    return sum((position[machine.column(name)] * np.array(machine.axis(name).direction) for name in names), np.zeros(3))


def _closest(axis: Axis, point: Array, direction: Array) -> tuple[Array, Array]:
    """axis and a line → the point of the axis and the point of the line that are nearest to each other."""
    p, d = np.array(axis.point), np.array(axis.direction)
    across = np.cross(d, direction)
    if across @ across < 1e-12:
        return p + ((point - p) @ d) * d, point
    s, t = np.linalg.lstsq(np.column_stack([d, -direction]), point - p, rcond=None)[0]
    return p + s * d, point + t * direction
