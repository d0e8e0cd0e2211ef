"""What of a machine may meet what: the probe, what stands on the table, and what is declared on its other bodies.

Two things are a pair when something moves between them. What moves both alike is left out of their poses: on a trunnion, a yoke on
A and a clamp on the table C are told apart by C alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..records import Array, Machine, Obstacle, Probe
from .apart import Placed, Round
from .collision import BODY_MARGIN, MARGIN
from .solid import PATCH, Solid, body_of, grown, rim

SOLID = 5.0  # mm between two things of which none is the probe, and between the probe and what is on the side of the tool
TRAVEL, TURN = 10.0, 20.0  # mm between the probe and anything else on its way between touches; while rotary axes turn
BEHIND = 300.0  # mm of what carries the probe, as thick as the spindle nose
RIM = 16  # corners around a part of the probe


@dataclass(frozen=True)
class Thing:
    """One convex thing, machine frame with all axes at zero, and the axes from the foundation outwards that move it."""

    name: str
    shape: Round
    carriers: tuple[str, ...]
    probe: bool = False
    nose: bool = False


@dataclass(frozen=True)
class Pair:
    """Two things between which something moves: `own` and `others` are the axes of each, from what moves both outwards."""

    one: Thing
    other: Thing
    own: tuple[str, ...]
    others: tuple[str, ...]
    margins: tuple[float, float, float]  # mm that they keep at a touch, on the way between touches, while axes turn

    @property
    def across(self) -> bool:
        """→ whether it is the probe and something that is not on the side of the tool."""
        return self.one.probe and self.margins[2] == TURN

    @property
    def axes(self) -> tuple[str, ...]:
        """→ every axis that moves between them."""
        return (*self.own, *self.others)


def pairs(machine: Machine, solid: Solid, names: tuple[str, ...], balls: tuple[str, ...]) -> tuple[Pair, ...]:
    """machine, bodies on its table, names of the obstacles on it, of its balls → what may meet an obstacle of the machine."""
    declared = [
        Thing(f"obstacle {number} of machine.yaml{o.name}", Round(body_of(o).corner), machine.carriers(o.on or "f"))
        for number, o in enumerate(machine.obstacles, 1)
    ]
    if not declared:
        return ()
    probe = _probe(machine)
    table = _table(machine, solid, names, balls)
    found = [_pair(one, other) for other in declared for one in (*probe, *table)]
    found += [_pair(one, other) for one, other in combinations(declared, 2)]
    return tuple(pair for pair in found if pair is not None)


def _pair(one: Thing, other: Thing) -> Pair | None:
    """two things → the pair; None where nothing moves between them, or one is where the other begins."""
    shared = 0
    while shared < min(len(one.carriers), len(other.carriers)) and one.carriers[shared] == other.carriers[shared]:
        shared += 1
    own, others = one.carriers[shared:], other.carriers[shared:]
    if not own and not others:
        return None
    if one.nose and shared:  # the housing around the spindle is where the spindle is
        return None
    at_touch = MARGIN if one.shape.radius else BODY_MARGIN
    margins = (SOLID, SOLID, SOLID) if not one.probe else (at_touch, SOLID, SOLID) if shared else (at_touch, TRAVEL, TURN)
    return Pair(one, other, own, others, margins)


def _probe(machine: Machine) -> list[Thing]:
    """→ tip, stem, body and nose of the probe. The spindle turns them about their own axis, which changes nothing."""
    probe, up, carriers = machine.probe, np.array(machine.spindle.direction), machine.tool_branch[:-1]
    tip, stem = np.array(machine.spindle.point) - probe.length * up, max(probe.length - probe.body_length, 0.0)
    things = [
        ("the tip", Round(tip[None], probe.tip_radius)),
        ("the stem", Round(np.array([tip, tip + stem * up]), probe.stylus_radius)),
        ("the probe body", Round(_prism(tip, up, stem, probe.length, probe.body_radius))),
    ]
    nose = Round(_prism(tip, up, probe.length, probe.length + BEHIND, nose_radius(probe)))
    return [*(Thing(name, shape, carriers, True) for name, shape in things), Thing("the spindle nose", nose, carriers, True, True)]


def nose_radius(probe: Probe) -> float:
    """probe → mm, of what carries it: at least as thick as its body."""
    return max(probe.nose_radius, probe.body_radius)


def _prism(tip: Array, up: Array, low: float, high: float, radius: float) -> Array:
    around = radius * rim(up, RIM)
    return np.vstack([tip + low * up + around, tip + high * up + around])


def _table(machine: Machine, solid: Solid, names: tuple[str, ...], balls: tuple[str, ...]) -> list[Thing]:
    carriers = machine.workpiece_branch
    table = [Thing("the table", Round(grown(solid.table, PATCH)), carriers)] if solid.table is not None else []
    stands = [Thing(name, Round(body.corner), carriers) for name, body in zip(names, solid.obstacles, strict=True)]
    spheres = [
        Thing(f"ball {ball}", Round(centre[None], float(size)), carriers)
        for ball, centre, size in zip(balls, solid.centre, solid.radius, strict=True)
    ]
    return [*table, *stands, *spheres]


def pose(machine: Machine, axes: tuple[str, ...], position: Array) -> tuple[Array, Array]:
    """axes from the inner one outwards, (n, k) mm rad → (n, 3, 3) turns, (n, 3) mm shifts of what they move."""
    turn, shift = np.broadcast_to(np.eye(3), (len(position), 3, 3)), np.zeros((len(position), 3))
    for name in axes:
        axis, value = machine.axis(name), position[:, machine.column(name)]
        direction = np.array(axis.direction)
        if axis.kind == "linear":
            shift = shift + value[:, None] * (turn @ direction)
        elif axis.kind == "rotary":
            own, point = _turned(direction, value), np.array(axis.point)
            shift = shift + np.einsum("nij,nj->ni", turn, point - own @ point)
            turn = turn @ own
    return turn, shift


def seen(machine: Machine, obstacle: Obstacle, position: Array) -> Array:
    """machine, obstacle on one of its bodies, (1, k) mm rad → (v, 3) mm, its corners where the table sees them."""
    turn, shift = (value[0] for value in pose(machine, machine.carriers(obstacle.on or "f"), position))
    table, origin = (value[0] for value in pose(machine, machine.workpiece_branch, position))
    return np.asarray((body_of(obstacle).corner @ turn.T + shift - origin) @ table)


def poses(machine: Machine, axes: tuple[str, ...], places: Array) -> Placed:
    """axes, (n, s, k) mm rad, rotary ones alike in all s → n poses, anywhere between the s places."""
    n, s, k = places.shape
    turn, shift = pose(machine, axes, places.reshape(n * s, k))
    return Placed(turn.reshape(n, s, 3, 3)[:, 0], shift.reshape(n, s, 3))


def _turned(direction: Array, angle: Array) -> Array:
    """(3,), (n,) rad → (n, 3, 3) rotations about it (Rodrigues)."""
    x, y, z = direction
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle)[:, None, None] * cross + (1 - np.cos(angle))[:, None, None] * (cross @ cross)
